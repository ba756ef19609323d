"""Tendons straight between the holes of rigid disks, and the loss of tension at the holes where they turn.

    T_{k+1} = T_k exp(-mu theta_k z_k)     k = 1..N-1, theta_k: turn of the tendon at the hole of disk k (rad)

z in [-1, 1] is the share of the sliding friction that is mobilised: +1 when the tendon slides towards the base (pulled),
-1 when it slides towards the tip. Before full sliding z follows an Iwan model: sliders in parallel, slider n being
elastic up to a slip delta_n (W. D. Iwan, J. Appl. Mech. 33, 1966), so inner loops close and a held tendon stays put.
The base plate's hole is not counted: the load cell sits right behind it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

IWAN_SPREAD = np.array([0.15, 0.4, 0.75, 1.2, 2.5])  # slider strokes over the mean stroke; they average to 1


class Friction(NamedTuple):
    """The law's parameters and its memory at the last equilibrium; the slip counts from there."""

    mu: float
    stroke: np.ndarray  # (S,) m, slip at which each slider yields
    z: np.ndarray  # (N-1, T, S)
    distal: np.ndarray  # (N-1, T) m, path length from the hole to the tip


@njit(cache=True, error_model="numpy")
def mobilise(z, slip, stroke, z_new):
    """Advance one hole's sliders z (S,) by `slip` (m); returns the mean z and its slope dz/dslip (1/m)."""
    mean, slope = 0.0, 0.0
    S = z.shape[0]
    for n in range(S):
        trial = z[n] + slip / stroke[n]
        if trial > 1.0:
            trial = 1.0
        elif trial < -1.0:
            trial = -1.0
        else:
            slope += 1.0 / (stroke[n] * S)
        z_new[n] = trial
        mean += trial / S
    return mean, slope


@njit(cache=True, error_model="numpy")
def lay(disk_R, disk_r, holes, hole, toward_base, length):
    """Hole positions (N+1, T, 3), unit vectors from disk k+1 to disk k (N, T, 3) and segment lengths (N, T)."""
    N, T = length.shape
    for k in range(N + 1):
        for i in range(T):
            for c in range(3):
                hole[k, i, c] = disk_r[k, c]
                for d in range(3):
                    hole[k, i, c] += disk_R[k, c, d] * holes[k, i, d]
    for k in range(N):
        for i in range(T):
            s = 0.0
            for c in range(3):
                toward_base[k, i, c] = hole[k, i, c] - hole[k + 1, i, c]
                s += toward_base[k, i, c] ** 2
            length[k, i] = np.sqrt(s)
            for c in range(3):
                toward_base[k, i, c] /= length[k, i]


@njit(cache=True, error_model="numpy")
def turn(t_base, t_tip):
    """Angle between two unit vectors, accurate for small angles."""
    d = 0.0
    for c in range(3):
        d += (t_base[c] - t_tip[c]) ** 2
    return 2.0 * np.arcsin(min(1.0, 0.5 * np.sqrt(d)))


@njit(cache=True, error_model="numpy")
def transmit(share, friction, pose):
    """Fill the pose's `ratio` (N, T), segment tension over base tension, and turns, z and dz/dslip at the holes."""
    length, toward_base, ratio = pose.length, pose.toward_base, pose.ratio
    N, T = length.shape
    ratio[:] = share
    if friction.mu <= 0.0:
        return
    for i in range(T):
        distal = 0.0
        for k in range(N - 2, -1, -1):
            distal += length[k + 1, i]
            slip = friction.distal[k, i] - distal
            grip, slope = mobilise(friction.z[k, i], slip, friction.stroke, pose.z[k, i])
            pose.grip[k, i], pose.grip_slope[k, i] = grip, slope
            pose.turns[k, i] = turn(toward_base[k, i], toward_base[k + 1, i])
        log_loss = 0.0
        for k in range(N - 1):
            log_loss += friction.mu * pose.turns[k, i] * pose.grip[k, i]
            ratio[k + 1, i] *= np.exp(-log_loss)
