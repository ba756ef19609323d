"""The skin as a camera sees it: points with outward normals, and distances of a cloud from those that face the camera.

The distance is one-way, from each measured point to the tangent plane at the nearest visible point of the predicted skin. It needs
no correspondence, and hidden skin does not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from twin.measurements.patches import N_PATCHES, Patches
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.material.lattice import Cone

SKIN_RINGS, SKIN_AROUND, FACE_RINGS = 41, 48, 5
TIP_RIM = slice((SKIN_RINGS - 1) * SKIN_AROUND, SKIN_RINGS * SKIN_AROUND)  # last ring of the mantle
GRAZING_COSINE = -0.05  # a point is visible above it: a little beyond the edge, where noise puts points


@dataclass(frozen=True)
class Skin:
    """Points (m, 3) m at rest, their weights (m, n_free) of the free nodes, and neighbours `around` and `along` the skin.

    Each normal is the cross product of the differences of the neighbours around and along.
    """

    rest: np.ndarray
    weights: np.ndarray
    around: tuple[np.ndarray, np.ndarray]
    along: tuple[np.ndarray, np.ndarray]

    @staticmethod
    def of(body: SoftBody) -> Skin:
        """Return the whole skin, clamped part included: rings on the mantle from base to tip, then rings on the tip's face."""
        rest = np.concatenate([_mantle(body.cone), _face(body.cone)])
        ring = np.arange(len(rest)).reshape(SKIN_RINGS + FACE_RINGS, SKIN_AROUND)
        around = np.roll(ring, -1, axis=1).ravel(), np.roll(ring, 1, axis=1).ravel()
        up, down = np.r_[1:SKIN_RINGS, SKIN_RINGS - 1], np.r_[0, 0 : SKIN_RINGS - 1]
        face = np.arange(SKIN_RINGS, SKIN_RINGS + FACE_RINGS)
        inwards, outwards = np.r_[face[1:], face[-1]], np.r_[face[0], face[:-1]]
        along = ring[np.r_[up, inwards]].ravel(), ring[np.r_[down, outwards]].ravel()
        return Skin(rest, body.lattice.weights(rest), around, along)

    def points_and_normals(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points and unit normals (m, 3) in the finger's own frame at nodes' displacements (n_free, 3) m."""
        x = self.rest + self.weights @ nodes
        n = np.cross(x[self.around[0]] - x[self.around[1]], x[self.along[0]] - x[self.along[1]])
        return x, n / np.linalg.norm(n, axis=1, keepdims=True)


def _mantle(cone: Cone) -> np.ndarray:
    z = np.linspace(0.0, cone.length, SKIN_RINGS)
    return _rings(cone.radius(z), z)


def _face(cone: Cone) -> np.ndarray:
    return _rings(cone.tip * np.linspace(0.98, 0.0, FACE_RINGS, endpoint=False), np.full(FACE_RINGS, cone.length))


def _rings(radius: np.ndarray, z: np.ndarray) -> np.ndarray:
    t = 2.0 * np.pi * np.arange(SKIN_AROUND) / SKIN_AROUND
    return np.stack([np.outer(radius, np.cos(t)), np.outer(radius, np.sin(t)), np.outer(z, np.ones(SKIN_AROUND))], axis=-1).reshape(
        -1, 3
    )


def is_visible(normals: np.ndarray, turn: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return (m,) whether skin may be seen from `side` (3,) of the base frame; all of it where that is zero.

    Normals (m, 3) are in the own frame, which is rotated by `turn` (3, 3).
    """
    return normals @ (side @ turn) > GRAZING_COSINE


def signed_distances(cloud: np.ndarray, x: np.ndarray, normals: np.ndarray, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return signed distances (k,) m of cloud points (k, 3) from the visible skin, and their nearest skin points.

    The cloud is in the frame of x.
    """
    seen = np.flatnonzero(visible)
    nearest = seen[KDTree(x[seen]).query(cloud)[1]]
    return ((cloud - x[nearest]) * normals[nearest]).sum(axis=1), nearest


def expected_patches(skin: Skin, seen: Patches, time: np.ndarray, u: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the expected coordinates (n, PATCHES) m of the patches of clouds, at samples at time (n,) s.

    These are the observed ones less the median distance of their points from the visible skin, at nodes' displacements u (n,
    n_free, 3) m. Shapes are interpolated linearly between samples, patches between frames.
    """
    frames, should = np.flatnonzero((seen.time >= time[0]) & (seen.time <= time[-1])), np.zeros((len(seen.time), N_PATCHES))
    for f in frames:
        i = min(int(np.searchsorted(time, seen.time[f], side="right")) - 1, len(time) - 2)
        share = (seen.time[f] - time[i]) / (time[i + 1] - time[i])
        x, normals = skin.points_and_normals((1.0 - share) * u[i] + share * u[i + 1])
        d = signed_distances(seen.points[f] @ turn, x, normals, is_visible(normals, turn, seen.camera_direction))[0]
        for j in np.flatnonzero(np.isfinite(seen.positions[f])):
            should[f, j] = seen.positions[f, j] - np.median(d[seen.patch_of_points[f] == j])
    if not len(frames):
        return np.zeros((len(time), N_PATCHES))
    return np.stack([np.interp(time, seen.time[frames], column) for column in should[frames].T], axis=1)
