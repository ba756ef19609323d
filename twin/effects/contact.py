"""Contact: the body touches an undeclared obstacle, a flat wall that may lean or a round post at any slant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from twin.compiled import dot, inner
from twin.effects.effect import Effect, Loads, Signals, Start
from twin.quantities import Parameter

AZIMUTHS = 8
TOUCHED = (0.95, 0.8)  # quantiles of how far the robot reaches, at which a wall may stand
NEAREST = 5e-3  # m: an obstacle nearer than that is always touched
HEIGHTS = 3  # along the robot, at which a post may cross
SOFTEST = 5.0  # N/m: 1 cm^2 of a foam of 10 kPa, 20 mm thick, has 50; what gives way ten times more easily is a field, not a thing
POST = 50.0  # 1/m: a post of 20 mm radius, from which fits of its curvature start
SLANTS = (-0.8, 0.0, 0.8, 0.5 * np.pi)  # rad, of posts from which fits start: across the robot, slanted, a pole beside it
LEANS = (-0.3, 0.3)  # rad, from which fits of a leaning wall start


@inner
def touch(wall, x):
    """Of a point x (m): its gap from an obstacle (10,) of `Loads` (m, negative inside), the direction in which that grows fastest,
    the direction across it in which the obstacle turns away, and by how much the first turns a metre along the second (1/m).

    With u = n.(x - q) from the line q nearest to the robot, w = b.(x - q) across that line and curvature c, a round post's

        gap = (rho - 1) / c = (2 u + c (u^2 + w^2)) / (1 + rho),   rho = |(1 + c u, c w)|,

    which is u where c = 0, a flat wall.
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
    """What `Loads` and `touch` call a wall or a post, (10,): `normal` towards the free side, `offset` (m) of the surface along it,
    `stiffness` (N/m); of a post also the direction `across` it, its `place` along that (m) and its `curvature` (1/m)."""
    return np.array([*np.asarray(normal, float), offset, stiffness, *np.asarray(across, float), place, curvature])


def seen_from(wall: np.ndarray, turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    """An obstacle (10,) of `Loads` in a frame whose axes are the columns of `turn` (3, 3) and whose origin is `place` (3,) m."""
    normal, across = wall[:3], wall[5:8]
    return obstacle(normal @ turn, wall[3] - normal @ place, wall[4], across @ turn, wall[8] - across @ place, wall[9])


class Contact(Effect):
    """A flat wall at `distance` from the straight robot in direction `azimuth`, parallel to it, or leaning away from it by `lean`
    about its line at `height`; or, where `curvature` is not zero, a round post of radius 1 / curvature that is nearest to the
    straight robot's axis at `height`, and crosses it at a right angle, turned from there by `slant`. A disk whose centre is p
    beyond the surface is pushed back with F = stiffness * max(0, p), along the surface's normal and without friction.

    Every plane but one across the robot's axis is such a wall, every round post such a post: the shortest way from an axis to a
    line is square to both. Source: linear penalty contact. An edge of the frame, a hand, the table, a bar.

    >>> wall = Contact(azimuth=0.0, distance=0.05, stiffness=200.0).surround(Loads(np.zeros(3))).wall
    >>> [float(v) for v in wall[:5]]
    [-1.0, 0.0, 0.0, -0.05, 200.0]
    """

    id = "contact"
    parameters = (
        Parameter("stiffness", 0.0, "N/m", 0.0, 2e4, "per disk; ours: from foam to steel", scale=5.0),
        Parameter("azimuth", 0.0, "rad", -10.0, 10.0, "direction of the obstacle from the robot", scale=0.1),
        Parameter("distance", 0.05, "m", 2e-3, 0.2, "from the straight robot's axis", scale=1e-3),
        Parameter("curvature", 0.0, "1/m", 0.0, 1e3, "of a post across the robot; 0: a flat wall", scale=POST),
        Parameter("height", 0.05, "m", -1.0, 1.0, "of a post above the base; of a wall that leans, of its line", scale=1e-3),
        Parameter("slant", 0.0, "rad", -10.0, 10.0, "of a post; 0: across the robot, pi/2: along it", scale=0.1),
        Parameter("lean", 0.0, "rad", -1.4, 1.4, "of a flat wall, away from the robot further up", scale=0.1),
    )
    shape = ("azimuth", "distance", "curvature", "height", "slant", "lean")
    richer = ("curvature", "height", "slant", "lean")
    needs = frozenset({"surface"})
    moves_with = "position: only where the robot reaches beyond a line"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Walls around the robot, each where the robot would touch it in some samples and not in the others."""
        names = tuple(p.name for p in cls.parameters if p.name not in cls.richer)
        for azimuth in 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS:
            furthest = _reach(predicted, azimuth).max(axis=1)
            for quantile in TOUCHED:
                distance = float(np.quantile(furthest, quantile))
                if distance > NEAREST:
                    yield Start({"stiffness": 10.0, "azimuth": azimuth, "distance": distance}, names)

    def fuller_starts(self, predicted: list[Signals]) -> Iterator[Start]:
        """Posts at the height of one of `HEIGHTS` markers, and touched there as often as the wall is anywhere, the middle one at
        every slant; and walls that lean in its place."""
        reached, height = _reach(predicted, self["azimuth"]), np.concatenate([s.markers[..., 2] for s in predicted])
        beyond = reached.max(axis=1) > self["distance"]
        at = np.unique(np.linspace(0, reached.shape[1] - 1, 2 * HEIGHTS + 1).round().astype(int)[1::2])
        for j in at:
            distance = float(np.quantile(reached[:, j], 1.0 - np.mean(beyond)))
            if distance > NEAREST:
                there = float(np.median(height[reached[:, j] >= distance, j]))
                for slant in SLANTS if j == at[len(at) // 2] else (0.0,):
                    post = {"distance": distance, "curvature": POST, "height": there, "slant": slant}
                    yield Start(post, ("curvature", "height", "slant"))
        furthest = height[np.arange(len(height)), reached.argmax(axis=1)]
        there = float(np.median(furthest[beyond])) if beyond.any() else self["height"]
        for lean in LEANS:
            yield Start({"height": there, "lean": lean}, ("lean",))

    def implausible(self) -> str:
        soft = 0.0 < self["stiffness"] < SOFTEST
        return (
            f"an obstacle of {self['stiffness']:.2g} N/m is softer than foam, rather a force that depends on the pose"
            if soft
            else ""
        )

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


def _reach(predicted: list[Signals], azimuth: float) -> np.ndarray:
    """How far markers are (n, n_marker) m from the straight robot's axis in a direction."""
    return np.concatenate([s.markers[..., :2] for s in predicted]) @ [np.cos(azimuth), np.sin(azimuth)]
