"""A robot's shapes as arrays: what is drawn of a body, and what its colours mean. A family of bodies names its own figure."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol

import numpy as np

from twin.body import Heating, Path
from twin.effects import Loads, Route

POINTS, TURNS, LINES, VALUES = (np.zeros(shape) for shape in ((0, 3), (0, 4), (0, 2, 3), 0))


class Range(NamedTuple):
    """What the ends of a colour bar are, in the unit that is shown; one SI unit in it, and the SI value of its zero."""

    name: str
    unit: str
    factor: float
    low: float
    high: float
    zero: float = 0.0


class Instant(NamedTuple):
    """Of `Frames` one instant, without its markers."""

    place: np.ndarray = POINTS
    turn: np.ndarray = TURNS
    piece: np.ndarray = LINES
    tension: np.ndarray = VALUES
    skin: np.ndarray = POINTS
    strain: np.ndarray = VALUES
    cord: np.ndarray = LINES
    resistance: np.ndarray = VALUES
    coil: np.ndarray = LINES
    temperature: np.ndarray = VALUES


@dataclass(frozen=True)
class Frames:
    """n instants of a robot. Links: places (n, g, 3) m and turns (n, g, 4) as w, x, y, z; tendon pieces (n, s, 2, 3) m and their
    tensions (n, s) N; skin (n, v, 3) m and its strain along the body (n, v); pieces of sensor cords (n, c, 2, 3) m and the relative
    change of their resistance R/R0 - 1 (n, c); pieces of the SMA springs (n, w, 2, 3) m and their temperature (n, w) K; markers
    (n, m, 3) m."""

    place: np.ndarray
    turn: np.ndarray
    piece: np.ndarray
    tension: np.ndarray
    skin: np.ndarray
    strain: np.ndarray
    cord: np.ndarray
    resistance: np.ndarray
    coil: np.ndarray
    temperature: np.ndarray
    markers: np.ndarray

    def at(self, i: int, share: float = 0.0) -> Frames:
        """Instant i (from the end, where negative) as frames of one; `share` of the way to the next, straight."""
        i %= len(self.markers)
        j = min(i + 1, len(self.markers) - 1)
        both = ((getattr(self, f.name)[i : i + 1], getattr(self, f.name)[j : j + 1]) for f in fields(self))
        return Frames(*((1.0 - share) * a + share * b for a, b in both))


class Figure(Protocol):
    """What is drawn of a body. `cylinders` (g, 2) m are radius and half length of its links, `colour` (g, 3) bytes; `faces` (f, 3)
    of its skin; its `height` m. `shades` are the fields of `Frames` that it may be coloured by. `holds` (p, 3): where it may be
    pushed, as `Push` has it: height, azimuth, finger."""

    cylinders: np.ndarray
    colour: np.ndarray
    faces: np.ndarray
    height: float
    shades: tuple[str, ...]
    holds: np.ndarray

    def frames(self, path: Path, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Of a path that began slack, or with cold springs, under `loads`; friction's share of the tension is followed from there.
        `heating` where springs pull."""
        ...

    def grips(self, shown: Frames) -> np.ndarray:
        """(p, 3) m: where `holds` are at the first instant."""
        ...

    def coloured(self, shade: str, most: float) -> Range:
        """What the colours of a field mean, `most` (SI) being the largest value of it."""
        ...


def stacked(drawn: list[Instant], markers: np.ndarray) -> Frames:
    columns = zip(Instant._fields, zip(*drawn, strict=True), strict=True)
    return Frames(markers=markers, **{name: np.stack(column) for name, column in columns})
