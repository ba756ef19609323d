"""Contact: the body touches an undeclared obstacle, a flat wall that may lean or a round post at any slant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from twin.body import Loads, Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.compiled import dot, jit_internal
from twin.foundation.parameters import Parameter

N_WALL_AZIMUTHS = 8
REACH_QUANTILES = (0.95, 0.8)  # of how far the robot reaches: distances of walls from which fits start
MIN_OBSTACLE_DISTANCE = 5e-3  # m: a nearer obstacle is always touched
N_POST_HEIGHTS = 3  # along the robot: heights of posts from which fits start
MIN_OBSTACLE_STIFFNESS = (
    5.0  # N/m: 1 cm^2 of a foam of 10 kPa, 20 mm thick, has 50; what gives way ten times more easily is a field, not a thing
)
POST_CURVATURE = 50.0  # 1/m, a radius of 20 mm, from which fits start
POST_SLANTS = (-0.8, 0.0, 0.8, 0.5 * np.pi)  # rad, from which fits start: slanted, across the robot, slanted, parallel to it
WALL_LEANS = (-0.3, 0.3)  # rad, from which fits start


@jit_internal
def obstacle_gap(wall, x):
    """Return the gap (m, negative inside) of a point x (m) from an obstacle (10,) of `Loads`, and its derivatives.

    These are the direction in which the gap grows fastest, the direction across it in which the surface curves away, and the
    rotation of the first along the second (1/m). For a round post of curvature c whose line nearest to the robot goes through q,
    with u = n.(x - q) and w = b.(x - q) across that line,

        gap = (rho - 1) / c = (2 u + c (u^2 + w^2)) / (1 + rho),   rho = |(1 + c u, c w)|,

    which is u for a flat wall, c = 0.
    """
    n, b, c = (wall[0], wall[1], wall[2]), (wall[5], wall[6], wall[7]), wall[9]
    u = dot(n, x) - wall[3]
    if c == 0.0:
        return u, n, b, 0.0
    w = dot(b, x) - wall[8]
    out, over = 1.0 + c * u, c * w
    rho = np.sqrt(out * out + over * over)
    out, over = out / rho, over / rho
    grows = (out * n[0] + over * b[0], out * n[1] + over * b[1], out * n[2] + over * b[2])
    turns = (out * b[0] - over * n[0], out * b[1] - over * n[1], out * b[2] - over * n[2])
    return (2.0 * u + c * (u * u + w * w)) / (1.0 + rho), grows, turns, c / rho


def obstacle(
    normal: ArrayLike,
    offset: float,
    stiffness: float,
    across: ArrayLike = (0.0, 0.0, 1.0),
    place: float = 0.0,
    curvature: float = 0.0,
) -> np.ndarray:
    """Return the array (10,) of a wall or a post for `Loads.wall`.

    `normal` points to the free side, `offset` (m) is the surface's place along it, `stiffness` in N/m. A post also has a direction
    `across` it, a `place` along that (m) and a `curvature` (1/m).
    """
    return np.array([*np.asarray(normal, float), offset, stiffness, *np.asarray(across, float), place, curvature])


def obstacle_in_frame(wall: np.ndarray, turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Transform an obstacle (10,) to a frame whose axes are the columns of `turn` (3, 3) and whose origin is `place` (3,) m."""
    normal, across = wall[:3], wall[5:8]
    return obstacle(normal @ turn, wall[3] - normal @ place, wall[4], across @ turn, wall[8] - across @ place, wall[9])


class Contact(Effect):
    """A flat wall or a round post; a disk whose centre is p beyond its surface is pushed back with F = stiffness * max(0, p).

    The force is along the surface's normal, without friction. The wall stands at `distance` from the straight robot in direction
    `azimuth`, parallel to the robot or leaning away from it by `lean` about its line at `height`. With a `curvature` it is a post
    of radius 1 / curvature, nearest to the straight robot's axis at `height`; it crosses the axis at a right angle, turned by
    `slant`. This covers every plane that is not square to the robot's axis and every round post, since the shortest connection of
    the axis and a line is square to both.

    Source: linear penalty contact. An edge of the frame, a hand, the table, a bar.

    >>> wall = Contact(azimuth=0.0, distance=0.05, stiffness=200.0).surround(Loads(np.zeros(3))).wall
    >>> [float(v) for v in wall[:5]]
    [-1.0, 0.0, 0.0, -0.05, 200.0]
    """

    id = "contact"
    parameters = (
        Parameter("stiffness", 0.0, "N/m", 0.0, 2e4, "per disk; ours: from foam to steel", scale=5.0),
        Parameter("azimuth", 0.0, "rad", -10.0, 10.0, "direction of the obstacle from the robot", scale=0.1),
        Parameter("distance", 0.05, "m", 2e-3, 0.2, "from the straight robot's axis", scale=1e-3),
        Parameter("curvature", 0.0, "1/m", 0.0, 1e3, "of a post across the robot; 0: a flat wall", scale=POST_CURVATURE),
        Parameter("height", 0.05, "m", -1.0, 1.0, "of a post above the base; of a wall that leans, of its line", scale=1e-3),
        Parameter("slant", 0.0, "rad", -10.0, 10.0, "of a post; 0: across the robot, pi/2: along it", scale=0.1),
        Parameter("lean", 0.0, "rad", -1.4, 1.4, "of a flat wall, away from the robot further up", scale=0.1),
    )
    inactive_when_off = ("azimuth", "distance", "curvature", "height", "slant", "lean")
    extended_parameters = ("curvature", "height", "slant", "lean")
    needs = frozenset({"surface"})
    moves_with = "position: only where the robot reaches beyond a line"
    plot_against = "position"
    hidden_without = frozenset({DataNeed.EVERY_TENDON})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with walls around the robot, each touched in some samples only."""
        if not predicted:
            return
        names = tuple(p.name for p in cls.parameters if p.name not in cls.extended_parameters)
        for azimuth in 2 * np.pi * np.arange(N_WALL_AZIMUTHS) / N_WALL_AZIMUTHS:
            furthest = _marker_reach(predicted, azimuth).max(axis=1)
            for quantile in REACH_QUANTILES:
                distance = float(np.quantile(furthest, quantile))
                if distance > MIN_OBSTACLE_DISTANCE:
                    yield FitStart({"stiffness": 10.0, "azimuth": azimuth, "distance": distance}, names)

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        """Start with posts at the heights of `N_POST_HEIGHTS` markers, and with walls that lean.

        A post is touched at its height as often as the wall is anywhere; the middle one starts at every slant.
        """
        reached, height = _marker_reach(predicted, self["azimuth"]), np.concatenate([s.markers[..., 2] for s in predicted])
        touches = reached.max(axis=1) > self["distance"]
        at = np.unique(np.linspace(0, reached.shape[1] - 1, 2 * N_POST_HEIGHTS + 1).round().astype(int)[1::2])
        for j in at:
            distance = float(np.quantile(reached[:, j], 1.0 - np.mean(touches)))
            if distance > MIN_OBSTACLE_DISTANCE:
                at_height = float(np.median(height[reached[:, j] >= distance, j]))
                for slant in POST_SLANTS if j == at[len(at) // 2] else (0.0,):
                    post = {"distance": distance, "curvature": POST_CURVATURE, "height": at_height, "slant": slant}
                    yield FitStart(post, ("curvature", "height", "slant"))
        furthest = height[np.arange(len(height)), reached.argmax(axis=1)]
        at_height = float(np.median(furthest[touches])) if touches.any() else self["height"]
        for lean in WALL_LEANS:
            yield FitStart({"height": at_height, "lean": lean}, ("lean",))

    def why_implausible(self) -> str:
        if 0.0 < self["stiffness"] < MIN_OBSTACLE_STIFFNESS:
            return f"an obstacle of {self['stiffness']:.2g} N/m is softer than foam, rather a force that depends on the pose"
        return ""

    def surround(self, loads: Loads) -> Loads:
        if self["stiffness"] <= 0.0:
            return loads
        c, s = np.cos(self["azimuth"]), np.sin(self["azimuth"])
        out, beside, up = np.array([c, s, 0.0]), np.array([-s, c, 0.0]), np.array([0.0, 0.0, 1.0])
        normal = np.sin(self["lean"]) * up - np.cos(self["lean"]) * out
        rising = np.cos(self["lean"]) * up + np.sin(self["lean"]) * out
        across = np.cos(self["slant"]) * rising - np.sin(self["slant"]) * beside
        nearest = self["distance"] * out + self["height"] * up
        wall = obstacle(normal, normal @ nearest, self["stiffness"], across, across @ nearest, self["curvature"])
        return replace(loads, wall=wall)


def _marker_reach(predicted: list[Signals], azimuth: float) -> np.ndarray:
    """Return the distance (n, n_marker) m of markers from the straight robot's axis in a direction."""
    return np.concatenate([s.markers[..., :2] for s in predicted]) @ [np.cos(azimuth), np.sin(azimuth)]
