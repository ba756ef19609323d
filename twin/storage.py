"""`twin.toml`: the robot, the calibrated parameters and the effects in force, everything needed to predict again."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from twin.effects import named
from twin.errors import DataError
from twin.quantities import Fitted, Parameter, overrides, si_factor, si_unit
from twin.robots import available, load
from twin.robots.toml_file import opened
from twin.twin import Twin

FORMAT = "twin/1"
SECTIONS = {"format", "robot", "parameters", "effect", "provenance"}


def read_twin(source: str | Path) -> Twin:
    """A twin from a `twin.toml`, a folder that holds one (a report), or a robot's name alone.

    Raises DataError where the file breaks its contract, UnknownNameError for a robot's name that does not exist.
    """
    path = Path(source)
    if path.is_dir() and (path / "twin.toml").is_file():
        path = path / "twin.toml"
    if path.suffix != ".toml" or not path.is_file():
        if path.suffix == ".toml" or (os.sep in str(source) and not (path / "robot.toml").is_file()):
            raise DataError(f"{path}: no such twin; give a twin.toml, a folder with one, or a robot: {', '.join(available())}")
        return Twin.of(load(str(source)))
    with opened(path, FORMAT) as table:
        return _twin(table, path.parent)


def _twin(table: Mapping[str, Any], folder: Path) -> Twin:
    if not isinstance(table.get("robot"), str):
        raise DataError(f"`robot` is missing; name one of {', '.join(available())}, or a path to a robot's folder")
    if unread := sorted(set(table) - SECTIONS):
        raise DataError(f"no section {unread[0]!r} is known; allowed are {', '.join(sorted(SECTIONS))}")
    robot = load(table["robot"], folder)
    values = _values(table.get("parameters", {}), robot.parameters)
    overrides(robot.parameters, values)
    entries = table.get("effect", [])
    if not (isinstance(entries, list) and all(isinstance(e, dict) for e in entries)):
        raise DataError(f"`effect` is {entries!r}; write each effect as its own [[effect]]")
    effects = []
    for entry in entries:
        law = named(str(entry.get("id")))
        effects.append(law(_values(entry.get("parameters", {}), law.declared(robot.n_tendon)), robot.n_tendon))
    if twice := {e.id for e in effects if sum(o.id == e.id for o in effects) > 1}:
        raise DataError(f"effect {', '.join(sorted(twice))} stands there twice; merge the two")
    return Twin(robot, values, tuple(effects))


def _values(table: Any, declared: tuple[Parameter, ...]) -> dict[str, float]:
    """Values of a parameter table: plain SI numbers, or {value, unit, std}."""
    units = {p.name: p.unit for p in declared}
    out = {}
    if not isinstance(table, Mapping):
        raise DataError(f"parameters are {table!r}; write a table of name = {{ value = ..., unit = ... }}")
    for name, entry in table.items():
        if name not in units:
            raise DataError(f"no parameter named {name!r}; available: {', '.join(sorted(units))}")
        try:
            if isinstance(entry, Mapping):
                unit = str(entry.get("unit", units[name]))
                if si_unit(unit, name) != units[name]:
                    raise DataError(f"parameter {name!r} is in {unit!r}; a unit like {units[name]!r} is needed")
                out[name] = float(entry["value"]) * si_factor(unit, name)
            else:
                out[name] = float(entry)
        except (KeyError, TypeError, ValueError):
            raise DataError(f"parameter {name!r} is {entry!r}; write a number, or {{ value = ..., unit = ... }}") from None
    return out


def twin_table(twin: Twin, parameters: Mapping[str, Fitted], effects: Mapping[str, Mapping[str, Fitted]]) -> dict[str, Any]:
    """A twin as its file's content; standard errors where a fit found them."""
    units = {p.name: p.unit for p in twin.robot.parameters}
    table: dict[str, Any] = {"format": FORMAT, "robot": robot_reference(twin)}
    table["parameters"] = {n: entry(parameters.get(n) or Fitted(v, None, units[n])) for n, v in sorted(twin.values.items())}
    table["effect"] = []
    for effect in twin.effects:
        laws = {p.name: p.unit for p in effect.declared(effect.n_tendon)}
        found = effects.get(effect.id, {})
        values = {n: entry(found.get(n) or Fitted(v, None, laws[n])) for n, v in effect.values.items()}
        table["effect"].append({"id": effect.id, "parameters": values})
    return table


def robot_reference(twin: Twin) -> str:
    """The robot's name where it ships with the program, else the path to its folder."""
    return twin.robot.name if twin.robot.name in available() else str(twin.robot.folder)


def entry(fitted: Fitted) -> dict[str, Any]:
    """A value with unit and, where known, standard error, as reports and twins write it."""
    out: dict[str, Any] = {"value": fitted.value, "unit": fitted.unit}
    return out if fitted.std is None else {**out, "std": fitted.std}


def write_twin(path: Path, table: Mapping[str, Any], provenance: Mapping[str, Any]) -> None:
    """Writes a twin whole or not at all: to a neighbour first, then renamed."""
    whole = path.with_name(path.name + ".part")
    whole.write_text(tomli_w.dumps({**table, "provenance": dict(provenance)}), "utf-8")
    whole.replace(path)
