"""A robot's numbers as its file has them: in the units written there, lists together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.quantities import Parameter
from twin.robots.family import family
from twin.robots.robot import Robot
from twin.robots.schema import Row
from twin.units import unit_scale


def as_written(parameter: Parameter, si: float) -> float:
    """An SI value of `parameter` in the unit its robot's file gives it in; SI where none does."""
    return float(unit_scale(parameter.written or parameter.unit, parameter.unit).from_si(np.array([si]))[0])


def spread_as_written(parameter: Parameter, si: float) -> float:
    """An SI difference, such as a standard error, in that unit."""
    return float(unit_scale(parameter.written or parameter.unit, parameter.unit).difference().from_si(np.array([si]))[0])


@dataclass(frozen=True)
class Line:
    """One entry of a `robot.toml`: its row, the parameters it became, and its numbers in the unit written there."""

    row: Row
    parameters: tuple[Parameter, ...]

    @property
    def unit(self) -> str:
        return self.parameters[0].written

    @property
    def values(self) -> list[float]:
        return [as_written(p, p.value) for p in self.parameters]

    @property
    def spread(self) -> float | None:
        """One standard deviation of what is believed; None for a number taken as exact."""
        p = self.parameters[0]
        return None if p.std is None else spread_as_written(p, p.std)

    def words(self) -> str:
        """Its numbers in one line; equal ones once."""
        shown = [f"{v:.6g}" for v in self.values]
        if len(shown) > 1 and len(set(shown)) == 1:
            return f"{shown[0]} ({len(shown)} times)"
        return ", ".join(shown)


def lines(robot: Robot) -> list[Line]:
    """All entries of a robot's file, in the schema's order."""
    schema = family(robot.family).SCHEMA
    taken = schema.taken(schema.structure.model_validate(dict(robot.structure)))
    found = {p.name: p for p in robot.parameters}
    out = []
    for name, row in taken.items():
        alone = (found[name],) if name in found else ()
        many = tuple(p for n, p in found.items() if row.shape and n.startswith(f"{name}_") and n not in taken)
        if alone or many:
            out.append(Line(row, alone or many))
    return out
