"""`Robot` is data: the numbers of a `robot.toml`, each with unit and source, and the name of the family that builds it."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from twin.effects import named
from twin.errors import DataError, UnknownNameError
from twin.quantities import Parameter, Values, overrides, si_factor, si_unit
from twin.robots.body import Body
from twin.robots.toml_file import opened
from twin.springs import PARAMETERS, Spring, springs_of

FORMAT = "twin-robot/1"


@dataclass(frozen=True)
class Robot:
    """A described robot; nothing in it is hidden in code.

    `parameters` hold SI values; those with a `std` are uncertain in a built robot (the nuisance parameters). `effects` are
    the laws the robot is known to have: (identifier, parameter values). `accuracy` is the description's own error,
    m of its markers or rad of its jaw.
    """

    name: str
    family: str
    title: str
    folder: Path
    structure: Mapping[str, object]
    parameters: tuple[Parameter, ...]
    gravity: np.ndarray  # (3,) m/s^2
    accuracy: float
    effects: tuple[tuple[str, Values], ...] = ()

    @property
    def n_tendon(self) -> int:
        return int(self.structure["tendons"])  # type: ignore[call-overload]

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        """What a built robot may differ in from its description."""
        return tuple(p for p in self.parameters if p.std is not None)

    def build(self, values: Values | None = None) -> Body:
        """The MuJoCo body at the given parameter values, nominal where none is given. Raises TwinError for a bad name."""
        family = importlib.import_module(f"twin.robots.{self.family}")
        return family.build(self.structure, overrides(self.parameters, values or {}))

    def springs(self, n: int, values: Values | None = None) -> Spring:
        """The SMA springs of n tendons at the given parameter values. Raises DataError where the robot describes none."""
        return springs_of(overrides(self.parameters, values or {}), n)


def models_folder() -> Path:
    """Where the robots lie: inside the wheel, or beside the package in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def available() -> list[str]:
    """Names of the robots that ship with the twin."""
    return sorted(p.parent.name for p in models_folder().glob("*/robot.toml"))


def load(name: str, relative_to: Path | None = None) -> Robot:
    """The robot called `name`: a folder under `models/`, or a path to a folder, relative to `relative_to`.

    Raises UnknownNameError where there is no such robot, DataError where its `robot.toml` is broken.
    """
    folder = models_folder() / name
    if name not in available():
        folder = (relative_to or Path.cwd()) / name
        if not (folder / "robot.toml").is_file():
            raise UnknownNameError("robot", name, available())
    return _read(folder.resolve())


@lru_cache(maxsize=16)
def _read(folder: Path) -> Robot:
    with opened(folder / "robot.toml", FORMAT) as table:
        try:
            robot = _robot(folder, table)
            _check(robot)
            return robot
        except KeyError as error:
            raise DataError(f"{error.args[0]!r} is missing") from None
        except (TypeError, ValueError, AttributeError) as error:
            raise DataError(f"{error}; compare it with the robots that ship with the twin") from None


def _robot(folder: Path, table: Mapping[str, Any]) -> Robot:
    gravity = np.array(table["gravity"]["value"], float) * si_factor(table["gravity"]["unit"], "gravity")
    gravity.setflags(write=False)
    _check_numbers("accuracy", table["accuracy"])
    return Robot(
        name=folder.name,
        family=table["family"],
        title=table["title"],
        folder=folder,
        structure=table["structure"],
        parameters=tuple(p for name, entry in table["parameters"].items() for p in _parameters(name, entry)),
        gravity=gravity,
        accuracy=float(table["accuracy"]["value"]) * si_factor(table["accuracy"]["unit"], "accuracy"),
        effects=tuple((e["id"], dict(e.get("parameters", {}))) for e in table.get("effect", [])),
    )


def _check(robot: Robot) -> None:
    """What a robot's file must hold beyond its form. Raises TwinError."""
    if robot.gravity.shape != (3,) or not np.isfinite(robot.gravity).all():
        raise DataError(f"gravity is {robot.gravity.tolist()}; three finite numbers are needed")
    if importlib.util.find_spec(f"twin.robots.{robot.family}") is None:
        raise DataError(f"no family named {robot.family!r}; a family is a module of twin.robots, as 'continuum'")
    family = importlib.import_module(f"twin.robots.{robot.family}")
    units = family.UNITS | PARAMETERS
    for p in robot.parameters:
        needed = units.get(p.name, units.get(p.name.rpartition("_")[0]))
        if needed is not None and p.unit != needed:
            raise DataError(f"parameter {p.name!r} is in {p.unit}; a unit like {needed!r} is needed")
    for name in family.COUNTS:
        if not isinstance(robot.structure.get(name), int):
            raise DataError(f"structure: {name} is {robot.structure.get(name)!r}; a whole number is needed")
    for identifier, values in robot.effects:
        named(identifier)(values, robot.n_tendon)
    robot.build()


def _check_numbers(name: str, entry: Mapping[str, object]) -> None:
    for key in {"value", "std", "low", "high"} & set(entry):
        numbers = entry[key] if isinstance(entry[key], list) else [entry[key]]
        if not all(isinstance(n, int | float) and np.isfinite(n) for n in numbers):  # type: ignore[union-attr]
            raise DataError(f"parameter {name!r}: {key} is {entry[key]!r}; finite numbers are needed")


def _parameters(name: str, entry: Mapping[str, object]) -> list[Parameter]:
    if not isinstance(entry, Mapping):
        raise DataError(f"parameter {name!r} is {entry!r}; write {{ value = ..., unit = ..., source = ... }}")
    missing = {"value", "unit", "source"} - set(entry)
    if missing:
        raise DataError(f"parameter {name!r} lacks {', '.join(sorted(missing))}; every number has a unit and a source")
    factor = si_factor(str(entry["unit"]), f"parameter {name!r}")
    unit = si_unit(str(entry["unit"]), f"parameter {name!r}")
    _check_numbers(name, entry)
    value = entry["value"]
    many = isinstance(value, list)
    numbers: list[float] = [float(v) for v in value] if isinstance(value, list) else [float(value)]  # type: ignore[arg-type]
    std = float(entry["std"]) * factor if "std" in entry else None  # type: ignore[arg-type]
    return [
        Parameter(
            name=f"{name}_{k}" if many else name,
            value=v * factor,
            unit=unit,
            low=float(entry["low"]) * factor if "low" in entry else -np.inf,  # type: ignore[arg-type]
            high=float(entry["high"]) * factor if "high" in entry else np.inf,  # type: ignore[arg-type]
            source=str(entry["source"]),
            std=std,
        )
        for k, v in enumerate(numbers, 1)
    ]
