"""What pushes without touching: a magnet near the tip, a jet of air across the disks."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.second_rod.mechanics.rod import INTERVALS, PIECES_PER_INTERVAL


class Magnet(NamedTuple):
    """A magnet that repels the tip, energy C a^6 / (r^2 + a^2)^3: two dipoles' far field, rounded off at a core a."""

    place: np.ndarray  # (3,) m
    energy: float  # C, J; 0 for none
    core: float  # a, m


class Jet(NamedTuple):
    """A jet with a Gaussian profile about its axis; each disk is a plate in it."""

    origin: np.ndarray  # (3,) a point of the axis, m
    direction: np.ndarray  # (3,) unit vector
    drag: float  # of a disk that faces it on its axis, N; 0 for none
    width: float  # standard deviation of the profile, m
    edge_on: float  # share of the drag of a disk that stands edge on


NO_MAGNET = Magnet(np.zeros(3), 0.0, 1.0)
NO_JET = Jet(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.0, 1.0, 1.0)


@njit(cache=True)
def repel(tip, magnet, force):
    """Adds -grad of the magnet's energy, N, to the tip's force (3,)."""
    square = 0.0
    for axis in range(3):
        square += (tip[axis] - magnet.place[axis]) ** 2
    slope = 6 * magnet.energy * magnet.core**6 / (square + magnet.core**2) ** 4
    for axis in range(3):
        force[axis] += slope * (tip[axis] - magnet.place[axis])


@njit(cache=True)
def blow(rotations, positions, jet, forces):
    """Adds the jet's forces (NODES, 3), N: half along the jet, more so face on, half along the plate's normal.

    With c the cosine between jet and disk axis: F = q / 2 ((e + (1 - e) c^2) d + c |c| n), q = drag exp(-rho^2 / 2 w^2).
    """
    for disk in range(1, INTERVALS + 1):
        node = disk * PIECES_PER_INTERVAL
        ahead, square, cosine = 0.0, 0.0, 0.0
        for axis in range(3):
            ahead += (positions[node, axis] - jet.origin[axis]) * jet.direction[axis]
            cosine += rotations[node, axis, 2] * jet.direction[axis]
        for axis in range(3):
            square += (positions[node, axis] - jet.origin[axis] - ahead * jet.direction[axis]) ** 2
        half = 0.5 * jet.drag * np.exp(-square / (2 * jet.width**2))
        along = half * (jet.edge_on + (1 - jet.edge_on) * cosine**2)
        normal = half * cosine * abs(cosine)
        for axis in range(3):
            forces[node, axis] += along * jet.direction[axis] + normal * rotations[node, axis, 2]
