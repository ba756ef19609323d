"""A robot's shapes as arrays: what is drawn of a body, and what its colours mean. A family of bodies names its own figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from twin.body import Path
from twin.effects import Loads, Route


class Range(NamedTuple):
    """What the ends of a colour bar are, in the unit that is shown, and one SI unit in it."""

    name: str
    unit: str
    factor: float
    low: float
    high: float


@dataclass(frozen=True)
class Frames:
    """n instants of a robot. Links: places (n, g, 3) m and turns (n, g, 4) as w, x, y, z; tendon pieces (n, s, 2, 3) m and their
    tensions (n, s) N; skin (n, v, 3) m and its strain along the body (n, v); markers (n, m, 3) m."""

    place: np.ndarray
    turn: np.ndarray
    piece: np.ndarray
    tension: np.ndarray
    skin: np.ndarray
    strain: np.ndarray
    markers: np.ndarray

    def at(self, i: int, share: float = 0.0) -> Frames:
        """Instant i (from the end, where negative) as frames of one; `share` of the way to the next, straight."""
        i %= len(self.markers)
        j = min(i + 1, len(self.markers) - 1)
        return Frames(*((1.0 - share) * getattr(self, n)[i : i + 1] + share * getattr(self, n)[j : j + 1] for n in FIELDS))


FIELDS = ("place", "turn", "piece", "tension", "skin", "strain", "markers")


class Figure(Protocol):
    """What is drawn of a body. `cylinders` (g, 2) m are radius and half length of its links, `colour` (g, 3) bytes; `faces` (f, 3)
    of its skin; its `height` m; `coloured` says what its colours mean, `most` N being the largest tension."""

    cylinders: np.ndarray
    colour: np.ndarray
    faces: np.ndarray
    height: float

    def frames(self, path: Path, loads: Loads, route: Route) -> Frames:
        """Of a path that began slack under `loads`; friction's share of the tension is followed from there."""
        ...

    def coloured(self, most: float) -> Range: ...


def stacked(drawn: list[tuple[np.ndarray, ...]], markers: np.ndarray) -> Frames:
    """Instants, each place, turn, piece, tension, skin and strain, as frames."""
    place, turn, piece, tension, skin, strain = (np.stack(column) for column in zip(*drawn, strict=True))
    return Frames(place, turn, piece, tension, skin, strain, markers)
