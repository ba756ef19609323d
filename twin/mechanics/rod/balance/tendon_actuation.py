"""Motors and SMA springs that hold tendons, each as a tendon of one free length and one compliance at each step.

For a motor   gap = path - free length - stretch T - BACKBONE_COMPLIANCE sum T,   the sum over the tendons that motors hold, whose
total tension compresses the backbone. A tendon that beds in also gives way by e = bedding (1 - exp(-T/T_b)): at each step it is one
of free length free + e - e' T with a compliance larger by e'. A motor that stalls pulls no more than T_s: a tendon that would need
more has a compliance of `STALL_COMPLIANCE` from there on.

An SMA spring: on each linear piece Y = Y_0 + slope (e_s - e_0) of its force law (twin/mechanics/springs/force.py), at an elongation
e_s = e_start + path - straight path - stretch T - e, it is a tendon of free length path - (stretch + e') T - Y/slope with a
compliance larger by e' + 1/slope, so gap = (Y - T)/slope. The piece is chosen anew at every step (semi-smooth Newton: all pieces
rise with e).

A spring that follows its tendon with backlash is longer by backlash z less, z = +1 after the path has grown, -1 after it has
shrunk, z = clip(z + change of the path / crossing travel). In between only k = 1 - backlash / crossing travel of a change reaches
it, and gap = (Y - T)/(slope k).
"""

from typing import NamedTuple

import numpy as np

from twin.body import Route
from twin.effects.tendon_friction import slip_state
from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal
from twin.mechanics.springs.force import tension_piece

LEAST_STRETCH = 1e-6  # m/N of any tendon, since two taut ones may run side by side
# m/N of the backbone; it makes the tensions of three taut tendons, which are redundant, unique. An inextensible robot has none,
# 120 mm of NiTi of 0.8 mm 3e-6; at 3 N this is 3 um, less than an encoder resolves.
BACKBONE_COMPLIANCE = 1e-6
LENGTH_STIFFNESS = 1e3  # N/m, part of the stiffness of a held length against its tendon's pull
MOST_BACKLASH_SHARE = 0.99  # of a path's change that backlash may keep from a spring: all of it would leave no stiffness
STALL_COMPLIANCE = 10.0  # m/N of a motor that stalls: 1 mm less than commanded is 0.1 mN more


@by_reference
class Actuation(NamedTuple):
    """Tendons held by motors or springs, (n_tendon,) each. Tensions count times `softness`, as in `trial_steps.apply_stiffness`."""

    held: np.ndarray  # whether a tendon is held, not pulled with a given tension
    by_spring: np.ndarray  # whether a spring holds it
    free_length: np.ndarray  # m
    stretch: np.ndarray  # m/N
    straight_path: np.ndarray  # m, path lengths on the straight robot
    tendon_stretch: float  # m/N, stretch of the tendon alone
    softness: np.ndarray  # (1,)
    spring: np.ndarray  # (n_tendon,) `Spring.records`
    temperature: np.ndarray  # K, of the springs
    elongation: np.ndarray  # m, of the springs when last at rest
    tension: np.ndarray  # N, of the springs then
    bedding: float  # m
    bedding_tension: float  # N
    bedding_offset: np.ndarray  # (n_tendon,) m, e - e' T
    stall_tension: float  # N, of motors
    backlash: np.ndarray  # (n_tendon,) m, of tendons that springs pull
    crossing_travel: np.ndarray  # (n_tendon,) m
    backlash_state: np.ndarray  # (n_tendon,) z when the springs were last at rest
    path: np.ndarray  # (n_tendon,) m, path lengths then
    pushes: bool  # whether the tendons are rods, which push as well


@jit_internal
def backlash_at(actuation, t, path):
    """Return the backlash offset (m) of tendon t at a path length (m), and the share of path changes beyond it."""
    if actuation.backlash[t] == 0.0:
        return 0.0, 1.0
    z = slip_state(actuation.backlash_state[t], path - actuation.path[t], actuation.crossing_travel[t])
    return actuation.backlash[t] * z, 1.0 if abs(z) == 1.0 else 1.0 - actuation.backlash[t] / actuation.crossing_travel[t]


@jit_internal
def spring_elongation(actuation, t, path, tension):
    """Return the elongation (m) of the spring that pulls tendon t at a path length (m) and a tension."""
    longer_by = actuation.tendon_stretch * tension / actuation.softness[0]
    if actuation.bedding > 0.0:
        longer_by += actuation.bedding * (1.0 - np.exp(-tension / (actuation.bedding_tension * actuation.softness[0])))
    return (
        actuation.spring[t].initial_elongation + path - actuation.straight_path[t] - longer_by - backlash_at(actuation, t, path)[0]
    )


@jit_internal
def linearise_tendons(actuation, s, tension):
    """Set free length and compliance of the tendons that springs hold, that bed in, or whose motors may stall.

    Springs are linearised on their present piece. s[t, 0] is the path.
    """
    for t in range(tension.size):
        if actuation.by_spring[t]:
            e = spring_elongation(actuation, t, s[t, 0], tension[t])
            Y, slope = tension_piece(
                actuation.spring, t, actuation.temperature[t], e, actuation.elongation[t], actuation.tension[t]
            )
            elastic = actuation.tendon_stretch / actuation.softness[0]
            if actuation.bedding > 0.0:
                over = actuation.bedding_tension * actuation.softness[0]
                elastic += actuation.bedding / over * np.exp(-tension[t] / over)
            share = backlash_at(actuation, t, s[t, 0])[1]
            actuation.free_length[t] = s[t, 0] - (elastic * tension[t] + Y / slope) / share
            actuation.stretch[t] = (elastic + 1.0 / (slope * actuation.softness[0])) / share
        elif actuation.bedding > 0.0 or actuation.stall_tension < np.inf:
            linearise_bedding(actuation, t, tension[t])
    if actuation.stall_tension < np.inf:
        for t in range(tension.size):
            if actuation.held[t] and not actuation.by_spring[t]:
                linearise_stall(actuation, t, s[t, 0], tension)


@jit_internal
def linearise_bedding(actuation, t, tension):
    """Set the bedding offset of tendon t at a tension, and its compliance there."""
    over = actuation.bedding_tension * actuation.softness[0]
    remaining = np.exp(-tension / over)
    actuation.bedding_offset[t] = actuation.bedding * (1.0 - remaining * (1.0 + tension / over))
    actuation.stretch[t] = (
        max(actuation.tendon_stretch, LEAST_STRETCH) / actuation.softness[0] + actuation.bedding / over * remaining
    )


@jit_internal
def linearise_stall(actuation, t, path, tension):
    """Put tendon t on the piece where its motor stalls, if it would pull more than that here."""
    if tension[t] / actuation.softness[0] + LENGTH_STIFFNESS * length_gap(actuation, t, path, tension) > actuation.stall_tension:
        longer_by = max(actuation.tendon_stretch, LEAST_STRETCH) * actuation.stall_tension + actuation.bedding * (
            1.0 - np.exp(-actuation.stall_tension / actuation.bedding_tension)
        )
        actuation.bedding_offset[t] = longer_by - STALL_COMPLIANCE * actuation.stall_tension
        actuation.stretch[t] = STALL_COMPLIANCE / actuation.softness[0]


@jit_internal
def tendon_compliance(actuation, i, j):
    """Return by how much (m/N) tendon j's tension lengthens tendon i, both held: its own stretch and the backbone's compression."""
    own = actuation.stretch[i] if i == j else 0.0
    if actuation.by_spring[i] or actuation.by_spring[j] or not (actuation.held[i] and actuation.held[j]):
        return own
    return own + BACKBONE_COMPLIANCE / actuation.softness[0]


@jit_internal
def length_gap(actuation, t, path, tension):
    """Return the excess length (m) of tendon t at a path length (m) and all tensions."""
    gap = path - actuation.free_length[t] - actuation.bedding_offset[t]
    for j in range(tension.size):
        gap -= tendon_compliance(actuation, t, j) * tension[j]
    return gap


@jit_internal
def commit_spring(actuation, t, path, tension):
    """Store the state of spring t at rest at a path length (m) under a tension (N)."""
    actuation.elongation[t] = spring_elongation(actuation, t, path, tension * actuation.softness[0])
    actuation.tension[t] = tension
    if actuation.backlash[t] > 0.0:
        actuation.backlash_state[t] = slip_state(
            actuation.backlash_state[t], path - actuation.path[t], actuation.crossing_travel[t]
        )
    actuation.path[t] = path


def initial_backlash(
    route: Route, zero: np.ndarray, by_spring: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return `backlash`, `crossing_travel`, `backlash_state` and `path` of `Actuation` before any motion, for paths of `zero`
    (n_tendon,) m."""
    backlash = by_spring * np.array(route.backlash or np.zeros(zero.size), float)
    return (
        backlash,
        np.maximum(np.array(route.crossing_travel, float), backlash / MOST_BACKLASH_SHARE),
        np.zeros(zero.size),
        zero.copy(),
    )


@jit
def commit_springs(actuation, s, tension):
    """Store elongations and tensions of all springs at rest, from which their force laws go on."""
    for t in range(tension.size):
        if actuation.by_spring[t]:
            commit_spring(actuation, t, s[t, 0], tension[t] / actuation.softness[0])
