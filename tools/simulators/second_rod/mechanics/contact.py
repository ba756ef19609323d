"""An obstacle in the way: frictionless, and as hard as a penalty makes it.

The disks' rims touch it, taken as a round envelope about the backbone, so that the backbone itself keeps a clearance. The force at
each disk and midway between disks is k w softplus((clearance - distance) / w) along the obstacle's normal: a penalty whose corner
is rounded over w.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.second_rod.mechanics.rod import PIECES_PER_INTERVAL, ROD_NODES

WALL_OBSTACLE, POST_OBSTACLE = 1, 2
ENVELOPE = 9e-3  # m: holes at 8 mm (nominal.md) and a rim of a millimetre
HARDNESS = 3e3  # N/m per touching node: 0.1 N, much for this robot, dents by 0.03 mm
CONTACT_ROUNDING = 1.5e-4  # m


class Obstacle(NamedTuple):
    """A plane (direction: unit normal into the free side) or a round post (direction: unit vector along its axis)."""

    kind: int  # 0: none
    point: np.ndarray  # (3,) of the plane or the axis, base frame, m
    direction: np.ndarray  # (3,)
    clearance: float  # least distance of the backbone from plane or axis, m
    hardness: float  # N/m
    rounding: float  # m


NO_OBSTACLE = Obstacle(0, np.zeros(3), np.zeros(3), 0.0, HARDNESS, CONTACT_ROUNDING)


def obstacle(kind: int, point: np.ndarray, direction: np.ndarray, radius: float = 0.0) -> Obstacle:
    """A wall, or a post of a radius in m, that the disks' rims meet."""
    return Obstacle(kind, point, direction, radius + ENVELOPE, HARDNESS, CONTACT_ROUNDING)


@njit(cache=True)
def softplus(x):
    return x + np.log1p(np.exp(-x)) if x > 0 else np.log1p(np.exp(x))


@njit(cache=True)
def push(positions, obstacle, forces):
    """Adds the obstacle's forces (ROD_NODES, 3) N, from the first disk on."""
    normal = np.empty(3)
    for node in range(PIECES_PER_INTERVAL, ROD_NODES, PIECES_PER_INTERVAL // 2):
        ahead = 0.0
        for axis in range(3):
            normal[axis] = positions[node, axis] - obstacle.point[axis]
            ahead += normal[axis] * obstacle.direction[axis]
        if obstacle.kind == WALL_OBSTACLE:
            distance = ahead
            normal[:] = obstacle.direction
        else:
            square = 0.0
            for axis in range(3):
                normal[axis] -= ahead * obstacle.direction[axis]
                square += normal[axis] ** 2
            distance = np.sqrt(square)
            normal /= distance
        force = obstacle.hardness * obstacle.rounding * softplus((obstacle.clearance - distance) / obstacle.rounding)
        for axis in range(3):
            forces[node, axis] += force * normal[axis]
