"""Steps shared by all static trials: inputs, creep, results, and what happens at each sample."""

from typing import NamedTuple

import numpy as np

from twin.effects.backbone_creep import delayed_strain
from twin.foundation.by_reference import by_reference, refer_to
from twin.foundation.compiled import assign, jit, jit_inline, jit_internal
from twin.mechanics.rod.balance.chain import ChainState, ContactLaw, StaticLoad, StaticSystem, commit_slip, force_balance
from twin.mechanics.rod.balance.elastic import rotation_vectors
from twin.mechanics.rod.balance.lengths import HeldTarget
from twin.mechanics.rod.balance.newton import Factors, empty_factors, follow_flow, is_minimum, solve_near, update_kinematics
from twin.mechanics.rod.balance.tendon_actuation import Actuation

START_STEPS = 8  # from slack to the first tensions; 512 instead moved the tip by at most 0.015 mm in 180 random poses, mu 0.2


@by_reference
class TrialDrive(NamedTuple):
    """Inputs of a trial, sample by sample."""

    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) base tension in N, displacement in m, or current in A
    driven_by_length: np.ndarray  # (n_tendon,) whether it is a displacement
    by_spring: np.ndarray  # (n_tendon,) whether it is the current of an SMA spring
    straight_path: np.ndarray  # (n_tendon,) m, path lengths on the straight robot
    stretch: float  # m/N, of a tendon
    bedding: float  # m, full bedding of a tendon
    bedding_tension: float  # N, tension scale of the bedding
    backlash: np.ndarray  # (n_tendon,) m, of tendons that springs pull
    crossing_travel: np.ndarray  # (n_tendon,) m
    stall_tension: float  # N, at which a motor that holds a length stalls
    least_stretch: float  # m/N, least of a tendon that a motor holds at a length
    stiffness: np.ndarray  # (n,) of the body over that at its reference temperature
    ambient: np.ndarray  # (n,) K, around the springs
    spring: np.ndarray  # (n_tendon,) `Spring.records`
    pushes: bool  # whether the tendons are rods, which push as well


@by_reference
class CreepState(NamedTuple):
    """Creep elements: amplitude and retardation time (n_element,), and the delayed strains, advanced in place."""

    amplitude: np.ndarray
    time: np.ndarray
    delayed: np.ndarray  # (n_element, nv)


@by_reference
class Neighbour(NamedTuple):
    """A neighbouring solution on the same samples, used as first guess instead of extrapolation; or empty arrays."""

    q: np.ndarray  # (n, nv)
    T: np.ndarray  # (n, n_tendon)
    LU: np.ndarray  # (n, nv, nv)
    tension_response: np.ndarray  # (n, n_tendon, nv) rad/N, where tendons are held


@by_reference
class SolveMode(NamedTuple):
    """Tolerance (rad); whether tangents are kept; whether a single Newton step is taken from the neighbour.

    A single step is exact to first order in the difference, where no tendon has friction.
    """

    tol: float
    keep_tangents: bool
    single_step: bool


@by_reference
class TrialResult(NamedTuple):
    """The equilibria, one a sample."""

    LU: np.ndarray  # (n, nv, nv), or empty
    tension_response: np.ndarray  # (n, n_tendon, nv), or empty
    q: np.ndarray  # (n, nv)
    tension: np.ndarray  # (n, n_tendon) at the base, N
    markers: np.ndarray  # (n, n_marker, 3) m
    path: np.ndarray  # (n, n_tendon) lengths of tendons, m
    temperature: np.ndarray  # (n, n_tendon) of springs, K
    status: np.ndarray  # (n,) as `solve_near` returns it


@by_reference
class TrialState(NamedTuple):
    """The present instant of a trial.

    `system` has loads over the present stiffness and the crept rest shape; gravity to `rest` are as described. The last fields are
    distal tendon lengths on the straight robot, and shapes and tensions of the samples before.
    """

    system: StaticSystem
    gravity: np.ndarray  # (3,) m/s^2
    force: np.ndarray  # (3,) N
    push: np.ndarray  # (3,) N
    wall_stiffness: float  # N/m
    rest: np.ndarray  # (nv,)
    state: ChainState
    factors: Factors
    actuation: Actuation
    target: HeldTarget
    straight_lengths: np.ndarray  # (n_tendon, n_piece) distal lengths, m
    last_shape: np.ndarray  # (nv,)
    shape_before: np.ndarray  # (nv,) the one before
    last_tension: np.ndarray  # (n_tendon,)


@jit_inline
def any_true(mask):
    """Return whether any entry is true."""
    count = 0
    for x in mask:
        count += x
    return count > 0


@jit_internal
def advance_creep(creep, instant, dt):
    """Advance the delayed strains by dt under the instantaneous strain (nv,)."""
    for m in range(creep.amplitude.size):
        for i in range(instant.size):
            creep.delayed[m, i] = delayed_strain(creep.delayed[m, i], instant[i], creep.amplitude[m], creep.time[m], dt)


@jit_internal
def set_rest_shape(spring, delayed, rest):
    """Set the rest angles (nv,) after creep: the springs' own plus all delayed strains."""
    for i in range(spring.size):
        rest[i] = spring[i]
        for m in range(delayed.shape[0]):
            rest[i] += delayed[m, i]


@jit_inline
def apply_stiffness(trial, drive, i, weight):
    """Set the loads of sample i, times `weight`, over the body's relative stiffness.

    Statics depends on loads over stiffness only, and friction has no scale of force.
    """
    factor = 1.0 / drive.stiffness[i]
    for a in range(3):
        trial.system.load.gravity[a] = trial.gravity[a] * factor * weight
        trial.system.load.force[a] = trial.force[a] * factor * weight
        trial.system.load.push[a] = trial.push[a] * factor * weight
    trial.system.law.wall[4] = trial.wall_stiffness * factor
    trial.actuation.softness[0] = factor
    for t in range(trial.actuation.stretch.size):
        if not trial.actuation.by_spring[t]:
            trial.actuation.stretch[t] = max(trial.actuation.tendon_stretch, drive.least_stretch) / factor


@jit_inline
def unloaded_trial(described, drive, creep, state):
    """Return the trial's state on the straight robot before its loads, with cold springs."""
    nv, nt, straight, spring = described.rest.size, state.T.size, drive.straight_path, drive.spring
    law, load, warm = described.law, described.load, np.full(nt, drive.ambient[0])
    system = refer_to(StaticSystem(
        described.model, described.data, described.chain, np.empty(nv), ContactLaw(law.mu, law.presliding, law.wall.copy()),
        StaticLoad(load.gravity.copy(), load.payload, load.force.copy(), load.push.copy(), load.pushed),
    ))  # fmt: skip
    elongation, tension = np.empty(nt), np.empty(nt)
    for t in range(nt):
        elongation[t], tension[t] = spring[t].initial_elongation, spring[t].initial_tension
    actuation = refer_to(Actuation(
        drive.by_spring.copy(), drive.by_spring, straight.copy(), np.empty(nt), straight, drive.stretch, np.ones(1), spring,
        warm.copy(), elongation, tension, drive.bedding, drive.bedding_tension, np.zeros(nt), drive.stall_tension,
        drive.backlash, drive.crossing_travel, np.zeros(nt), straight.copy(), drive.pushes,
    ))  # fmt: skip
    last_shape = np.empty(nv)
    trial = refer_to(TrialState(
        system, load.gravity, load.force, load.push, law.wall[4], described.rest, state, empty_factors(nv, nt), actuation,
        HeldTarget(last_shape, straight.copy(), warm), np.empty(state.s.shape), last_shape, np.empty(nv), np.zeros(nt),
    ))  # fmt: skip
    apply_stiffness(trial, drive, 0, 1.0)
    set_rest_shape(described.rest, creep.delayed, system.rest)
    assign(state.q, system.rest)
    update_kinematics(system, state.q)
    r, z, none = np.empty(nv), np.empty(state.z.shape), np.empty((0, 0))
    for t in range(nt):
        state.T[t] = actuation.softness[0] * actuation.tension[t] if drive.by_spring[t] else 0.0
        for d in range(state.z.shape[1]):
            state.z[t, d] = 0.0
    force_balance(system, state, z, trial.straight_lengths, r, none)
    commit_slip(state, state.z, trial.straight_lengths)
    return trial


@jit_inline
def apply_loads(trial, tol):
    """Apply gravity, payload and force with slack tendons. Return the status of the start.

    1, or 2 where the loaded robot has no stable equilibrium near straight, 0 where none was found.
    """
    started = solve_near(trial.system, trial.state, trial.factors, tol)
    if started == 1 and not is_minimum(trial.system, trial.state, trial.factors.LU):
        started = 2 if follow_flow(trial.system, trial.state, trial.factors, tol) else 0
    return started


@jit_inline
def creep_under_last_shape(trial, creep, dt):
    """Advance creep by dt under the last shape."""
    instant, D = np.empty(trial.last_shape.size), np.empty((trial.system.chain.handedness.size, 3, 3))
    rotation_vectors(trial.last_shape, trial.system.chain, instant, D)
    for k in range(instant.size):
        instant[k] -= trial.system.rest[k]
    advance_creep(creep, instant, dt)
    set_rest_shape(trial.rest, creep.delayed, trial.system.rest)


@jit_inline
def needs_small_parts(trial, neighbour):
    """Return whether the next shape may be on either side of a post.

    A neighbour shows on which side it is.
    """
    return trial.system.law.wall[9] > 0.0 and neighbour.q.size == 0


@jit_inline
def guess_shape(trial, neighbour, i):
    """Set a first guess of the shape at sample i: the neighbour's, else extrapolated from the two samples before."""
    q, further = trial.state.q, 0.0 if needs_small_parts(trial, neighbour) else 1.0
    if neighbour.q.size:
        assign(q, neighbour.q[i])
    else:
        for k in range(q.size):
            q[k] = trial.last_shape[k] + further * (trial.last_shape[k] - trial.shape_before[k])
    assign(trial.shape_before, trial.last_shape)


@jit_inline
def borrow_tangent(trial, neighbour, i):
    """Copy the neighbour's tangent at sample i to the factors, if there is one."""
    if neighbour.q.size:
        for k in range(trial.last_shape.size):
            assign(trial.factors.LU[k], neighbour.LU[i, k])
        trial.factors.usable[0] = True


@jit_internal
def copy_markers(chain, markers):
    """Copy the markers (n_marker, 3) m of the chain's present shape."""
    for k in range(chain.marker.size):
        assign(markers[k], chain.site[chain.marker[k]])


@jit
def markers_of_shapes(system, q, markers):
    """Fill the markers (n, n_marker, 3) m of shapes q (n, nv)."""
    for i in range(q.shape[0]):
        update_kinematics(system, q[i])
        copy_markers(system.chain, markers[i])


@jit_inline
def record_sample(trial, i, result):
    """Store the present equilibrium as the result of sample i."""
    state = trial.state
    assign(result.q[i], state.q)
    copy_markers(trial.system.chain, result.markers[i])
    for t in range(state.T.size):
        result.path[i, t] = state.s[t, 0]
        result.tension[i, t] = state.T[t] / trial.actuation.softness[0]
        result.temperature[i, t] = trial.target.temperature[t]
