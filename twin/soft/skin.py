"""The skin as a camera sees it: points with outward normals, and how far a cloud lies from those that face the camera.

The distance is one-way, from each measured point to the tangent plane at the nearest visible point of the predicted skin, so that
it needs no correspondence and does not care for what the camera cannot see.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from twin.measurements.patches import PATCHES, Patches
from twin.soft.body import SoftBody
from twin.soft.lattice import Cone

RINGS, AROUND, FACE = 41, 48, 5
RIM = slice((RINGS - 1) * AROUND, RINGS * AROUND)  # the last ring of the mantle
GRAZING = -0.05  # cosine from which a point may be seen: a little beyond the edge, where noise puts points


@dataclass(frozen=True)
class Skin:
    """Points (m, 3) m at rest and how they move (m, n_free); two directions along the skin at each, as weights of points: each
    normal is the cross product of `around` and `along` differences."""

    rest: np.ndarray
    weights: np.ndarray
    around: tuple[np.ndarray, np.ndarray]
    along: tuple[np.ndarray, np.ndarray]

    @staticmethod
    def of(body: SoftBody) -> Skin:
        """The whole skin, the clamped part too: rings on the mantle from base to tip, then rings on the tip's face."""
        rest = np.concatenate([_mantle(body.cone), _face(body.cone)])
        ring = np.arange(len(rest)).reshape(RINGS + FACE, AROUND)
        around = np.roll(ring, -1, axis=1).ravel(), np.roll(ring, 1, axis=1).ravel()
        up, down = np.r_[1:RINGS, RINGS - 1], np.r_[0, 0 : RINGS - 1]
        face = np.arange(RINGS, RINGS + FACE)
        inwards, outwards = np.r_[face[1:], face[-1]], np.r_[face[0], face[:-1]]
        along = ring[np.r_[up, inwards]].ravel(), ring[np.r_[down, outwards]].ravel()
        return Skin(rest, body.lattice.weights(rest), around, along)

    def at(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places and unit normals (m, 3) in the finger's own frame at nodes' displacements (n_free, 3)."""
        x = self.rest + self.weights @ nodes
        n = np.cross(x[self.around[0]] - x[self.around[1]], x[self.along[0]] - x[self.along[1]])
        return x, n / np.linalg.norm(n, axis=1, keepdims=True)


def _mantle(cone: Cone) -> np.ndarray:
    z = np.linspace(0.0, cone.length, RINGS)
    return _rings(cone.radius(z), z)


def _face(cone: Cone) -> np.ndarray:
    return _rings(cone.tip * np.linspace(0.98, 0.0, FACE, endpoint=False), np.full(FACE, cone.length))


def _rings(radius: np.ndarray, z: np.ndarray) -> np.ndarray:
    t = 2.0 * np.pi * np.arange(AROUND) / AROUND
    return np.stack([np.outer(radius, np.cos(t)), np.outer(radius, np.sin(t)), np.outer(z, np.ones(AROUND))], axis=-1).reshape(
        -1, 3
    )


def facing(normals: np.ndarray, turn: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(m,) whether skin with these normals in the own frame, turned by `turn` (3, 3), may be seen from `side` (3,) of the base
    frame; all of it where that is zero."""
    return normals @ (side @ turn) > GRAZING


def distances(cloud: np.ndarray, x: np.ndarray, normals: np.ndarray, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of cloud points (k, 3), in the frame of x: signed distances (k,) m from the skin, and which skin point each is nearest to."""
    seen = np.flatnonzero(visible)
    nearest = seen[KDTree(x[seen]).query(cloud)[1]]
    return ((cloud - x[nearest]) * normals[nearest]).sum(axis=1), nearest


def stand(skin: Skin, seen: Patches, time: np.ndarray, u: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Where the patches of clouds should stand, (n, PATCHES) m on samples at time (n,) s with nodes' displacements u (n, n_free, 3)
    m: where they do, less the median distance of their points from the visible skin. Between two samples the shape goes straight,
    and between two frames what is shown."""
    frames, should = np.flatnonzero((seen.time >= time[0]) & (seen.time <= time[-1])), np.zeros((len(seen.time), PATCHES))
    for f in frames:
        i = min(int(np.searchsorted(time, seen.time[f], side="right")) - 1, len(time) - 2)
        share = (seen.time[f] - time[i]) / (time[i + 1] - time[i])
        x, normals = skin.at((1.0 - share) * u[i] + share * u[i + 1])
        d = distances(seen.points[f] @ turn, x, normals, facing(normals, turn, seen.side))[0]
        for j in np.flatnonzero(np.isfinite(seen.place[f])):
            should[f, j] = seen.place[f, j] - np.median(d[seen.of[f] == j])
    if not len(frames):
        return np.zeros((len(time), PATCHES))
    return np.stack([np.interp(time, seen.time[frames], column) for column in should[frames].T], axis=1)
