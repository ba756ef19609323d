"""`Robot` is data: the numbers of a `robot.toml`, each with unit and source, and the name of the family that builds it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from twin.body import Body, Solver
from twin.errors import DataError, TwinError, UnknownNameError, listed, shown
from twin.forms import Form, Line, fill
from twin.hinges import HingeChain
from twin.measurements.files import is_file, read_text
from twin.quantities import Parameter, Size, Values, overrides
from twin.robots.effect_tables import read_effects, read_uncertain
from twin.robots.family import family
from twin.robots.schema import GRAVITY, Fact, Quantity, Row, Schema, Structure, absent, parameters, unknown
from twin.robots.toml_file import LARGEST, checked
from twin.soft import HandBody, SoftBody
from twin.springs import Spring, springs_of

FORMAT = "twin-robot/1"
FILE = "robot.toml"
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Robot:
    """A described robot; nothing in it is hidden in code. One read anew is another one.

    `parameters` hold SI values; those with a `std` are uncertain in a built robot (the nuisance parameters). `effects` are
    the laws the robot is known to have: (identifier, parameter values); `uncertain` those of their parameters that have a `std`,
    which are fitted with the robot's own. `accuracy` is the description's own error,
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
    uncertain: tuple[tuple[str, Parameter], ...] = ()

    @property
    def n_tendon(self) -> int:
        return int(self.structure["tendons"])  # type: ignore[call-overload]

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        """What a built robot may differ in from its description."""
        return tuple(p for p in self.parameters if p.std is not None)

    @cached_property
    def size(self) -> Size:
        """How large it is, as described, beside the robots for which effects' numbers are written."""
        return self.build().size

    def build(self, values: Values | None = None) -> Body:
        """The MuJoCo body at the given parameter values, nominal where none is given. Raises TwinError for a bad name."""
        return family(self.family).build(self.structure, overrides(self.parameters, values or {}))

    def solver(self, body: Body, *, dynamic: bool = False) -> Solver:
        """What solves a body of this robot's family, by statics or by MuJoCo steps. Raises DataError where it has no dynamics."""
        made_by = family(self.family)
        if not dynamic:
            return made_by.statics(body)
        if made_by.dynamics is None:
            raise DataError(f"robot {self.name!r} is predicted by statics only: a {self.family} has no dynamics here")
        return made_by.dynamics(body)

    def chain(self, body: Body) -> HingeChain:
        """A body of this robot's family as the chain of hinges that it is. Raises DataError where it is none."""
        return self._able(family(self.family).chain, "has no backbone: give a twin of one pulled by tendons")(body)

    def silicone(self, body: Body) -> SoftBody:
        """A body of this robot's family as the one piece of silicone that it is. Raises DataError where it is none."""
        return self._able(family(self.family).silicone, "is no soft body: give a twin of a single silicone finger")(body)

    def hand(self, body: Body) -> HandBody:
        """A body of this robot's family as the fingers on a palm that it is. Raises DataError where it is none."""
        return self._able(family(self.family).hand, "is no hand: give a twin of silicone fingers on a palm")(body)

    def _able(self, view: Callable[[Any], T] | None, lacking: str) -> Callable[[Any], T]:
        if view is None:
            raise DataError(f"robot {self.name!r} {lacking}")
        return view

    def objections(self, values: Values) -> list[str]:
        """What is wrong between this robot's numbers, at the given values, that are each in order."""
        schema = family(self.family).SCHEMA
        return schema.objections(schema.structure.model_validate(dict(self.structure)), overrides(self.parameters, values))

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
        if not is_file(folder / FILE):
            besides = (
                f", or a path from {shown(str(relative_to or Path.cwd()), 300)} to a folder with a {FILE} (`twin new` makes one)"
            )
            raise UnknownNameError("robot", name, available(), besides)
    return _read(folder.resolve(), read_text(folder / FILE, LARGEST))


@lru_cache(maxsize=16)
def _read(folder: Path, data: bytes) -> Robot:
    try:
        return _robot(folder, checked(data, FORMAT))
    except TwinError as error:
        raise DataError(f"{folder / FILE}: {error}") from None


class RobotFile(Form):
    """The top of a `robot.toml`."""

    format: str = Field(description=f'"{FORMAT}"')
    family: Line = Field(description="what kind of body it is")
    title: Line = Field(description="one line for people")
    structure: dict[str, Any] = Field(description="whole numbers and choices")
    parameters: dict[str, Any] = Field(description="every number with unit and source")
    gravity: dict[str, Any] = Field(
        description="value = [x, y, z] in the base frame, unit, source; a measurement set may say otherwise"
    )
    accuracy: dict[str, Any] = Field(description="value, unit, source: the description's own error; no smaller effect is claimed")
    effect: list[Any] = Field([], description="laws the robot is known to have, as in twin.toml; a std makes a parameter uncertain")


def _robot(folder: Path, table: Mapping[str, Any]) -> Robot:
    """The robot of a file's content. Raises DataError with all that is wrong with it."""
    problems: list[str] = []
    file = fill(RobotFile, table, "", problems)
    if file is None:
        raise DataError(listed(problems))
    schema = family(file.family).SCHEMA
    structure = fill(schema.structure, file.structure, "structure", problems)
    problems += structure.objections() if structure else []
    if structure is None or problems:
        raise DataError(listed(problems))
    found = _parameters(schema, structure, file.parameters, problems)
    gravity = _read_fact(GRAVITY, file.gravity, {"axis": 3}, problems)
    accuracy = _read_fact(schema.accuracy, file.accuracy, {}, problems)
    nominal = {p.name: p.value for p in found}
    if not problems:
        problems += schema.objections(structure, nominal)
    counts = structure.model_dump(exclude_none=True)
    size = family(file.family).build(counts, nominal).size if file.effect and not problems else Size()
    effects = read_effects(file.effect, structure.counts()["tendon"], size, problems)
    if problems:
        raise DataError(listed(problems))
    pull = np.array([p.value for p in gravity])
    pull.setflags(write=False)
    return Robot(
        name=folder.name,
        family=file.family,
        title=file.title,
        folder=folder,
        structure=counts,
        parameters=tuple(p for p in found if p.name not in {row.name for row in schema.rows if row.stated}),
        gravity=pull,
        accuracy=accuracy[0].value,
        effects=tuple((e.id, e.values) for e in effects),
        uncertain=read_uncertain(file.effect, effects, size),
    )


def _parameters(schema: Schema, structure: Structure, table: Mapping[str, Any], problems: list[str]) -> list[Parameter]:
    """All parameters of a robot, those its file leaves out at their defaults; all that is wrong is added to `problems`."""
    taken = schema.taken(structure)
    problems += [f"parameters: {unknown(name, schema, taken)}" for name in table if name not in taken]
    written = {taken[name].group for name in table if name in taken}
    found: list[Parameter] = []
    missing = []
    for name, row in taken.items():
        if name in table:
            entry = fill(Quantity, table[name], f"parameter {name!r}", problems)
            found += _read_row(row, entry, structure.counts(), problems) if entry else []
        elif row.default is not None:
            found.append(absent(row))
        elif not row.stated and (not row.group or row.group in written):
            missing.append(name)
    if missing:
        problems.append(f"parameters that are missing: {', '.join(missing)}")
    return found


def _read_fact(row: Row, table: object, counts: Mapping[str, int], problems: list[str]) -> list[Parameter]:
    fact = fill(Fact, table, row.name, problems)
    return _read_row(row, Quantity(**dict(fact)), counts, problems) if fact else []


def _read_row(row: Row, entry: Quantity, counts: Mapping[str, int], problems: list[str]) -> list[Parameter]:
    try:
        return parameters(row, entry, counts)
    except DataError as error:
        problems.append(f"parameter {row.name!r}: {error}")
        return []
