"""Orientations as rotation vectors: what quaternions and roll, pitch, yaw of a log are compared as.

A rotation vector (rad, in the base frame) against the straight robot is smooth where the body bends and twists, and its errors are
angles. Beyond half a turn it goes on growing rather than jump to the other side.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

TURN_TO_FOLLOW = 0.7 * np.pi  # rad; below it a rotation has one vector


def followed(turn: np.ndarray) -> np.ndarray:
    """Return rotation vectors (n, ..., 3) rad of the same rotations, each next to the row before; NaN rows are left out."""
    if not np.any(np.linalg.norm(turn, axis=-1) > TURN_TO_FOLLOW):
        return turn
    out = turn.copy()
    before = np.where(np.isfinite(turn[0]), turn[0], 0.0)
    for row in out:
        angle = np.linalg.norm(row, axis=-1, keepdims=True)
        around = 2.0 * np.pi * row / np.where(angle > 0.0, angle, 1.0)
        times = np.round(np.sum((before - row) * around, axis=-1, keepdims=True) / (4.0 * np.pi**2))
        row += np.where(np.isfinite(times), times, 0.0) * around
        before = np.where(np.isfinite(row), row, before)
    return out


def from_quaternions(q: np.ndarray) -> np.ndarray:
    """Return rotation vectors (n, 3) rad of unit quaternions (n, 4), w first, of either sign; NaN where one is missing or zero."""
    out = np.full((len(q), 3), np.nan)
    known = np.isfinite(q).all(axis=1) & (np.linalg.norm(np.nan_to_num(q), axis=1) > 0.5)
    if known.any():
        out[known] = Rotation.from_quat(q[known], scalar_first=True).as_rotvec()
    return followed(out)


def from_angles(angles: np.ndarray) -> np.ndarray:
    """Return rotation vectors (n, 3) rad of roll, pitch, yaw (n, 3) rad, R = Rz(yaw) Ry(pitch) Rx(roll); NaN where one lacks."""
    out = np.full((len(angles), 3), np.nan)
    known = np.isfinite(angles).all(axis=1)
    if known.any():
        out[known] = Rotation.from_euler("ZYX", angles[known][:, ::-1]).as_rotvec()
    return followed(out)


def quaternions(turn: np.ndarray) -> np.ndarray:
    """Return unit quaternions (n, 4), w first, of rotation vectors (n, 3) rad; neighbours of one sign."""
    q = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    return q * np.concatenate([[1.0], flips])[:, None]


def angles(turn: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (n, ..., 3) rad of rotation vectors (n, ..., 3) rad, without jumps of a turn from row to row."""
    flat = Rotation.from_rotvec(turn.reshape(-1, 3)).as_euler("ZYX")[:, ::-1]
    return np.unwrap(flat.reshape(turn.shape), axis=0)


def turned_by(turn: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return rotation vectors (n, ..., 3) rad after a further rotation vector (3,) rad of the frame that they are seen in."""
    if not first.any():
        return turn
    both = Rotation.from_rotvec(first) * Rotation.from_rotvec(turn.reshape(-1, 3))
    return followed(both.as_rotvec().reshape(turn.shape))


def rates_and_forces(time: np.ndarray, turn: np.ndarray, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what an IMU that turns by rotation vectors (n, k, 3) rad reads at rest in its place, both (n, k, 3) in its own frame.

    Rates (rad/s) by central differences of the rotation; specific force R^T (-g) (m/s^2) under gravity (3,): the acceleration of
    its place is left out, which in slow motion is small beside g.
    """
    n, k, _ = turn.shape
    R = Rotation.from_rotvec(turn.reshape(-1, 3))
    force = R.inv().apply(np.tile(-gravity, (n * k, 1))).reshape(turn.shape)
    rate = np.zeros_like(turn)
    if n > 1:
        late, early = np.minimum(np.arange(n) + 1, n - 1), np.maximum(np.arange(n) - 1, 0)
        matrix = R.as_matrix().reshape(n, k, 3, 3)
        between = np.swapaxes(matrix[early], -1, -2) @ matrix[late]
        step = Rotation.from_matrix(between.reshape(-1, 3, 3)).as_rotvec().reshape(turn.shape)
        half = Rotation.from_rotvec(0.5 * step.reshape(-1, 3)).inv()  # seen halfway: in the frame of the middle row
        rate = half.apply(step.reshape(-1, 3)).reshape(turn.shape) / (time[late] - time[early])[:, None, None]
    return rate, force
