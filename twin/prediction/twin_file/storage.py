"""`twin.toml`: the robot, the calibrated parameters and the effects in force, all that a prediction needs."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import Field

from twin.effects import catalogue
from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError, join_problems, short_repr
from twin.foundation.file_schema import TableSchema, TextLine, validate_table
from twin.foundation.files import is_file
from twin.foundation.parameters import FittedValue
from twin.foundation.toml_file import open_toml
from twin.prediction.twin import Twin
from twin.prediction.twin_file.joint_errors import CorrelationTable
from twin.robots import Robot, load, load_family, robot_names
from twin.robots.effect_tables import read_effects, read_values
from twin.robots.robot import models_folder

TWIN_FORMAT = "twin/1"


def read_twin(source: str | Path) -> Twin:
    """Read a twin from a `twin.toml`, a folder that holds one (a report), or a robot's name alone.

    Raises DataError where the file breaks its contract, UnknownNameError for a robot's name that does not exist.
    """
    path = Path(source)
    if is_file(path / "twin.toml"):
        path = path / "twin.toml"
    if path.suffix != ".toml" or not is_file(path):
        if path.suffix == ".toml" or (os.sep in str(source) and not is_file(path / "robot.toml")):
            robots = f"the folder of a robot, or one of {', '.join(robot_names())}"
            raise DataError(f"{short_repr(str(path), 300)}: no such twin; give a twin.toml, a folder with one, {robots}")
        return Twin.of(load(str(source)))
    with open_toml(path, TWIN_FORMAT) as table:
        return _twin(table, path.parent)


def standard_errors(source: str | Path) -> dict[str, float]:
    """Return the standard errors (SI) of a twin's parameters, and as EFFECT.PARAMETER of its effects', where its file has them.

    There are none for a robot's name alone.
    """
    path = Path(source)
    path = path / "twin.toml" if is_file(path / "twin.toml") else path
    if path.suffix != ".toml":
        return {}
    with open_toml(path, TWIN_FORMAT) as table:
        file = validate_table(TwinFile, table, "", [])
    entries: dict[str, Any] = dict(file.parameters) if file is not None else {}
    for effect in file.effect if file is not None else []:
        if isinstance(effect, dict) and isinstance(effect.get("parameters"), dict):
            entries |= {f"{effect.get('id')}.{n}": e for n, e in effect["parameters"].items()}
    return {n: float(e["std"]) for n, e in entries.items() if isinstance(e, dict) and isinstance(e.get("std"), float)}


def correlations(source: str | Path) -> dict[tuple[str, str], float] | None:
    """Return the correlations of the errors that `standard_errors` names, by pairs; None where the twin's file has none."""
    path = Path(source)
    path = path / "twin.toml" if is_file(path / "twin.toml") else path
    if path.suffix != ".toml":
        return None
    with open_toml(path, TWIN_FORMAT) as table:
        file = validate_table(TwinFile, table, "", [])
    together = None if file is None else validate_table(CorrelationTable, file.correlation, "correlation", [])
    return None if together is None else together.pairs()


class TwinFile(TableSchema):
    """The top of a `twin.toml`."""

    format: str = Field(description=f'"{TWIN_FORMAT}"')
    robot: TextLine = Field(description="a robot's name, or the path to its folder from this file")
    timestep: float | None = Field(None, gt=0.0, le=0.1, description="s, of an MJCF: longest step, in place of its robot.toml's")
    parameters: dict[str, Any] = Field({}, description="calibrated values; what is absent keeps the robot's nominal value")
    effect: list[Any] = Field([], description="[[effect]] tables: the laws in force")
    correlation: dict[str, Any] | None = Field(None, description="how the errors of fitted values go together")
    provenance: dict[str, Any] = Field({}, description="versions, seed, data hash, command, date; free")


def _twin(table: Mapping[str, Any], folder: Path) -> Twin:
    """Return the twin of a file's content. Raises DataError with all its faults."""
    problems: list[str] = []
    file = validate_table(TwinFile, table, "", problems)
    if file is None:
        raise DataError(join_problems(problems))
    robot = load(file.robot, folder)
    if file.timestep is not None and "timestep" not in load_family(robot.family).SCHEMA.structure.model_fields:
        problems.append(f"timestep: robot {robot.name!r} chooses its own steps; leave it out")
    elif file.timestep is not None:
        robot = replace(robot, structure={**robot.structure, "timestep": file.timestep})
    values = read_values(file.parameters, robot.parameters, "parameters", problems)
    effects = read_effects(file.effect, robot.n_tendon, robot.size, problems)
    together = None if file.correlation is None else validate_table(CorrelationTable, file.correlation, "correlation", problems)
    if together is not None:
        of_effects = (f"{e}.{p.name}" for e, kind in catalogue().items() for p in kind.all_parameters(robot.n_tendon))
        problems += together.faults({*(p.name for p in robot.parameters), *of_effects})
    if not problems:
        problems += robot.find_conflicts(values)
    if problems:
        raise DataError(join_problems(problems))
    return Twin(robot, values, tuple(effects))


def twin_table(
    twin: Twin, folder: Path, parameters: Mapping[str, FittedValue], effects: Mapping[str, Mapping[str, FittedValue]]
) -> dict[str, Any]:
    """Return a twin as the content of its file in `folder`, with standard errors where a fit found them; `twin_text` adds
    correlations."""
    units = {p.name: p.unit for p in twin.robot.parameters}
    table: dict[str, Any] = {"format": TWIN_FORMAT, "robot": robot_reference(twin.robot, folder)}
    if "timestep" in twin.robot.structure:
        table["timestep"] = twin.robot.structure["timestep"]
    table["parameters"] = {
        n: value_entry(parameters.get(n) or FittedValue(v, None, units[n])) for n, v in sorted(twin.values.items())
    }
    table["effect"] = []
    for effect in twin.effects:
        laws = {p.name: p.unit for p in effect.all_parameters(effect.n_tendon)}
        found = effects.get(effect.id, {})
        values = {n: value_entry(found.get(n) or FittedValue(v, None, laws[n])) for n, v in effect.values.items()}
        table["effect"].append({"id": effect.id, "parameters": values})
    return table


def robot_reference(robot: Robot, folder: Path) -> str:
    """Return the robot's name if it ships with the program, else the path from `folder` to its own."""
    if robot.folder == (models_folder() / robot.name).resolve():
        return robot.name
    path = Path(os.path.relpath(robot.folder, folder.resolve())).as_posix()
    return path if path.startswith("..") else f"./{path}"


def value_entry(fitted: FittedValue) -> dict[str, Any]:
    """Return a value with unit and, where known, standard error, as reports and twins write it."""
    out: dict[str, Any] = {"value": fitted.value, "unit": fitted.unit}
    return out if fitted.std is None else {**out, "std": fitted.std}


def write_twin(
    path: Path, table: Mapping[str, Any], provenance: Mapping[str, Any], correlation: tuple[Sequence[str], np.ndarray] | None = None
) -> None:  # fmt: skip
    """Write a twin completely or not at all, through a temporary file."""
    write_atomically(path, twin_text(table, provenance, correlation).encode(), "give another place with --out")


def twin_text(
    table: Mapping[str, Any], provenance: Mapping[str, Any], correlation: tuple[Sequence[str], np.ndarray] | None = None
) -> str:  # fmt: skip
    """Return the text of a `twin.toml`, with the `correlation` (p, p) of the errors of named parameters."""
    together = None if correlation is None else CorrelationTable.of(*correlation)
    text = tomli_w.dumps({**table, "provenance": dict(provenance)})
    return text if together is None else f"{text}\n{together.text()}"
