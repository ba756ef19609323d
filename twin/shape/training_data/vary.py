"""Parse spreads of numbers that a robot's description takes as exact, such as where its tendons run.

"tendons.azimuth = 2 deg"     every tendon by a normal draw of its own
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from twin.foundation.errors import DataError, did_you_mean, short_repr
from twin.foundation.parameters import Parameter
from twin.foundation.units import difference_scale
from twin.robots import Robot

LARGEST_RELATIVE_SPREAD = 0.2  # of a number: a wider spread makes other robots, and some that cannot be built


def parse_spreads(robot: Robot, spreads: Sequence[str]) -> tuple[Parameter, ...]:
    """Return parameters of the robot with these spreads as `std`; a name without its index stands for all of a row.

    Raises DataError for a text that is no "NAME = STD UNIT", an unknown name, a unit of another dimension, or a std that is not
    above zero or above `LARGEST_RELATIVE_SPREAD` of a length (0.2 rad of an angle).
    """
    return tuple(p for text in spreads for p in _parse_spread(robot, text))


def _parse_spread(robot: Robot, text: str) -> list[Parameter]:
    """Parse one spread, which may stand for several parameters."""
    name, _, spread = (part.strip() for part in text.partition("="))
    number, _, unit = spread.partition(" ")
    try:
        std = float(number)
    except ValueError:
        raise DataError(f"{short_repr(text)} says no spread; write it as 'tendons.azimuth = 2 deg'") from None
    rows = [p for p in robot.parameters if name in (p.name, _row_name(p.name))]
    if not rows:
        known = list(dict.fromkeys(_row_name(p.name) for p in robot.parameters))
        raise DataError(
            f"robot {robot.name!r} has no parameter {short_repr(name)}{did_you_mean(name, known)}; it has {', '.join(known)}"
        )
    si = difference_scale(unit.strip() or "1", rows[0].unit).to_si(std)
    for p in rows:
        most = LARGEST_RELATIVE_SPREAD * (1.0 if p.unit == "rad" else abs(p.value))
        if not (math.isfinite(si) and 0.0 < si <= most):
            raise DataError(
                f"{short_repr(text)}: a spread of {p.name} must be above zero and at most {most:.3g} {p.unit}; got {si:.3g}"
            )
    return [replace(p, std=si) for p in rows]


def _row_name(name: str) -> str:
    """Return the name without its index."""
    head, _, last = name.rpartition("_")
    return head if last.isdigit() else name
