"""Backbone: an inextensible Kirchhoff rod whose curvatures are Legendre polynomials of arc length.

    u(s) = (1 / L) sum_k P_k(2 s / L - 1) q_k,   R' = R hat(u),   r' = R e_3

q (3 n): coefficients of the curvature about x, y and z of the material frame, rad. Rotations are exact over each of
PIECES_PER_INTERVAL pieces of a disk interval with the curvature at its middle; positions follow by Simpson's rule over pairs of
pieces. The residual of virtual work is the exact derivative of this discrete rod, so that Newton ends where the discrete energy is
stationary. Bending and twist: physics.md 1.2, stretch and shear left out as there.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

INTERVALS = 8  # between disks, the first from the base (nominal.md)
PIECES_PER_INTERVAL = 4  # pieces of constant curvature per interval; even, for Simpson's rule
ROD_PIECES = INTERVALS * PIECES_PER_INTERVAL
ROD_NODES = ROD_PIECES + 1
SMALL_TURN = 1e-4  # rad; below, series of sin and cos to second order are exact to 1e-17


class Rod(NamedTuple):
    """What the compiled functions need of a backbone; SI units."""

    length: float  # m
    steps: np.ndarray  # (ROD_PIECES,) m
    basis: np.ndarray  # (ROD_PIECES, n) P_k at the middle of each piece
    bending: np.ndarray  # (ROD_PIECES, 3) stiffness xx, xy, yy, N m^2
    twisting: np.ndarray  # (ROD_PIECES,) N m^2
    masses: np.ndarray  # (ROD_NODES,) of the backbone alone, kg, on even nodes


class Pose(NamedTuple):
    """Where curvatures put the rod."""

    rotations: np.ndarray  # (ROD_NODES, 3, 3)
    positions: np.ndarray  # (ROD_NODES, 3) m
    curvatures: np.ndarray  # (ROD_PIECES, 3) 1/m
    tangents: np.ndarray  # (ROD_PIECES, 3, 3), see `turned`


def make_rod(disk_positions: np.ndarray, functions: int, bending: np.ndarray, twisting: np.ndarray, mass: float) -> Rod:
    """Disk positions (INTERVALS,) m along the backbone, the last at the tip; stiffnesses at `middles`; mass in kg."""
    length = float(disk_positions[-1])
    steps = np.repeat(np.diff(disk_positions, prepend=0.0) / PIECES_PER_INTERVAL, PIECES_PER_INTERVAL)
    basis = np.polynomial.legendre.legvander(2 * middles(disk_positions) / length - 1, functions - 1)
    masses = np.zeros(ROD_NODES)
    pair = mass * steps.reshape(-1, 2).sum(1) / length
    masses[0:-1:2] += pair / 2
    masses[2::2] += pair / 2
    return Rod(length, steps, np.ascontiguousarray(basis), np.ascontiguousarray(bending), twisting, masses)


def middles(disk_positions: np.ndarray) -> np.ndarray:
    """(ROD_PIECES,) arc length at the middle of each piece, m."""
    steps = np.repeat(np.diff(disk_positions, prepend=0.0) / PIECES_PER_INTERVAL, PIECES_PER_INTERVAL)
    return np.cumsum(steps) - steps / 2


@njit(cache=True)
def cross(a, b):
    """a x b, as a tuple: no allocation in the inner loop."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def turned(turn, rotation, after, tangent):
    """after = rotation exp(hat w); tangent = sum_k hat(w)^k / (k + 1)!, which maps a change of w to a rotation in the old frame."""
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle < SMALL_TURN:
        sine, cosine, third = 1 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        sine = np.sin(angle) / angle
        cosine = (1 - np.cos(angle)) / angle**2
        third = (angle - np.sin(angle)) / angle**3
    hat = np.zeros((3, 3))
    hat[0, 1], hat[0, 2], hat[1, 2] = -turn[2], turn[1], -turn[0]
    hat[1, 0], hat[2, 0], hat[2, 1] = turn[2], -turn[1], turn[0]
    for i in range(3):
        for j in range(3):
            one = 1.0 if i == j else 0.0
            square = turn[i] * turn[j] - one * angle**2
            tangent[i, j] = one + cosine * hat[i, j] + third * square
            hat[i, j] = one + sine * hat[i, j] + cosine * square
    for i in range(3):
        for j in range(3):
            after[i, j] = rotation[i, 0] * hat[0, j] + rotation[i, 1] * hat[1, j] + rotation[i, 2] * hat[2, j]


@njit(cache=True)
def shape(coefficients, rod):
    """Return the pose of coefficients q (3 n)."""
    n = rod.basis.shape[1]
    rotations, positions = np.zeros((ROD_NODES, 3, 3)), np.zeros((ROD_NODES, 3))
    curvatures, tangents = np.empty((ROD_PIECES, 3)), np.empty((ROD_PIECES, 3, 3))
    turn = np.empty(3)
    for axis in range(3):
        rotations[0, axis, axis] = 1.0
    for piece in range(ROD_PIECES):
        for axis in range(3):
            bend = 0.0
            for k in range(n):
                bend += rod.basis[piece, k] * coefficients[axis * n + k]
            curvatures[piece, axis] = bend / rod.length
            turn[axis] = curvatures[piece, axis] * rod.steps[piece]
        turned(turn, rotations[piece], rotations[piece + 1], tangents[piece])
    for node in range(0, ROD_NODES - 1, 2):
        step = rod.steps[node]
        for axis in range(3):
            first, second, third = rotations[node, axis, 2], rotations[node + 1, axis, 2], rotations[node + 2, axis, 2]
            positions[node + 1, axis] = positions[node, axis] + step / 12 * (5 * first + 8 * second - third)
            positions[node + 2, axis] = positions[node, axis] + step / 3 * (first + 4 * second + third)
    return Pose(rotations, positions, curvatures, tangents)


@njit(cache=True)
def imbalance(rest, stiffness, rod, pose, forces, moments):
    """Derivative of bending energy minus work of the loads with respect to q (3 n), N m.

    rest (3 n): q without stress. stiffness: factor on the rod's stiffnesses. forces (ROD_NODES, 3) N on even nodes and moments
    (ROD_NODES, 3) N m, base frame; the moments are used up.
    """
    rotations, curvatures, tangents = pose.rotations, pose.curvatures, pose.tangents
    n = rod.basis.shape[1]
    beyond = np.zeros(3)  # force on all that lies beyond a node
    for node in range(ROD_NODES - 3, -1, -2):
        step = rod.steps[node]
        for axis in range(3):
            beyond[axis] += forces[node + 2, axis]
        for place, weight in ((node, 1.0), (node + 1, 4.0), (node + 2, 1.0)):
            lever = cross(rotations[place, :, 2], beyond)
            for axis in range(3):
                moments[place, axis] += weight * step / 3 * lever[axis]
    out = np.zeros(3 * n)
    total, local, strain, inner = np.zeros(3), np.empty(3), np.empty(3), np.empty(3)
    for piece in range(ROD_PIECES - 1, -1, -1):
        for axis in range(3):
            total[axis] += moments[piece + 1, axis]
        rotation, tangent = rotations[piece], tangents[piece]
        for axis in range(3):
            local[axis] = rotation[0, axis] * total[0] + rotation[1, axis] * total[1] + rotation[2, axis] * total[2]
            unbent = 0.0
            for k in range(n):
                unbent += rod.basis[piece, k] * rest[axis * n + k]
            strain[axis] = curvatures[piece, axis] - unbent / rod.length
        bending = rod.bending[piece]
        inner[0] = stiffness * (bending[0] * strain[0] + bending[1] * strain[1])
        inner[1] = stiffness * (bending[1] * strain[0] + bending[2] * strain[1])
        inner[2] = stiffness * rod.twisting[piece] * strain[2]
        for axis in range(3):
            load = tangent[0, axis] * local[0] + tangent[1, axis] * local[1] + tangent[2, axis] * local[2]
            share = rod.steps[piece] / rod.length * (inner[axis] - load)
            for k in range(n):
                out[axis * n + k] += rod.basis[piece, k] * share
    return out
