"""Robots as data: the numbers of a `robot.toml`, each with unit and source, and the name of the family that builds it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import Field

from twin.body import Body, Counts, Solver
from twin.body.drives.drive_train import DriveTrain
from twin.body.drives.spring import Spring, build_springs
from twin.body.hinge_chain import HingeChain
from twin.foundation.errors import DataError, TwinError, UnknownNameError, join_problems, short_repr
from twin.foundation.file_schema import TableSchema, TextLine, validate_table
from twin.foundation.files import is_file, read_utf8
from twin.foundation.parameters import Parameter, Size, Values, fill_defaults
from twin.foundation.toml_file import MAX_TOML_BYTES, parse_toml_of_format
from twin.mechanics.silicone import HandBody, SoftBody
from twin.robots.effect_tables import read_effects, read_uncertain
from twin.robots.family import load_family
from twin.robots.schema import (
    BOUND_STDS,
    GRAVITY_ROW,
    ExactEntry,
    Row,
    Schema,
    Structure,
    UncertainEntry,
    default_parameter,
    row_parameters,
    why_unknown,
)
from twin.robots.schemas.motor_rows import Motorised, drive_train

ROBOT_FORMAT = "twin-robot/1"
BISECTIONS = 40  # of a bound: to 1e-12 of it
ROBOT_FILE = "robot.toml"
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Robot:
    """A described robot. Two robots are equal only if they are the same object.

    `parameters` are in SI; those with a `std` are uncertain in a built robot (the nuisance parameters). `effects` are the effects
    the robot is known to have, as (identifier, values); `uncertain` are their parameters with a `std`, which are fitted together
    with the robot's own. `accuracy` is the description's own error, in m of its markers or rad of its jaw.
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
    notices: tuple[str, ...] = ()  # what was assumed of it

    @property
    def n_tendon(self) -> int:
        """The number of tendons, or of actuators of an MJCF (`twin.body.Counts`)."""
        n = self.structure["tendons"]
        return n if isinstance(n, int) else int(str(n))

    @property
    def nuisance(self) -> tuple[Parameter, ...]:
        """The parameters in which a built robot may differ from its description."""
        return tuple(p for p in self.parameters if p.std is not None)

    def value(self, name: str) -> float:
        """Return a parameter's nominal value, SI. Raises UnknownNameError, listing those that exist."""
        values = {p.name: p.value for p in self.parameters}
        if name not in values:
            raise UnknownNameError("parameter", name, list(values))
        return values[name]

    @cached_property
    def size(self) -> Size:
        """Its size, as described, relative to the reference robot, for which effects' numbers are written."""
        return self.build().size

    def build(self, values: Values | None = None) -> Body:
        """Build the MuJoCo body at these parameter values, others nominal. Raises TwinError for an unknown name."""
        return load_family(self.family).build(self.structure, fill_defaults(self.parameters, values or {}))

    def solver(self, body: Body, *, dynamic: bool = False) -> Solver:
        """Return the solver of a body of this robot: statics, or MuJoCo steps. Raises DataError if it has no dynamics."""
        family = load_family(self.family)
        if not dynamic:
            return family.statics(body)
        if family.dynamics is None:
            raise DataError(f"robot {self.name!r} is predicted by statics only: a {self.family} has no dynamics here")
        return family.dynamics(body)

    def chain(self, body: Body) -> HingeChain:
        """Return a body of this robot as a chain of hinges. Raises DataError if it is none."""
        return self._view(load_family(self.family).chain, "has no backbone: give a twin of one pulled by tendons")(body)

    def silicone(self, body: Body) -> SoftBody:
        """Return a body of this robot as one piece of silicone. Raises DataError if it is none."""
        return self._view(load_family(self.family).silicone, "is no soft body: give a twin of a single silicone finger")(body)

    def hand(self, body: Body) -> HandBody:
        """Return a body of this robot as fingers on a palm. Raises DataError if it is none."""
        return self._view(load_family(self.family).hand, "is no hand: give a twin of silicone fingers on a palm")(body)

    def _view(self, view: Callable[[Any], T] | None, reason: str) -> Callable[[Any], T]:
        if view is None:
            raise DataError(f"robot {self.name!r} {reason}")
        return view

    def find_conflicts(self, values: Values) -> list[str]:
        """Return the contradictions between this robot's numbers at these values, each valid on its own."""
        schema = load_family(self.family).SCHEMA
        if schema.model_file is not None:
            return []
        return schema.find_conflicts(schema.structure.model_validate(dict(self.structure)), fill_defaults(self.parameters, values))

    def drive_train(self, values: Values | None = None) -> DriveTrain:
        """Return what lies between its motors and its tendons at these parameter values."""
        if not issubclass(load_family(self.family).SCHEMA.structure, Motorised):
            return DriveTrain()
        described = fill_defaults(self.parameters, {})
        built = fill_defaults(self.parameters, values) if values else described
        motors = cast(Sequence[Sequence[int]], self.structure.get("motors") or ())
        return drive_train(motors, self.n_tendon, built, described)

    def springs(self, n: int, values: Values | None = None) -> Spring:
        """Return the SMA springs of n tendons at these parameter values. Raises DataError if the robot describes none."""
        return build_springs(fill_defaults(self.parameters, values or {}), n)


def sample(name: str) -> Path:
    """Return the folder of a measurement set that ships with the program. Raises UnknownNameError, listing those that exist."""
    samples = {path.name: path for path in sorted(models_folder().glob("*/samples/*")) if path.is_dir()}
    if name not in samples:
        raise UnknownNameError("sample", name, list(samples))
    return samples[name]


def models_folder() -> Path:
    """Return the folder of the shipped robots: inside the wheel, or next to the package in a checkout."""
    package = Path(__file__).resolve().parent.parent
    in_wheel = package / "models"
    return in_wheel if in_wheel.is_dir() else package.parent / "models"


def robot_names() -> list[str]:
    """Return the names of the robots that ship with the twin."""
    return sorted(p.parent.name for p in models_folder().glob("*/robot.toml"))


def load(name: str, relative_to: Path | None = None) -> Robot:
    """Load the robot called `name`: a folder under `models/`, or a path to a folder, relative to `relative_to`.

    Raises UnknownNameError if there is no such robot, DataError if its `robot.toml` is broken.
    """
    folder = models_folder() / name
    if name not in robot_names():
        folder = (relative_to or Path.cwd()) / name
        if not is_file(folder / ROBOT_FILE):
            base = short_repr(str(relative_to or Path.cwd()), 300)
            alternative = f", or a path from {base} to a folder with a {ROBOT_FILE} (`twin new` makes one)"
            raise UnknownNameError("robot", name, robot_names(), alternative)
    return _read_cached(folder.resolve(), read_utf8(folder / ROBOT_FILE, MAX_TOML_BYTES))


@lru_cache(maxsize=16)
def _read_cached(folder: Path, data: bytes) -> Robot:
    try:
        return _build_robot(folder, parse_toml_of_format(data, ROBOT_FORMAT))
    except TwinError as error:
        raise DataError(f"{folder / ROBOT_FILE}: {error}") from None


class RobotFile(TableSchema):
    """The top of a `robot.toml`."""

    format: str = Field(description=f'"{ROBOT_FORMAT}"')
    family: TextLine = Field(description="what kind of body it is")
    title: TextLine = Field(description="one line for people")
    structure: dict[str, Any] = Field(description="whole numbers and choices")
    parameters: dict[str, Any] | None = Field(None, description="every number with unit and source")
    gravity: dict[str, Any] | None = Field(
        None,
        description="value = [x, y, z] in the base frame, unit, source; a measurement set may say otherwise; an MJCF has its own",
    )
    accuracy: dict[str, Any] = Field(description="value, unit, source: the description's own error; no smaller effect is claimed")
    effect: list[Any] = Field([], description="laws the robot is known to have, as in twin.toml; a std makes a parameter uncertain")


def _build_robot(folder: Path, table: Mapping[str, Any]) -> Robot:
    """Build the robot from a file's content. Raises DataError with all its problems."""
    problems: list[str] = []
    file = validate_table(RobotFile, table, "", problems)
    if file is None:
        raise DataError(join_problems(problems))
    family = load_family(file.family)
    schema = family.SCHEMA
    structure = validate_table(schema.structure, file.structure, "structure", problems)
    problems += structure.find_conflicts() if structure else []
    problems += _missing(file, schema)
    if structure is None or problems:
        raise DataError(join_problems(problems))
    counts = schema.model_file.located(structure, folder) if schema.model_file else structure.model_dump(exclude_none=True)
    parameters = _read_parameters(schema, structure, counts, file.parameters or {}, problems)
    gravity_vector = _read_gravity(schema, counts, file.gravity, problems)
    accuracy = _read_fact(schema.accuracy, file.accuracy, {}, problems)
    nominal = {p.name: p.value for p in parameters}
    if not problems:
        problems += schema.find_conflicts(structure, nominal)
    size = family.build(counts, nominal).size if file.effect and not problems else Size()
    effects = read_effects(file.effect, _drives(structure, counts), size, problems)
    if problems:
        raise DataError(join_problems(problems))
    checked_only = {row.name for row in schema.rows if row.checked_only}
    kept = [p for p in parameters if p.name not in checked_only]
    narrowed, notices = _narrowed(schema, structure, kept)
    return Robot(
        name=folder.name,
        family=file.family,
        title=file.title,
        folder=folder,
        structure=counts,
        parameters=narrowed,
        gravity=gravity_vector,
        accuracy=accuracy[0].value,
        effects=tuple((e.id, e.values) for e in effects),
        uncertain=read_uncertain(file.effect, effects, size),
        notices=schema.model_file.notices(counts, file.parameters or {}) if schema.model_file else notices,
    )


def _narrowed(
    schema: Schema, structure: Structure, parameters: Sequence[Parameter]
) -> tuple[tuple[Parameter, ...], tuple[str, ...]]:
    """Return the parameters with bounds of fits within which none alone contradicts the others, and what was
    narrowed of what a file says."""
    nominal, out, notices = {p.name: p.value for p in parameters}, list(parameters), []
    if schema.model_file is not None:
        return tuple(out), ()
    for k, p in enumerate(parameters):
        for side, bound in (("low", p.low), ("high", p.high)) if p.std is not None else ():

            def conflicts(x: float, name: str = p.name) -> list[str]:
                return schema.find_conflicts(structure, {**nominal, name: x})

            if not (why := conflicts(bound)):
                continue
            good, bad = p.value, bound
            for _ in range(BISECTIONS):
                middle = 0.5 * (good + bad)
                good, bad = (good, middle) if conflicts(middle) else (middle, bad)
            out[k] = replace(out[k], **{side: good})
            if np.isclose(abs(bound - p.value), BOUND_STDS * (p.std or 0.0)):
                continue  # the default, which nobody wrote
            notices.append(f"{p.name} is fitted as far as {good:.4g} {p.unit}; beyond, {why[0]}")
    return tuple(out), tuple(notices)


def _missing(file: RobotFile, schema: Schema) -> list[str]:
    """Return the tables that a file lacks and that no model beside it has."""
    found = {"parameters": file.parameters, "gravity": file.gravity}
    return [] if schema.model_file else [f"{name} is missing; it is needed" for name, table in found.items() if table is None]


def _drives(structure: Structure, counts: Mapping[str, object]) -> int:
    n = counts.get("tendons")
    return n if isinstance(n, Counts) else structure.counts()["tendon"]


def _read_gravity(schema: Schema, counts: Mapping[str, object], table: object, problems: list[str]) -> np.ndarray:
    """Read gravity (3,) m/s^2: as written, or of the model."""
    if table is None and schema.model_file is not None:
        gravity = schema.model_file.gravity(counts)
    else:
        gravity = np.array([p.value for p in _read_fact(GRAVITY_ROW, table, {"axis": 3}, problems)])
    gravity.setflags(write=False)
    return gravity


def _read_parameters(
    schema: Schema, structure: Structure, counts: Mapping[str, object], table: Mapping[str, Any], problems: list[str]
) -> list[Parameter]:
    """Read a robot's parameters, those not in its file at their defaults; problems are added to `problems`."""
    if schema.model_file is not None:
        return schema.model_file.parameters(counts, table, problems)
    rows = schema.applicable_rows(structure)
    problems += [f"parameters: {why_unknown(name, schema, rows)}" for name in table if name not in rows]
    groups = {rows[name].group for name in table if name in rows}
    parameters: list[Parameter] = []
    missing = []
    for name, row in rows.items():
        if name in table:
            entry = validate_table(UncertainEntry, table[name], f"parameter {name!r}", problems)
            parameters += _read_row(row, entry, structure.counts(), problems) if entry else []
        elif row.default is not None:
            parameters.append(default_parameter(row))
        elif not row.checked_only and (not row.group or row.group in groups):
            missing.append(name)
    if missing:
        problems.append(f"parameters that are missing: {', '.join(missing)}")
    return parameters


def _read_fact(row: Row, table: object, counts: Mapping[str, int], problems: list[str]) -> list[Parameter]:
    fact = validate_table(ExactEntry, table, row.name, problems)
    return _read_row(row, UncertainEntry(**dict(fact)), counts, problems) if fact else []


def _read_row(row: Row, entry: UncertainEntry, counts: Mapping[str, int], problems: list[str]) -> list[Parameter]:
    try:
        return row_parameters(row, entry, counts)
    except DataError as error:
        problems.append(f"parameter {row.name!r}: {error}")
        return []
