"""Tendons: straight from hole to hole, fixed at the tip disk (nominal.md); tension commanded, or found from the length paid in.

Friction at the base hole and at every disk's hole but the last is Euler and Eytelwein's capstan law (physics.md 3.2),

    T_next = T exp(-mu (theta + theta_0) z),

theta the angle between the segments before and after, theta_0 the wrap of a hole that grips a straight tendon, and z in [-1, 1] how
far the hole's friction is mobilised: dz/dx = (sign(dx) - z) / delta in the tendon's travel x through the hole (Dahl, with sigma_0 =
1 / delta), positive towards the base.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.second_rod.mechanics.rod import INTERVALS, PIECES_PER_INTERVAL, cross

ROD_TENDONS = 3
SLACK_ROUNDING = 0.02  # N: a tendon that just goes slack keeps half of this; below the noise of a load cell
REVERSAL = 1e-7  # m: travel over which a reversal at a hole is rounded off, far below any delta


class Tendons(NamedTuple):
    """What the compiled functions need of the tendons; SI units."""

    holes: np.ndarray  # (ROD_TENDONS, INTERVALS + 1, 2) in each plate's plane, base plate first, m
    rest_lengths: np.ndarray  # (ROD_TENDONS,) from base hole to tip hole on the straight robot, m
    by_displacement: bool  # the drive is a length, else a tension
    compliance: float  # of the drive and tendon, m/N; only with a drive by displacement
    stiffening: float  # 1/m, T = stretch (1 + stiffening stretch) / compliance
    friction: float  # mu
    least_wrap: float  # theta_0, rad
    sliding_length: float  # delta, m


def rest_lengths(holes: np.ndarray, disk_positions: np.ndarray) -> np.ndarray:
    """(ROD_TENDONS, INTERVALS) length of each segment on the straight robot, m."""
    along = np.diff(disk_positions, prepend=0.0)
    return np.sqrt(along**2 + np.sum(np.diff(holes, axis=1) ** 2, axis=2))


@njit(cache=True)
def segments(rotations, positions, holes):
    """Unit vectors (ROD_TENDONS, INTERVALS, 3), base to tip, and lengths (ROD_TENDONS, INTERVALS) m."""
    directions, lengths = np.empty((ROD_TENDONS, INTERVALS, 3)), np.empty((ROD_TENDONS, INTERVALS))
    before, after = np.empty(3), np.empty(3)
    for tendon in range(ROD_TENDONS):
        for plate in range(INTERVALS + 1):
            node, x, y = plate * PIECES_PER_INTERVAL, holes[tendon, plate, 0], holes[tendon, plate, 1]
            for axis in range(3):
                after[axis] = positions[node, axis] + rotations[node, axis, 0] * x + rotations[node, axis, 1] * y
            if plate > 0:
                length = np.sqrt((after[0] - before[0]) ** 2 + (after[1] - before[1]) ** 2 + (after[2] - before[2]) ** 2)
                lengths[tendon, plate - 1] = length
                for axis in range(3):
                    directions[tendon, plate - 1, axis] = (after[axis] - before[axis]) / length
            before[:] = after
    return directions, lengths


@njit(cache=True)
def tension_of_stretch(stretch, tendons):
    """T = (y + sqrt(y^2 + w^2)) / 2 with y = stretch (1 + stiffening stretch) / compliance: a tendon cannot push."""
    load = stretch / tendons.compliance
    if stretch > 0:
        load *= 1 + tendons.stiffening * stretch
    root = np.sqrt(load**2 + SLACK_ROUNDING**2)
    if load > 0:
        return 0.5 * (load + root)
    return 0.5 * SLACK_ROUNDING**2 / (root - load)


@njit(cache=True)
def base_tension(drive, length, rest_length, tendons):
    """At the load cell, N: the drive itself (N), or what a drive by displacement (m, pulled in) stretches the tendon to."""
    if tendons.by_displacement:
        return tension_of_stretch(length - rest_length + drive, tendons)
    return drive


@njit(cache=True)
def mobilised_after(mobilised, travel, sliding_length):
    """z after a travel (m) through a hole: the exact solution of Dahl's law, its corner at a reversal rounded off."""
    way = abs(travel)
    way = way - REVERSAL / 2 if way > REVERSAL else way**2 / (2 * REVERSAL)
    end = 1.0 if travel > 0 else -1.0
    return end + (mobilised - end) * np.exp(-way / sliding_length)


@njit(cache=True)
def wrap(before, after):
    """Angle between two unit vectors, rad; exact near zero, where the arc cosine is not."""
    normal = cross(before, after)
    sine = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    return np.arctan2(sine, before[0] * after[0] + before[1] * after[1] + before[2] * after[2])


@njit(cache=True)
def tensions(directions, lengths, drive, tendons, memory, after):
    """Return the tension (ROD_TENDONS, INTERVALS) N of each segment, and that at the load cells (ROD_TENDONS,).

    The memory's mobilised and beyond (ROD_TENDONS, INTERVALS) are z at each hole and the tendon length beyond it, m, at the last
    equilibrium; what they become is written into `after`.
    """
    along, base = np.empty((ROD_TENDONS, INTERVALS)), np.empty(ROD_TENDONS)
    axis_of_base = np.array([0.0, 0.0, 1.0])
    for tendon in range(ROD_TENDONS):
        left = np.sum(lengths[tendon])
        tension = base_tension(drive[tendon], left, tendons.rest_lengths[tendon], tendons)
        base[tendon] = tension
        for hole in range(INTERVALS):
            after.beyond[tendon, hole] = left
            if tendons.friction > 0:
                before = axis_of_base if hole == 0 else directions[tendon, hole - 1]
                angle = wrap(before, directions[tendon, hole]) + tendons.least_wrap
                travel = memory.beyond[tendon, hole] - left
                z = mobilised_after(memory.mobilised[tendon, hole], travel, tendons.sliding_length)
                after.mobilised[tendon, hole] = z
                tension *= np.exp(-tendons.friction * angle * z)
            along[tendon, hole] = tension
            left -= lengths[tendon, hole]
    return along, base


@njit(cache=True)
def pull(rotations, directions, along, holes, forces, moments):
    """Adds what the tendons do to each disk: forces (NODES, 3) N, moments (NODES, 3) N m about the backbone."""
    force, lever = np.empty(3), np.empty(3)
    for tendon in range(ROD_TENDONS):
        for plate in range(1, INTERVALS + 1):
            node, x, y = plate * PIECES_PER_INTERVAL, holes[tendon, plate, 0], holes[tendon, plate, 1]
            for axis in range(3):
                force[axis] = -along[tendon, plate - 1] * directions[tendon, plate - 1, axis]
                if plate < INTERVALS:
                    force[axis] += along[tendon, plate] * directions[tendon, plate, axis]
                lever[axis] = rotations[node, axis, 0] * x + rotations[node, axis, 1] * y
            moment = cross(lever, force)
            for axis in range(3):
                forces[node, axis] += force[axis]
                moments[node, axis] += moment[axis]
