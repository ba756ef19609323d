"""One-sided point clouds as something to predict: where patches of the seen skin stand, without any correspondence of points.

The points of a frame are cut into bands of as many points each, from base to tip (by distance from the base, which grows along a
body that bends less than half a turn), and each band into the two halves left and right of the camera's line of sight. Along the
two directions outwards, 45 degrees to either side of the camera's, a patch stands at its points' median; what predicts it says how
far, in the median, the same points stand off the skin. So the cut is the data's alone, and nothing is sought on the skin but the
nearest place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from twin.measurements.recording import Clouds

BANDS = 6
PATCHES = 2 * BANDS
FEWEST = 8  # points of a patch whose median says something
BASE = 0.2  # share of all points, those nearest to the base, that hardly move: on their side is the camera
EDGES = (0.01, 0.99)  # quantiles of their azimuth that stand for the edges of what is seen
ONE_SIDED = np.radians(216.0)  # between those: half a turn is seen from one side, and somewhat more by noise
SHARED = 0.5  # of the scatter of single points: neighbouring pixels share errors, so that a patch counts as four points at most
NEIGHBOURS = 16  # of a point, to which a curved surface is laid


@dataclass(frozen=True)
class Patches:
    """The clouds of one trial, cut: time (f,) s; of each frame its points (k, 3) m and their patch (k,), from 0, -1 for none;
    where each patch stands, (f, PATCHES) m along its direction, NaN where it has too few points; `side` (3,) towards the camera."""

    time: np.ndarray
    points: tuple[np.ndarray, ...]
    of: tuple[np.ndarray, ...]
    place: np.ndarray
    side: np.ndarray

    def at(self, time: np.ndarray) -> np.ndarray:
        """`place` on the samples (n,) s next to the frames, (n, PATCHES), NaN elsewhere; a frame outside the trial is left out."""
        out = np.full((len(time), PATCHES), np.nan)
        for t, row in zip(self.time, self.place, strict=True):
            if time[0] <= t <= time[-1]:
                out[np.abs(time - t).argmin()] = row
        return out


def cut(clouds: Clouds | None, side: np.ndarray) -> Patches:
    """The patches of a trial's clouds, seen from `side` (3,); of no clouds no frames."""
    frames = [] if clouds is None else [clouds.points[a:b] for a, b in zip(clouds.offsets[:-1], clouds.offsets[1:], strict=True)]
    time = np.empty(0) if clouds is None else clouds.time
    across = np.array([-side[1], side[0], 0.0])
    outwards = np.tile((np.stack([side - across, side + across]) / np.sqrt(2.0)), (BANDS, 1))
    of = tuple(_halves(points, across) for points in frames)
    place = np.full((len(frames), PATCHES), np.nan)
    for f, (points, patch) in enumerate(zip(frames, of, strict=True)):
        for j in np.flatnonzero(np.bincount(patch[patch >= 0], minlength=PATCHES) >= FEWEST):
            place[f, j] = np.median(points[patch == j] @ outwards[j])
    return Patches(time, tuple(frames), of, place, side)


def _halves(points: np.ndarray, across: np.ndarray) -> np.ndarray:
    """The patch (k,) of each point: 2 band + half."""
    patch = np.full(len(points), -1)
    order = np.argsort(np.linalg.norm(points, axis=1), kind="stable")
    for b, band in enumerate(np.array_split(order, BANDS)):
        if len(band):
            off = points[band] @ across
            patch[band] = 2 * b + (off > 0.5 * (off.min() + off.max()))
    return patch


def side(clouds: Sequence[Clouds]) -> np.ndarray:
    """The horizontal direction (3,) from the base towards the camera: the middle between the edges of what is seen next to the
    base, within 1 degree on 18 days of two benches, however unevenly the points lie between (their mean is up to 7 degrees off).
    Zero where these are all around it, and the clouds not of one side."""
    points = np.concatenate([c.points for c in clouds]) if clouds else np.zeros((0, 3))
    if not len(points):
        return np.zeros(3)
    far = np.linalg.norm(points, axis=1)
    base = points[far <= np.quantile(far, BASE), :2] @ [1.0, 1j]
    middle = base.mean()
    if not abs(middle) > 0.0:
        return np.zeros(3)
    low, high = np.quantile(np.angle(base / middle), EDGES)
    if high - low > ONE_SIDED:
        return np.zeros(3)
    camera = middle / abs(middle) * np.exp(0.5j * (low + high))
    return np.array([camera.real, camera.imag, 0.0])


def scatter(clouds: Sequence[Clouds]) -> float:
    """Standard deviation (m) of one point about the surface, from each one's distance to a paraboloid through its neighbours, in
    the largest frame of each trial; NaN where frames have fewer points than that takes."""
    frames = [max(np.split(c.points, c.offsets[1:-1]), key=len) for c in clouds]
    found = [_about(points) for points in frames if len(points) > NEIGHBOURS]
    return float(np.sqrt(np.median(np.concatenate(found)))) if found else float("nan")


def _about(points: np.ndarray) -> np.ndarray:
    """Variance (k,) m^2 of each point's neighbourhood about the paraboloid that fits it best."""
    near = points[KDTree(points).query(points, k=NEIGHBOURS)[1]]
    near = near - near.mean(axis=1, keepdims=True)
    frame = np.linalg.eigh(np.einsum("pkc,pkd->pcd", near, near))[1]  # columns: normal, then along the surface
    height, a, b = np.moveaxis(near @ frame, 2, 0)
    A = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    scale = np.linalg.norm(A, axis=1, keepdims=True)
    Q = np.linalg.qr(A / np.where(scale > 0.0, scale, 1.0))[0]
    left = height - np.einsum("pkm,pm->pk", Q, np.einsum("pkm,pk->pm", Q, height))
    return (left**2).sum(axis=1) / (NEIGHBOURS - A.shape[2])
