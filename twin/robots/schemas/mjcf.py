"""The [structure] and [parameters] of family "mjcf": a model beside robot.toml, and the numbers in which a built one may differ."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from twin.body import Counts
from twin.foundation.errors import DataError, TwinError, did_you_mean, short_repr
from twin.foundation.file_schema import TableSchema, TextLine, validate_table
from twin.foundation.parameters import Parameter
from twin.foundation.units import Scale, unit_scale
from twin.measurements.parsing.quantity_strings import parse_number
from twin.mechanics.mjcf import (
    ATTRIBUTES,
    LONGEST_STEP,
    SCALAR_JOINTS,
    Attribute,
    LoadedModel,
    applies,
    contacts_at_start,
    control_unit,
    load_model,
    outward,
    si_unit,
    slides,
    winches_of,
)
from twin.robots.schema import BOUND_STDS, ModelFile, Row, Schema, Structure

LEAST_SHARE = 1e-3  # of its own value: the lower bound of a number that cannot be negative, where nothing else is written
DEFAULT_SOURCE = "not written: usual of its kind"
_COMPONENT = re.compile(r"_([123])$")
MJCF_DIAGRAM = """\
     robot.toml ---- [structure] model = "leg.xml" ----> the MJCF beside it
     z ^
       |             The base frame is the model's world. Bodies, joints, tendons, actuators, sites and sensors have the model's
       o----> x      names; a parameter is called KIND.NAME.ATTRIBUTE (joint.knee.damping, site.guide.pos, actuator.*.kp), and its
      /              value, if it is left out, is the model's own. Gravity, too, is the model's unless [gravity] says otherwise.
     y
"""


class ModelStructure(Structure):
    """[structure] of family "mjcf"."""

    model: TextLine = Field(description="the MJCF, relative to this folder")
    tip: TextLine | None = Field(None, description="site that a tip payload hangs at; left out: the last with 'tip' in its name")
    timestep: float | None = Field(None, gt=0.0, le=0.1, description=f"s, longest step of a simulation; left out: {LONGEST_STEP}")
    tendons: int | None = Field(None, description="not written: the number of the model's actuators")

    def located(self, folder: Path) -> dict[str, object]:
        """Return the structure with the model's whole path and the names of its joints. Raises DataError for an unusable model."""
        path = (folder / self.model).resolve()
        if Path(self.model).is_absolute() or not path.is_relative_to(folder.resolve()):
            raise DataError(f"structure: model {short_repr(self.model)} leads out of the robot's folder; put it beside robot.toml")
        loaded = load_model(path)
        if self.tip is not None and self.tip not in loaded.names("site"):
            there = loaded.names("site")
            raise DataError(f"structure: tip {self.tip!r} is no site of the model; it has {', '.join(there)}")
        return {
            **self.model_dump(exclude_none=True), "model": str(path),
            "tendons": counts_of(loaded),
        }  # fmt: skip


def scalar_joints(loaded: LoadedModel) -> tuple[int, ...]:
    """Return the joints that turn or slide about one axis."""
    return tuple(j for j in range(loaded.model.njnt) if loaded.model.jnt_type[j] in SCALAR_JOINTS)


def joint_names(loaded: LoadedModel) -> tuple[str, ...]:
    """Return the names of those."""
    return tuple(loaded.names("joint")[j] for j in scalar_joints(loaded))


def counts_of(loaded: LoadedModel) -> Counts:
    """Return the number of a model's actuators, with the names of its joints and tendons."""
    return Counts.of(loaded.model.nu, joint_names(loaded), loaded.names("tendon"), winches_of(loaded), tuple(outward(loaded)))


class NumberEntry(TableSchema):
    """One entry of [parameters]; `value` left out is the model's own."""

    source: str
    value: Any = None
    unit: str | None = None
    std: Any = None
    relative_std: Any = None
    low: Any = None
    high: Any = None


@dataclass(frozen=True)
class Address:
    """A number, or a vector, of an element."""

    kind: str
    element: int
    name: str
    attribute: str

    @property
    def key(self) -> str:
        """Its name in a robot.toml."""
        return f"{self.kind}.{self.name}.{self.attribute}"

    @property
    def of(self) -> Attribute:
        """How it is read and written."""
        return ATTRIBUTES[self.kind][self.attribute]


def addresses(loaded: LoadedModel, key: str) -> list[Address]:
    """Return what a key names, several with a wildcard. Raises DataError, listing what there is, for a key that names nothing."""
    kind, _, rest = key.partition(".")
    name, _, attribute = rest.rpartition(".")
    if kind not in ATTRIBUTES or not name:
        raise DataError(
            f"{short_repr(key)} is no address; write KIND.NAME.ATTRIBUTE, KIND one of {', '.join(ATTRIBUTES)}"
            f"{did_you_mean(kind, ATTRIBUTES)}"
        )
    if attribute not in ATTRIBUTES[kind]:
        known = ATTRIBUTES[kind]
        raise DataError(f"{key}: a {kind} has {', '.join(known)}, no {short_repr(attribute)}{did_you_mean(attribute, known)}")
    names = loaded.names(kind)
    exact = [k for k, each in enumerate(names) if each == name]
    found = exact or [k for k, each in enumerate(names) if fnmatch.fnmatchcase(each, name)]
    if not exact:
        found = [k for k in found if applies(loaded.model, kind, k, attribute) and (kind != "body" or k)]
    if not found:
        raise DataError(f"{key}: the model has no {kind} {short_repr(name)}; it has {', '.join(names)}{did_you_mean(name, names)}")
    if any(not applies(loaded.model, kind, k, attribute) for k in found):
        why = (
            "joint {name!r} has more than one axis; only its pos can be given"
            if kind == "joint"
            else ("actuator {name!r} is no motor and no servo; give its gain or bias")
        )
        raise DataError(f"{key}: {why.format(name=name)}")
    return [Address(kind, k, names[k], attribute) for k in found]


@lru_cache(maxsize=4096)
def address_of(loaded: LoadedModel, name: str) -> tuple[Address, int]:
    """Return the number that a parameter is, and its component (from 0)."""
    found = _COMPONENT.search(name)
    if found is not None:
        plain = name[: found.start()]
        attribute = plain.rpartition(".")[2]
        if attribute in ("pos", "ipos", "range", "springlength", "forcerange"):
            return addresses(loaded, plain)[0], int(found[1]) - 1
    return addresses(loaded, name)[0], 0


def model_parameters(structure: Mapping[str, object], table: Mapping[str, Any], problems: list[str]) -> list[Parameter]:
    """Read [parameters]: an exact name goes before a wildcard that covers it. Problems are added to `problems`."""
    loaded = load_model(str(structure["model"]))
    if not table:
        return usual_parameters(loaded)
    chosen: dict[str, tuple[Address, NumberEntry]] = {}
    for key in sorted(table, key=lambda k: not ("*" in k or "?" in k)):  # wildcards first, exact ones over them
        try:
            named = addresses(loaded, key)
        except DataError as error:
            problems.append(f"parameters: {error}")
            continue
        entry = validate_table(NumberEntry, table[key], f"parameter {key!r}", problems)
        chosen |= {each.key: (each, entry) for each in named if entry is not None}
    found = []
    for address, entry in chosen.values():
        try:
            found += entry_parameters(loaded, address, entry)
        except TwinError as error:
            problems.append(f"parameter {address.key!r}: {error}")
    return found


def usual_parameters(loaded: LoadedModel) -> list[Parameter]:
    """Return the numbers in which robots of this kind usually differ, as wide as `Attribute.relative_std` says."""
    found = []
    for uncertain, _ in usual_classes(loaded).values():
        for address in uncertain:
            entry = NumberEntry(source=DEFAULT_SOURCE, relative_std=address.of.relative_std)
            found += entry_parameters(loaded, address, entry)
    return found


def usual_classes(loaded: LoadedModel) -> dict[tuple[str, str], tuple[list[Address], list[Address]]]:
    """Return, by kind and attribute, the numbers in which robots usually differ, and those alike that are 0 in the model."""
    found = {}
    for kind, known in ATTRIBUTES.items():
        for attribute in [a for a, of in known.items() if of.relative_std]:
            every = [
                Address(kind, k, name, attribute)
                for k, name in enumerate(loaded.names(kind))
                if applies(loaded.model, kind, k, attribute) and (kind != "body" or (k > 0 and loaded.model.body_weldid[k] != 0))
            ]
            sizes = [float(a.of.read(loaded.model, a.element)[0]) for a in every]
            uncertain = [a for a, size in zip(every, sizes, strict=True) if size > 0.0]
            found[kind, attribute] = uncertain, [a for a, size in zip(every, sizes, strict=True) if size == 0.0]
    return found


def entry_parameters(loaded: LoadedModel, address: Address, entry: NumberEntry) -> list[Parameter]:
    """Return the parameters of an entry, SI: one, or KEY_1, KEY_2, ... of a vector's components that are uncertain or given.

    Raises DataError for a list of another length, a unit of another dimension, a std that is not positive, and bounds that do not
    hold the value.
    """
    if not entry.source.strip():
        raise DataError("source is empty; say where the number comes from, or that it is assumed")
    own = address.of.read(loaded.model, address.element)
    si = si_unit(loaded.model, address.kind, address.element, address.of)
    scale = unit_scale(entry.unit or si, si)
    n = len(own)
    value = own if entry.value is None else np.array([scale.to_si(x) for x in _numbers("value", entry.value, n)])
    std = _stds(entry, value, scale)
    made = []
    for i in range(n):
        if std[i] == 0.0 and entry.value is None:
            continue
        low, high = _bounds(address.of, entry, float(value[i]), float(std[i]), scale)
        name = address.key if n == 1 else f"{address.key}_{i + 1}"
        if not low <= value[i] <= high or not low < high:
            raise DataError(f"value {value[i]:g} {si} lies outside its bounds {low:g} to {high:g}; correct one of them")
        made.append(Parameter(name, float(value[i]), si, low, high, entry.source, float(std[i]) or None, None, entry.unit or si))
    return made


def _numbers(key: str, written: object, n: int) -> list[float]:
    try:
        many = [parse_number(x) for x in written] if isinstance(written, Sequence) and not isinstance(written, str) else None
        many = many if many is not None else [parse_number(written)] * n
    except DataError as error:
        raise DataError(f"{key}: {error}") from None
    if len(many) != n:
        raise DataError(f"{key} has {len(many)} numbers; {n} are needed")
    return many


def _stds(entry: NumberEntry, value: np.ndarray, scale: Scale) -> np.ndarray:
    """Return the standard deviations (n,) SI, 0 of exact components."""
    if entry.std is not None and entry.relative_std is not None:
        raise DataError("it has a std and a relative_std; give one of them")
    n = len(value)
    if entry.std is not None:
        std = np.array([scale.without_offset().to_si(x) for x in _numbers("std", entry.std, n)])
    elif entry.relative_std is not None:
        std = np.array(_numbers("relative_std", entry.relative_std, n)) * np.abs(value)
        if not std.any():
            raise DataError("a relative_std of a number that is 0 says nothing; give a std with its unit")
    else:
        return np.zeros(n)
    if (std < 0.0).any() or not std.any():
        raise DataError("a standard deviation above zero is needed, 0 for components that are exact, none where all are")
    return std


def _bounds(attribute: Attribute, entry: NumberEntry, value: float, std: float, scale: Scale) -> tuple[float, float]:
    width = BOUND_STDS * std if std else np.inf
    low, high = value - width, value + width
    if attribute.positive:
        low = max(low, LEAST_SHARE * value, 0.0)
    if entry.low is not None:
        low = float(scale.to_si(_numbers("low", entry.low, 1)[0]))
    if entry.high is not None:
        high = float(scale.to_si(_numbers("high", entry.high, 1)[0]))
    return low, high


def usual_channels(loaded: LoadedModel) -> list[tuple[str, str, str, float]]:
    """Return what is usually logged: controls, and positions of joints."""
    model, found = loaded.model, []
    for k, name in enumerate(loaded.names("actuator")):
        found.append((f"actuator.{name}.ctrl", "input", control_unit(model, k), 1e-6))
    for k in scalar_joints(loaded):
        sliding = slides(model, "joint", k)
        found.append((f"joint.{loaded.names('joint')[k]}.position", "output", "mm" if sliding else "deg", 0.1))
    return found


def model_gravity(structure: Mapping[str, object]) -> np.ndarray:
    """Return the model's own gravity (3,) m/s^2."""
    return np.array(load_model(str(structure["model"])).model.opt.gravity, float)


def model_notices(structure: Mapping[str, object], table: Mapping[str, Any]) -> tuple[str, ...]:
    """Return remarks on what was assumed of a model, and on contacts that it begins with."""
    touching = contacts_at_start(load_model(str(structure["model"])))
    met = (f"the model begins with {touching} contacts: they are stepped as MuJoCo has them, and nothing is fitted through them",)
    remarks = met if touching else ()
    if table:
        return remarks
    return (
        *remarks,
        "robot.toml declares no [parameters]: masses, inertias, springs, dampers and gains are taken to differ as is usual of "
        "their kind (3 to 30 %)",
    )


MJCF_SCHEMA = Schema(
    structure=ModelStructure,
    rows=(),
    accuracy=Row("accuracy", "m", "mm", "what the description is believed to be good for: no smaller effect is claimed", 1e-9, 0.1),
    find_conflicts=lambda structure, values: [],
    usual_channels=lambda structure: usual_channels(load_model(structure.model)),
    diagram=MJCF_DIAGRAM,
    model_file=ModelFile(ModelStructure.located, model_parameters, model_gravity, model_notices),
)
