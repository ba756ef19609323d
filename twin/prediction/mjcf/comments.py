"""What an exported MJCF says about its numbers: values, standard errors, probabilities."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from twin.body.drives.counts import joint_names, tendon_names
from twin.effects import Effect
from twin.foundation.errors import DataError
from twin.foundation.files import is_file
from twin.foundation.parameters import Parameter
from twin.mechanics.mjcf import ModelBody
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import standard_errors
from twin.robots.schemas.mjcf import address_of


@dataclass(frozen=True)
class Origins:
    """Where a twin's numbers come from: standard errors (SI) by name, `EFFECT.PARAMETER` of an effect's, and words by effect."""

    std: Mapping[str, float] = field(default_factory=dict)
    said: Mapping[str, str] = field(default_factory=dict)


def origins_of(source: str | Path) -> Origins:
    """Return the standard errors in a twin's file, and the probabilities of its effects in a report beside it."""
    path = Path(source)
    report = (path if path.is_dir() else path.parent) / "report.json"
    said: dict[str, str] = {}
    if is_file(report):
        try:
            claims: list[dict[str, Any]] = json.loads(report.read_text("utf-8"))["effects"]
            said = {c["id"]: f"probability {c['probability']:.3g}" for c in claims if c.get("probability") is not None}
        except (OSError, ValueError, KeyError, TypeError):
            raise DataError(f"{report}: not a report's file; write the report again, or move the twin.toml away from it") from None
    return Origins(standard_errors(source), said)


def heading(twin: Twin, body: ModelBody, origins: Origins) -> str:
    """Return what is said on top: what the file is, and the parameters that belong to no element."""
    lines = [
        f"Twin of {twin.robot.name}: {twin.robot.title}.",
        "SI units. Before an element: its numbers as fitted, +- standard error, and as described; effects with their probability.",
    ]
    for effect in twin.effects:
        places = _elements(effect, body.loaded.names("actuator"))
        own = [p for p in effect.all_parameters(effect.n_tendon) if p.name not in places]
        lines += [_said(effect, p, origins) for p in own if effect[p.name] != p.value]
        if effect.acts_in("by_step") and effect.by_step(1.0, np.zeros(int(effect.n_tendon))) is None:
            lines[-1] += ": not written, since the log's outputs run ahead of its inputs, which no model does"
    return "\n       ".join(lines)


def chain_heading(twin: Twin, origins: Origins) -> str:
    """Return what is said on top of a rod's file: its calibrated numbers, its effects, and what plain MuJoCo does not do."""
    described = {p.name: p for p in twin.robot.parameters}
    lines = [
        f"Twin of {twin.robot.name}: {twin.robot.title}.",
        "SI units. ctrl is the tension of a tendon in N. Gravity, payload, springs and routes hold the effects below.",
        *(
            f"calibrated: {name} = {_number(v, origins.std.get(name), described[name].unit)}, described {described[name].value:.6g}"
            for name, v in sorted(twin.values.items())
            if v != described[name].value
        ),
    ]
    for effect in twin.effects:
        lines += [_said(effect, p, origins) for p in effect.all_parameters(effect.n_tendon) if effect[p.name] != p.value]
    lines.append(
        "Plain MuJoCo does not do: friction of tendons, creep, bowing of the rod between its disks and its bending in two planes "
        "at once, stretch of tendons, SMA springs, lags, load cells and cameras. twin.prediction.mjcf.ChainStepper does, by the "
        "twin.toml beside this file: it repeats `twin rollout` under tensions."
    )
    return "\n       ".join(lines)


def element_comments(twin: Twin, body: ModelBody, origins: Origins) -> dict[tuple[str, str], list[str]]:
    """Return what is said before each element, by kind and name."""
    said: dict[tuple[str, str], list[str]] = {}
    for p in twin.robot.parameters:
        value = twin.values.get(p.name, p.value)
        if value != p.value:
            address, component = address_of(body.loaded, p.name)
            of_vector = f"[{component + 1}]" if component or len(address.of.read(body.model, address.element)) > 1 else ""
            number = _number(value, origins.std.get(p.name), p.unit)
            line = f"calibrated: {address.attribute}{of_vector} = {number}, described {p.value:.6g}"
            said.setdefault((address.kind, address.name), []).append(line)
    actuators = body.loaded.names("actuator")
    for effect in twin.effects:
        places = _elements(effect, actuators)
        for p in effect.all_parameters(effect.n_tendon):
            if p.name in places and effect[p.name] != p.value:
                said.setdefault(places[p.name], []).append(_said(effect, p, origins))
    return said


def _elements(effect: Effect, actuators: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return the element, (kind, name), of each parameter that an effect has for elements."""
    n = effect.n_tendon
    joints = {f"{p.name}_{joint}": ("joint", joint) for joint in joint_names(n) for p in effect.per_joint}
    drives = {f"{p.name}_{i}": ("actuator", name) for i, name in enumerate(actuators, 1) for p in effect.per_tendon}
    tendons = {f"{of}_{tendon}": ("tendon", tendon) for tendon in tendon_names(n) for of in ("mu", "stretch", "out")}
    declared = {p.name for p in effect.all_parameters(n)}
    return {name: place for name, place in {**tendons, **drives, **joints}.items() if name in declared}


def _said(effect: Effect, p: Parameter, origins: Origins) -> str:
    number = _number(effect[p.name], origins.std.get(f"{effect.id}.{p.name}"), p.unit)
    return ", ".join([f"{effect.id}: {p.name} = {number}", *filter(None, [origins.said.get(effect.id)])])


def _number(value: float, std: float | None, unit: str) -> str:
    return f"{value:.6g}{'' if std is None else f' +- {std:.2g}'}{'' if unit == '1' else f' {unit}'}"
