"""`twin.toml`: the robot, the calibrated parameters and the effects in force, everything needed to predict again."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import Field

from twin.errors import DataError, listed, shown
from twin.forms import Form, Line, fill
from twin.measurements.files import is_file
from twin.quantities import Fitted
from twin.robots import Robot, available, load
from twin.robots.effect_tables import read_effects, read_values
from twin.robots.robot import models_folder
from twin.robots.toml_file import opened
from twin.twin import Twin

FORMAT = "twin/1"


def read_twin(source: str | Path) -> Twin:
    """A twin from a `twin.toml`, a folder that holds one (a report), or a robot's name alone.

    Raises DataError where the file breaks its contract, UnknownNameError for a robot's name that does not exist.
    """
    path = Path(source)
    if is_file(path / "twin.toml"):
        path = path / "twin.toml"
    if path.suffix != ".toml" or not is_file(path):
        if path.suffix == ".toml" or (os.sep in str(source) and not is_file(path / "robot.toml")):
            robots = f"the folder of a robot, or one of {', '.join(available())}"
            raise DataError(f"{shown(str(path), 300)}: no such twin; give a twin.toml, a folder with one, {robots}")
        return Twin.of(load(str(source)))
    with opened(path, FORMAT) as table:
        return _twin(table, path.parent)


def standard_errors(source: str | Path) -> dict[str, float]:
    """Standard errors (SI) of a twin's parameters, where its file has them; none of a robot's name alone."""
    path = Path(source)
    path = path / "twin.toml" if is_file(path / "twin.toml") else path
    if path.suffix != ".toml":
        return {}
    with opened(path, FORMAT) as table:
        file = fill(TwinFile, table, "", [])
    entries = file.parameters if file is not None else {}
    return {n: float(e["std"]) for n, e in entries.items() if isinstance(e, dict) and isinstance(e.get("std"), float)}


class TwinFile(Form):
    """The top of a `twin.toml`."""

    format: str = Field(description=f'"{FORMAT}"')
    robot: Line = Field(description="a robot's name, or the path to its folder from this file")
    parameters: dict[str, Any] = Field({}, description="calibrated values; what is absent keeps the robot's nominal value")
    effect: list[Any] = Field([], description="[[effect]] tables: the laws in force")
    provenance: dict[str, Any] = Field({}, description="versions, seed, data hash, command, date; free")


def _twin(table: Mapping[str, Any], folder: Path) -> Twin:
    """The twin of a file's content. Raises DataError with all that is wrong with it."""
    problems: list[str] = []
    file = fill(TwinFile, table, "", problems)
    if file is None:
        raise DataError(listed(problems))
    robot = load(file.robot, folder)
    values = read_values(file.parameters, robot.parameters, "parameters", problems)
    effects = read_effects(file.effect, robot.n_tendon, robot.size, problems)
    if not problems:
        problems += robot.objections(values)
    if problems:
        raise DataError(listed(problems))
    return Twin(robot, values, tuple(effects))


def twin_table(
    twin: Twin, folder: Path, parameters: Mapping[str, Fitted], effects: Mapping[str, Mapping[str, Fitted]]
) -> dict[str, Any]:
    """A twin as the content of its file in `folder`; standard errors where a fit found them."""
    units = {p.name: p.unit for p in twin.robot.parameters}
    table: dict[str, Any] = {"format": FORMAT, "robot": robot_reference(twin.robot, folder)}
    table["parameters"] = {n: entry(parameters.get(n) or Fitted(v, None, units[n])) for n, v in sorted(twin.values.items())}
    table["effect"] = []
    for effect in twin.effects:
        laws = {p.name: p.unit for p in effect.declared(effect.n_tendon)}
        found = effects.get(effect.id, {})
        values = {n: entry(found.get(n) or Fitted(v, None, laws[n])) for n, v in effect.values.items()}
        table["effect"].append({"id": effect.id, "parameters": values})
    return table


def robot_reference(robot: Robot, folder: Path) -> str:
    """The robot's name where it ships with the program, else the path from `folder` to its own, which is no such name."""
    if robot.folder == (models_folder() / robot.name).resolve():
        return robot.name
    path = Path(os.path.relpath(robot.folder, folder.resolve())).as_posix()
    return path if path.startswith("..") else f"./{path}"


def entry(fitted: Fitted) -> dict[str, Any]:
    """A value with unit and, where known, standard error, as reports and twins write it."""
    out: dict[str, Any] = {"value": fitted.value, "unit": fitted.unit}
    return out if fitted.std is None else {**out, "std": fitted.std}


def write_twin(path: Path, table: Mapping[str, Any], provenance: Mapping[str, Any]) -> None:
    """Writes a twin whole or not at all: to a neighbour first, then renamed."""
    whole = path.with_name(path.name + ".part")
    whole.write_text(tomli_w.dumps({**table, "provenance": dict(provenance)}), "utf-8")
    whole.replace(path)
