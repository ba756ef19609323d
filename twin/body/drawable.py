"""Arrays for drawing a robot's body and colouring it. Each family of bodies implements `Drawable`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from twin.body.loads import Loads
from twin.body.route import Route
from twin.body.solver import Heating, Solution

NO_POINTS, NO_QUATERNIONS, NO_PIECES, NO_VALUES = (np.zeros(shape) for shape in ((0, 3), (0, 4), (0, 2, 3), 0))


class ColourScale(NamedTuple):
    """The ends `low` and `high` of a colour bar in the unit shown: shown value = factor (SI value - zero)."""

    name: str
    unit: str
    factor: float
    low: float
    high: float
    zero: float = 0.0


class Shape(NamedTuple):
    """A shape in the frame of its link: "sphere", "capsule", "cylinder", "box", "ellipsoid" or "mesh".

    `size` (3,) m is MuJoCo's: radius, half lengths along z or the axes; a mesh has `vertices` (v, 3) m and `faces` (f, 3).
    """

    kind: str
    size: np.ndarray
    place: np.ndarray  # (3,) m
    turn: np.ndarray  # (4,) w, x, y, z
    vertices: np.ndarray = NO_POINTS
    faces: np.ndarray = NO_POINTS


class Solid(NamedTuple):
    """The shapes of a link that have one colour, bytes, and opacity, 0 to 1; whether they move."""

    shapes: tuple[Shape, ...]
    colour: tuple[int, int, int]
    opacity: float
    moves: bool


class FrameShapes(NamedTuple):
    """One frame of `Frames`, without its markers."""

    link_positions: np.ndarray = NO_POINTS
    link_quaternions: np.ndarray = NO_QUATERNIONS
    tendon_pieces: np.ndarray = NO_PIECES
    tension: np.ndarray = NO_VALUES
    skin: np.ndarray = NO_POINTS
    strain: np.ndarray = NO_VALUES
    cord_pieces: np.ndarray = NO_PIECES
    resistance: np.ndarray = NO_VALUES
    spring_pieces: np.ndarray = NO_PIECES
    temperature: np.ndarray = NO_VALUES


@dataclass(frozen=True)
class Frames:
    """n frames of a robot."""

    link_positions: np.ndarray  # (n, g, 3) m
    link_quaternions: np.ndarray  # (n, g, 4) w, x, y, z
    tendon_pieces: np.ndarray  # (n, s, 2, 3) m, from and to
    tension: np.ndarray  # (n, s) N, of the tendon pieces
    skin: np.ndarray  # (n, v, 3) m
    strain: np.ndarray  # (n, v), of the skin along the body
    cord_pieces: np.ndarray  # (n, c, 2, 3) m, of the sensor cords
    resistance: np.ndarray  # (n, c), their relative change R/R0 - 1
    spring_pieces: np.ndarray  # (n, w, 2, 3) m, of the SMA springs
    temperature: np.ndarray  # (n, w) K, of the springs
    markers: np.ndarray  # (n, m, 3) m

    def frame_at(self, i: int, share: float = 0.0) -> Frames:
        """Return frame i (from the end if negative) as frames of length one, interpolated by `share` towards the next."""
        i %= len(self.markers)
        j = min(i + 1, len(self.markers) - 1)
        both = ((getattr(self, f.name)[i : i + 1], getattr(self, f.name)[j : j + 1]) for f in fields(self))
        return Frames(*((1.0 - share) * a + share * b for a, b in both))


class Drawable(Protocol):
    """The drawing of a body."""

    cylinders: np.ndarray  # (g, 2) m, radius and half length of the links
    link_colours: np.ndarray  # (g, 3) bytes
    solids: tuple[Solid, ...]  # (g), the links' shapes where these are no cylinders
    faces: np.ndarray  # (f, 3), of the skin
    height: float  # m, drawn as one unit
    middle: np.ndarray  # (3,) m, that is looked at
    view: np.ndarray  # (3,), from where; zero where any side will do
    tip: int  # the marker that is told as the tip, negative from the end
    colour_fields: tuple[str, ...]  # fields of `Frames` that it may be coloured by
    push_points: np.ndarray  # (p, 3), where it may be pushed: height, azimuth and finger of `Push`

    def frames(self, path: Solution, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        """Return the frames of a solution that started slack, or with cold springs, under `loads`; `heating` if springs pull.

        The tension along the tendons is computed from the slip since that start.
        """
        ...

    def push_positions(self, shown: Frames) -> np.ndarray:
        """Return the positions (p, 3) m of `push_points` in the first frame."""
        ...

    def colour_scale(self, shade: str, most: float) -> ColourScale:
        """Return the colour scale of a field whose largest value is `most` (SI)."""
        ...


@runtime_checkable
class Jointed(Protocol):
    """The drawing of a body with joints that encoders read."""

    def turned(self, path: Solution, joints: Mapping[int, np.ndarray]) -> Frames:
        """Return the frames with some joints, by number, at other positions (n,), rad or m; NaN keeps the solution's."""
        ...


def stack_frames(drawn: list[FrameShapes], markers: np.ndarray) -> Frames:
    """Return the frames of a list of drawn shapes and their markers (n, m, 3) m."""
    columns = zip(FrameShapes._fields, zip(*drawn, strict=True), strict=True)
    return Frames(markers=markers, **{name: np.stack(column) for name, column in columns})
