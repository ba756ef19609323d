"""What else differs from one finger of an order to the next: numbers of a robot that its description takes for exact, such as where
its tendons run, with a spread that who orders gives.

    "tendons.azimuth = 2 deg"     every tendon by a normal draw of its own
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from twin.errors import DataError, did_you_mean, shown
from twin.quantities import Parameter
from twin.robots import Robot
from twin.units import difference_scale

MOST = 0.2  # of a number: a wider spread makes other robots, and some that cannot be built


def varied(robot: Robot, spreads: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the robot with these spreads as `std`; a name without its index stands for all of a row.

    Raises DataError for a text that is no "NAME = STD UNIT", a name the robot has not, a unit of another dimension, or a std that
    is not above zero or above `MOST` of a length (0.2 rad of an angle).
    """
    return tuple(p for text in spreads for p in _of(robot, text))


def _of(robot: Robot, text: str) -> list[Parameter]:
    name, _, spread = (part.strip() for part in text.partition("="))
    number, _, unit = spread.partition(" ")
    try:
        std = float(number)
    except ValueError:
        raise DataError(f"{shown(text)} says no spread; write it as 'tendons.azimuth = 2 deg'") from None
    rows = [p for p in robot.parameters if name in (p.name, _row(p.name))]
    if not rows:
        known = list(dict.fromkeys(_row(p.name) for p in robot.parameters))
        raise DataError(
            f"robot {robot.name!r} has no parameter {shown(name)}{did_you_mean(name, known)}; it has {', '.join(known)}"
        )
    si = difference_scale(unit.strip() or "1", rows[0].unit).to_si(std)
    for p in rows:
        most = MOST * (1.0 if p.unit == "rad" else abs(p.value))
        if not (math.isfinite(si) and 0.0 < si <= most):
            raise DataError(f"{shown(text)}: a spread of {p.name} must be above zero and at most {most:.3g} {p.unit}; got {si:.3g}")
    return [replace(p, std=si) for p in rows]


def _row(name: str) -> str:
    head, _, last = name.rpartition("_")
    return head if last.isdigit() else name
