"""What a continuum robot's body is made of: where its joints are, their stiffness, their mass, and where its tendons run.

`Wire`: a slender rod through disks. It does not stretch, and tendons run straight from disk to disk. `Cast`: an elastomer cast
around its tendons' channels, tapered, that stretches and can be pressed together; its "disks" are the places where the channels
are followed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from twin.quantities import each


@dataclass(frozen=True)
class Piece:
    """A joint set at `place`, which bends for the backbone from `start` to `end` and moves the mass from `tail` to `head` (all m
    from the base), and the `disk` on the link beyond it, if there is one before the next set."""

    place: float
    start: float
    end: float
    tail: float
    head: float
    disk: int | None


@dataclass(frozen=True)
class Stiffness:
    """Of a joint set: bending about x and y and twist (N m/rad), stretch (N/m)."""

    bend_x: float
    bend_y: float
    twist: float
    stretch: float


class Backbone(Protocol):
    in_channels: ClassVar[bool]

    def __init__(self, values: Mapping[str, float], disk_z: np.ndarray, divided: Sequence[int]) -> None: ...
    def pieces(self) -> list[Piece]: ...
    def stiffness(self, piece: Piece) -> Stiffness: ...
    def mass(self, start: float, end: float) -> float: ...
    def radius(self, s: float) -> float: ...


class Wire:
    """A rod that bends between its disks: round, of radius r (1 + taper (1/2 - s/L)) and modulus E, or of given stiffnesses. Its
    mass is spread evenly."""

    in_channels: ClassVar[bool] = False

    def __init__(self, values: Mapping[str, float], disk_z: np.ndarray, divided: Sequence[int]) -> None:
        self._values, self._length, self._divided = values, float(disk_z[-1]), divided
        half = 0.5 * np.concatenate([[0.0], each(values, "disks.thickness", len(divided))])
        self._free = disk_z[:-1] + half[:-1], disk_z[1:] - half[1:]  # (n_disk,) m, start and end of what bends

    def pieces(self) -> list[Piece]:
        """Two sets a piece of a disk interval's free length, at 1/6 and 5/6, so that the mean height of the polyline over the chord
        equals the arc's (the tendon's moment arm is then right to second order)."""
        place, ends, disk = [], [], []
        for k, (start, end, n) in enumerate(zip(*self._free, self._divided, strict=True), 1):
            h = (end - start) / n
            for i, f in itertools.product(range(n), (0, 1)):
                a = start + i * h
                place.append(float(a + (1.0 / 6.0 if f == 0 else 5.0 / 6.0) * h))
                ends.append((float(a + 0.5 * f * h), float(a + 0.5 * (f + 1) * h)))
                disk.append(k if i == n - 1 and f == 1 else None)
        heads = [*place[1:], self._length]
        return [Piece(at, a, b, at, head, k) for at, (a, b), head, k in zip(place, ends, heads, disk, strict=True)]

    def stiffness(self, piece: Piece) -> Stiffness:
        """EI/h, GJ/h; of a round one with the radius at the set."""
        values, h = self._values, piece.end - piece.start
        if "backbone.twisting" in values:
            about_x, about_y, twisting = (values[f"backbone.{key}"] for key in ("bending_x", "bending_y", "twisting"))
            return Stiffness(about_x / h, about_y / h, twisting / h, math.inf)
        taper = 1.0 + values["backbone.radius_taper"] * (0.5 - piece.place / self._length)
        radius = values["backbone.radius"] * taper
        bending = values["backbone.youngs_modulus"] * math.pi * radius**4 / 4.0  # EI, N m^2
        twisting = bending / (1.0 + values["backbone.poisson_ratio"])  # GJ, N m^2
        return Stiffness(bending / h, bending / h, twisting / h, math.inf)

    def mass(self, start: float, end: float) -> float:
        return self._values["backbone.mass"] * (end - start) / self._length

    def radius(self, s: float) -> float:
        """For pictures and rotary inertia."""
        return self._values["backbone.radius"]


class Cast:
    """A solid of revolution whose radius is linear between stations, of modulus E and density rho, incompressible."""

    in_channels: ClassVar[bool] = True

    def __init__(self, values: Mapping[str, float], disk_z: np.ndarray, divided: Sequence[int]) -> None:
        self._values, self._disk_z = values, disk_z
        count = sum(name.startswith("backbone.station_") for name in values)
        self._at = np.array([values[f"backbone.station_{k}"] for k in range(1, count + 1)])
        self._radii = [values[f"backbone.radius_{k}"] for k in range(1, count + 1)]

    def pieces(self) -> list[Piece]:
        """Sets at both ends of each interval: the tendon's chord then stays at its channel's distance from the hinges. The middle
        half of an interval's mass goes with the link between them, the rest with the hole beyond."""
        z = self._disk_z
        quarters = [float(a + f * (b - a)) for a, b in itertools.pairwise(z) for f in (0.25, 0.75)]
        heads = [*quarters[1:], float(z[-1])]
        halves = [(float(a), float(b), f) for a, b in itertools.pairwise(z) for f in (0, 1)]
        return [
            Piece(b if f else a, 0.5 * (a + b) if f else a, b if f else 0.5 * (a + b), tail, head, j // 2 + 1 if f else None)
            for j, ((a, b, f), tail, head) in enumerate(zip(halves, quarters, heads, strict=True))
        ]

    def stiffness(self, piece: Piece) -> Stiffness:
        """A frustum's, from radius a to b: its compliance is the mean of 1/r^4, (a^2 + a b + b^2) / (3 a^3 b^3), or 1/r^2, 1/(a
        b)."""
        a, b, h = self.radius(piece.start), self.radius(piece.end), piece.end - piece.start
        modulus = self._values["backbone.youngs_modulus"]
        bending = modulus * math.pi / 4.0 * 3.0 * (a * b) ** 3 / (a * a + a * b + b * b)
        return Stiffness(bending / h, bending / h, bending / 1.5 / h, modulus * math.pi * a * b / h)

    def mass(self, start: float, end: float) -> float:
        at = np.unique([start, end, *self._at[(self._at > start) & (self._at < end)]])
        r = np.interp(at, self._at, self._radii)
        volume = math.pi / 3.0 * (np.diff(at) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2)).sum()
        return self._values["backbone.density"] * float(volume)

    def radius(self, s: float) -> float:
        return float(np.interp(s, self._at, self._radii))


BODIES: Mapping[str, type[Backbone]] = {"wire": Wire, "cast": Cast}
