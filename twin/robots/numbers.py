"""A robot's numbers as in its file: in the file's units, with lists together."""

from dataclasses import dataclass

import numpy as np

from twin.foundation.parameters import Parameter
from twin.foundation.units import unit_scale
from twin.robots.family import load_family
from twin.robots.robot import Robot
from twin.robots.schema import Row


def in_file_unit(parameter: Parameter, si: float) -> float:
    """Convert an SI value of `parameter` to the unit of its robot's file, or keep SI if it has none."""
    return float(unit_scale(parameter.file_unit or parameter.unit, parameter.unit).from_si(np.array([si]))[0])


def std_in_file_unit(parameter: Parameter, si: float) -> float:
    """Convert an SI difference, such as a standard error, to the unit of the robot's file."""
    return float(unit_scale(parameter.file_unit or parameter.unit, parameter.unit).without_offset().from_si(np.array([si]))[0])


@dataclass(frozen=True)
class FileEntry:
    """One entry of a `robot.toml`: its row, its parameters, and its numbers in the file's unit."""

    row: Row
    parameters: tuple[Parameter, ...]

    @property
    def unit(self) -> str:
        """The file's unit."""
        return self.parameters[0].file_unit

    @property
    def values(self) -> list[float]:
        """The values in the file's unit."""
        return [in_file_unit(p, p.value) for p in self.parameters]

    @property
    def std(self) -> float | None:
        """The prior standard deviation; None for an exact number."""
        p = self.parameters[0]
        return None if p.std is None else std_in_file_unit(p, p.std)

    def numbers_text(self) -> str:
        """Return the numbers in one line; equal ones once."""
        texts = [f"{v:.6g}" for v in self.values]
        if len(texts) > 1 and len(set(texts)) == 1:
            return f"{texts[0]} ({len(texts)} times)"
        return ", ".join(texts)


def file_entries(robot: Robot) -> list[FileEntry]:
    """Return all entries of a robot's file, in the schema's order."""
    schema = load_family(robot.family).SCHEMA
    if schema.model_file is not None:
        return [FileEntry(Row(p.name, p.unit, p.file_unit, "a number of the model", p.low, p.high), (p,)) for p in robot.parameters]
    rows = schema.applicable_rows(schema.structure.model_validate(dict(robot.structure)))
    parameters = {p.name: p for p in robot.parameters}
    entries = []
    for name, row in rows.items():
        single = (parameters[name],) if name in parameters else ()
        several = tuple(p for n, p in parameters.items() if row.shape and n.startswith(f"{name}_") and n not in rows)
        if single or several:
            entries.append(FileEntry(row, single or several))
    return entries
