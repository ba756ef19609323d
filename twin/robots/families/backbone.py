"""Backbones of continuum robots: the places of their joints, their stiffness and their mass.

`Wire` is a slender rod through disks; it does not stretch, and tendons run straight from disk to disk. `Cast` is an elastomer cast
around its tendons' channels, tapered; it stretches and can be compressed, and its "disks" are points of the channels.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from twin.foundation.parameters import parameter_array


@dataclass(frozen=True)
class Piece:
    """A joint set and its part of the backbone; all places are m from the base."""

    place: float  # of the joint set
    start: float  # of the part whose bending it represents
    end: float
    tail: float  # of the part whose mass it moves
    head: float
    disk: int | None  # on the link beyond it, if there is one before the next set


@dataclass(frozen=True)
class Stiffness:
    """The stiffness of a joint set: bending about x and y and twist (N m/rad), stretch (N/m)."""

    bend_x: float
    bend_y: float
    twist: float
    stretch: float


class Backbone(Protocol):
    """A backbone, from parameters (SI, by name), the disks' places (n_disk + 1,) m and the pieces of each disk interval."""

    in_channels: ClassVar[bool]  # whether tendons run in channels of the body

    def __init__(self, values: Mapping[str, float], disk_z: np.ndarray, divided: Sequence[int]) -> None: ...

    def pieces(self) -> list[Piece]:
        """Return the joint sets, base to tip."""
        ...

    def stiffness(self, piece: Piece) -> Stiffness:
        """Return the stiffness of a joint set."""
        ...

    def mass(self, start: float, end: float) -> float:
        """Return the mass (kg) between two places (m)."""
        ...

    def radius(self, s: float) -> float:
        """Return the outer radius (m) at a place (m)."""
        ...


class Wire:
    """A rod that bends between its disks, of evenly spread mass.

    It is round, of radius r (1 + taper (1/2 - s/L)) and modulus E, or has given stiffnesses.
    """

    in_channels: ClassVar[bool] = False

    def __init__(self, values: Mapping[str, float], disk_z: np.ndarray, divided: Sequence[int]) -> None:
        self._values, self._length, self._divided = values, float(disk_z[-1]), divided
        half = 0.5 * np.concatenate([[0.0], parameter_array(values, "disks.thickness", len(divided))])
        self._free = disk_z[:-1] + half[:-1], disk_z[1:] - half[1:]  # (n_disk,) m, start and end of the free lengths

    def pieces(self) -> list[Piece]:
        """Return two joint sets for each piece of a disk interval's free length, at 1/6 and 5/6.

        The mean height of the polyline over the chord then equals the arc's, so the tendon's moment arm is right to second order.
        """
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
        """Return EI/h and GJ/h; a round rod's with the radius at the set."""
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
        """Return the mass (kg) between two places (m)."""
        return self._values["backbone.mass"] * (end - start) / self._length

    def radius(self, s: float) -> float:
        """Return the radius (m), for drawings and rotary inertia."""
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
        """Return joint sets at both ends of each interval, so that a tendon's chord keeps its channel's distance from the hinges.

        The middle half of an interval's mass belongs to the link between the sets, the rest to the links beyond.
        """
        z = self._disk_z
        quarters = [float(a + f * (b - a)) for a, b in itertools.pairwise(z) for f in (0.25, 0.75)]
        heads = [*quarters[1:], float(z[-1])]
        halves = [(float(a), float(b), f) for a, b in itertools.pairwise(z) for f in (0, 1)]
        return [
            Piece(b if f else a, 0.5 * (a + b) if f else a, b if f else 0.5 * (a + b), tail, head, j // 2 + 1 if f else None)
            for j, ((a, b, f), tail, head) in enumerate(zip(halves, quarters, heads, strict=True))
        ]

    def stiffness(self, piece: Piece) -> Stiffness:
        """Return the stiffness of a frustum from radius a to b.

        Its compliance has the mean of 1/r^4, (a^2 + a b + b^2) / (3 a^3 b^3), in bending, and of 1/r^2, 1/(a b), in stretch.
        """
        a, b, h = self.radius(piece.start), self.radius(piece.end), piece.end - piece.start
        modulus = self._values["backbone.youngs_modulus"]
        bending = modulus * math.pi / 4.0 * 3.0 * (a * b) ** 3 / (a * a + a * b + b * b)
        return Stiffness(bending / h, bending / h, bending / 1.5 / h, modulus * math.pi * a * b / h)

    def mass(self, start: float, end: float) -> float:
        """Return the mass (kg) between two places (m)."""
        at = np.unique([start, end, *self._at[(self._at > start) & (self._at < end)]])
        r = np.interp(at, self._at, self._radii)
        volume = math.pi / 3.0 * (np.diff(at) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2)).sum()
        return self._values["backbone.density"] * float(volume)

    def radius(self, s: float) -> float:
        """Return the outer radius (m) at a place (m)."""
        return float(np.interp(s, self._at, self._radii))


BACKBONES: Mapping[str, type[Backbone]] = {"wire": Wire, "cast": Cast}
