"""Loads on the skin: a soft wall or post that it presses, and pushes on patches of it.

The wall pushes with F = stiffness share max(0, depth) along the normal at each point of the skin. The shares of the points around
one height add up to one, so that `stiffness` (N/m) is that of one ring pressed all round.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from twin.effects.contact import obstacle_gap
from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit
from twin.mechanics.silicone.material.lattice import Cone, lattice

# Points of the skin that carry pushes: rings on the mantle, points of each, rings on the tip's face.
MANTLE_RINGS, POINTS_AROUND, TIP_RINGS = 36, 32, 8


@by_reference
class ContactSkin(NamedTuple):
    """Points at rest (m, 3) m, their weights of the free nodes (m, n_free), and their shares (m,) of a ring."""

    rest: np.ndarray
    weights: np.ndarray
    share: np.ndarray


@jit
def add_wall_force(skin, u, wall, scale, r, K, tangent):
    """Subtract the push of a wall (10,), as in `Loads`, from the residual r (n,).

    With `tangent` its tangent is added to K (n, n) instead. Both are over the body's relative stiffness, `scale`.
    """
    x = skin.rest + np.dot(skin.weights, u)
    for m in range(len(x)):
        gap, normal, across, bend = obstacle_gap(wall, x[m])
        depth = -gap
        if depth <= 0.0:
            continue
        k = wall[4] * skin.share[m] / scale
        for a in range(skin.weights.shape[1]):
            w = skin.weights[m, a]
            if w == 0.0:
                continue
            for i in range(3):
                if not tangent:
                    r[3 * a + i] -= k * depth * w * normal[i]
                    continue
                for b in range(skin.weights.shape[1]):
                    for j in range(3):
                        stiff = normal[i] * normal[j] - depth * bend * across[i] * across[j]
                        K[3 * a + i, 3 * b + j] += k * w * skin.weights[m, b] * stiff


@dataclass(frozen=True)
class Pushes:
    """Pushes on patches of the skin.

    Patches at `height` (k,) m and `azimuth` (k,) rad of `width` (k,) m with total `force` (k, 3) N.
    """

    height: np.ndarray
    azimuth: np.ndarray
    width: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class PushSurface:
    """Points (m, 3) m of the free skin, the area (m,) m^2 of each, and their weights of the free nodes (m, n_free)."""

    points: np.ndarray
    area: np.ndarray
    weights: np.ndarray

    def nodal_force(self, pushes: Pushes) -> np.ndarray:
        """Return the pushes' forces on the free nodes, (n_free, 3) N."""
        out = np.zeros((self.weights.shape[1], 3))
        radius = np.interp(pushes.height, *self._mantle_profile())
        centre = np.column_stack([radius * np.cos(pushes.azimuth), radius * np.sin(pushes.azimuth), pushes.height])
        for c, width, force in zip(centre, pushes.width, pushes.force, strict=True):
            patch = self.area * np.exp(-((self.points - c) ** 2).sum(axis=1) / (2.0 * width**2))
            out += np.outer(patch / patch.sum() @ self.weights, force)
        return out

    def _mantle_profile(self) -> tuple[np.ndarray, np.ndarray]:
        mantle = self.points[: MANTLE_RINGS * POINTS_AROUND].reshape(MANTLE_RINGS, POINTS_AROUND, 3)
        return mantle[:, 0, 2], np.hypot(mantle[:, 0, 0], mantle[:, 0, 1])


@lru_cache(maxsize=4)
def push_surface(cone: Cone, cells: int) -> PushSurface:
    """Return the surface that carries pushes on a cone's free skin."""
    z = cone.clamp + (cone.length - cone.clamp) * (np.arange(MANTLE_RINGS) + 0.5) / MANTLE_RINGS
    t = 2.0 * np.pi * np.arange(POINTS_AROUND) / POINTS_AROUND
    Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
    share = (np.arange(TIP_RINGS) + 0.5) / TIP_RINGS
    Q, S = (v.ravel() for v in np.meshgrid(share * cone.tip, t, indexing="ij"))
    radius = np.concatenate([cone.radius(Z), Q])
    angle, height = np.concatenate([T, S]), np.concatenate([Z, np.full(len(Q), cone.length)])
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    depth = np.concatenate([np.full(len(Z), (cone.length - cone.clamp) / MANTLE_RINGS), np.full(len(Q), cone.tip / TIP_RINGS)])
    return PushSurface(points, radius * 2.0 * np.pi / POINTS_AROUND * depth, lattice(cone, cells).weights(points))
