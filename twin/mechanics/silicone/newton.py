"""Equilibria of a silicone body by Newton's method, sample after sample.

    f(u) + sum_t T_t pull_t(u) = F,       path_t - free_t - stretch_t T_t <= 0,  T_t >= 0,  one of them zero,

for tendons that motors hold at a length; for the others T_t is given. A tangent, inverted once, serves as long as steps shrink,
from sample to sample. A neighbouring problem's kept inverses serve likewise, at a fraction of the cost of new ones.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg.cython_blas  # noqa: F401  compiled products call it: it must be loaded before its threads are limited

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import assign, jit, jit_inline, jit_internal
from twin.mechanics.silicone.cables import Cables, TendonForces, add_geometric_stiffness, add_sticking_stiffness, trace_tendons
from twin.mechanics.silicone.material.creep import advance_relaxed_stress
from twin.mechanics.silicone.material.law import LEAST_VOLUME_RATIO, Cells, Tangent, forces, stiffness
from twin.mechanics.silicone.skin_loads import ContactSkin, add_wall_force

MOST_NEWTON_STEPS = 60  # a sample
NODE_TOLERANCE = 2e-8  # m, of the last step of a solved shape; tensions are then right to some 1e-6 N
LONGEST_NODE_STEP = 6e-3  # m, of any node in a step
POOR_STEP_SHARE = 0.6  # of the step before; a longer step is a poor one
MOST_POOR_STEPS = 3  # before a new tangent is inverted, which costs fifty steps
LOST_STEP_GROWTH = 5.0  # of the step before; a longer step has diverged
MOST_UPDATES = 16  # Broyden updates of a tangent
UPDATE_RANGE = 0.1  # a step along which the tangent is wrong by more than this factor gives no update
SLACK_GAP = 1e-9  # m, a gap below it counts as none
STALE_AFTER_STEPS = 5  # a tangent to be kept is inverted anew after so many
# Source of the inverse tangent in use: none yet, the state's own, or that of the neighbour's sample, used in place.
NO_TANGENT, OWN_TANGENT, NEIGHBOUR_TANGENT = 0, 1, 2


@by_reference
class BodyArrays(NamedTuple):
    """A body: cells, cables, skin, and the number of clamped nodes."""

    cells: Cells
    cables: Cables
    skin: ContactSkin
    clamped: int


@by_reference
class NewtonProblem(NamedTuple):
    """The samples to be solved."""

    tension: np.ndarray  # (n, t) N, of tendons that are not held
    free_length: np.ndarray  # (n, t) m, of held ones
    held: np.ndarray  # (t,)
    stretch: np.ndarray  # (n, t) m/N
    force: np.ndarray  # (n_free, 3) N
    wall: np.ndarray  # (10,), as in `Loads`
    stiffness_ratio: np.ndarray  # (n,) of the body; tensions, forces and wall count over it
    mu: float
    presliding: float  # m
    time: np.ndarray  # (n,) s
    creep_amplitude: np.ndarray  # (k,)
    creep_time: np.ndarray  # (k,) s
    tolerance: float  # m, of the last step
    single_step: bool  # whether only one step is taken
    keep_tangent: bool  # whether an accurate tangent is wanted at the end


@by_reference
class SoftNeighbour(NamedTuple):
    """A neighbour's shapes (n, nq) m, tensions (n, t) N and inverse tangents (n, nq, nq) m/N; empty where n is 0."""

    u: np.ndarray
    tension: np.ndarray
    inverse: np.ndarray


@by_reference
class SoftResult(NamedTuple):
    """Solutions of the samples.

    u (n, nq) m, tensions (n, t) N, path lengths (n, t) m, and inverse tangents if they are to be kept. Samples solved with the
    neighbour's inverse are `borrowed` (n,); theirs is not filled.
    """

    u: np.ndarray
    tension: np.ndarray
    path: np.ndarray
    inverse: np.ndarray
    borrowed: np.ndarray


@by_reference
class SoftState(NamedTuple):
    """State of the body."""

    u: np.ndarray  # (nq,) m
    tension: np.ndarray  # (t,) N over the stiffness ratio
    slip: np.ndarray  # (t, p - 2) slip states
    distal: np.ndarray  # (t, p - 2) m, lengths distal of each inner point
    relaxed: np.ndarray  # (k, c, q, 6) Pa, relaxed stress
    inverse: np.ndarray  # (nq, nq) m/N, of a tangent near the state
    source: np.ndarray  # (1,) of the inverse tangent in use


@by_reference
class WorkArrays(NamedTuple):
    """Work arrays of a solve."""

    f: np.ndarray  # (nq,) N
    pressure: np.ndarray  # (c, 4) Pa
    all_nodes: np.ndarray  # (n_node, 3) m, displacements
    tangent: Tangent
    tendons: TendonForces
    tension_response: np.ndarray  # (t, nq) m/N, of the nodes to each tendon's pull
    relaxed: np.ndarray  # (c, q, 6) Pa, or (0, 0, 6)
    pressures_predicted: np.ndarray  # (1,) whether the tangent's pressures are predicted ones
    update_along: np.ndarray  # (MOST_UPDATES, nq) of the inverse tangent, B <- (1 + add along') B
    update_add: np.ndarray  # (MOST_UPDATES, nq)


@jit_internal
def apply_update(moved, s, g):
    """Replace moved by moved + g (s' moved), in place."""
    nq, m = moved.shape
    for c in range(m):
        share = 0.0
        for a in range(nq):
            share += s[a] * moved[a, c]
        for a in range(nq):
            moved[a, c] += g[a] * share


@jit_inline
def apply_updates(moved, work, n_update, learns, step):
    """Apply the Broyden updates (good Broyden) to columns `moved` (nq, m), and add one if `learns`. Return their number."""
    for k in range(n_update):
        apply_update(moved, work.update_along[k], work.update_add[k])
    if not learns or n_update == MOST_UPDATES:
        return n_update
    s, g = work.update_along[n_update], work.update_add[n_update]
    assign(s, step)
    assign(g, moved[:, 0])  # step, and what the same tangent makes of the residual that it left
    size, bent = np.dot(s, s), np.dot(s, s) - np.dot(s, g)
    if not UPDATE_RANGE * size < bent < size / UPDATE_RANGE:
        return n_update
    g /= bent
    apply_update(moved, s, g)
    return n_update + 1


@jit_inline
def keep_updates(inverse, work, n_update):
    """Apply the updates to the inverse tangent itself."""
    for k in range(n_update):
        row = np.dot(work.update_along[k].astype(np.float32), inverse)
        for a in range(row.size):
            inverse[a] += np.float32(work.update_add[k, a]) * row


@jit_inline
def node_residual(body, problem, i, state, work):
    """Fill work.f with the residual forces. Return False where a cell is inverted."""
    u = state.u.reshape(-1, 3)
    work.all_nodes[body.clamped :] = u
    if forces(work.all_nodes, body.cells, work.relaxed, work.f, work.pressure) < LEAST_VOLUME_RATIO:
        return False
    trace_tendons(body.cables, u, state.slip, state.distal, problem.mu, problem.presliding, work.tendons)
    work.f[:] -= problem.force.ravel() / problem.stiffness_ratio[i]
    if problem.wall[4] > 0.0:
        add_wall_force(body.skin, u, problem.wall, problem.stiffness_ratio[i], work.f, work.tangent.K, False)
    for t in range(state.tension.size):
        work.f[:] += state.tension[t] * work.tendons.pull[t]
    return True


@jit_internal
def invert_tangent(body, problem, i, state, work):
    """Invert the tangent at the state's shape, after `node_residual` there. Return False where it has no inverse."""
    K, tangent = work.tangent.K, work.tangent
    if state.source[0] != NO_TANGENT or not work.pressures_predicted[0]:
        tangent.pressure[:] = work.pressure
    if stiffness(work.all_nodes, body.cells, work.relaxed, tangent) < LEAST_VOLUME_RATIO:
        return False
    add_geometric_stiffness(body.cables, state.tension, work.tendons, K)
    if problem.mu > 0.0:
        add_sticking_stiffness(body.cables, state.tension, work.tendons, problem.mu, problem.presliding, K)
    if problem.wall[4] > 0.0:
        add_wall_force(body.skin, state.u.reshape(-1, 3), problem.wall, problem.stiffness_ratio[i], work.f, K, True)
    if not np.isfinite(K.sum()):
        return False
    state.inverse[:] = np.linalg.inv(K).astype(np.float32)
    state.source[0], work.pressures_predicted[0] = OWN_TANGENT, True
    return True


class InverseTangent(NamedTuple):
    """The inverse tangent of a step (nq, nq) m/N, the number of its updates, and whether the last step gives one more."""

    matrix: np.ndarray
    n_update: int
    learns: bool


class TautTendons(NamedTuple):
    """The linear problem's tendons: gaps (t,) m, which are taut, and which were so at any time (t,)."""

    gap: np.ndarray
    taut: np.ndarray
    was_taut: np.ndarray


@jit_inline
def tension_changes(problem, i, state, work, changes, dT):
    """Fill dT (t,) that closes the gaps of the taut tendons and releases those that were taut."""
    tendons, T, response = work.tendons, state.tension, work.tension_response
    gap, taut, was_taut = changes.gap, changes.taut, changes.was_taut
    on = np.flatnonzero(taut)
    for t in range(T.size):
        dT[t] = -T[t] if was_taut[t] else 0.0
    if on.size == 0:
        return
    C, b = np.empty((on.size, on.size)), np.empty(on.size)
    for k in range(on.size):
        t = on[k]
        b[k] = gap[t]
        for s in range(T.size):
            if was_taut[s] and not taut[s]:
                b[k] -= np.dot(tendons.gradient[t], response[s]) * dT[s]
        for m in range(on.size):
            C[k, m] = np.dot(tendons.gradient[t], response[on[m]]) + (problem.stretch[i, t] if k == m else 0.0)
    x = np.linalg.solve(C, b)
    for k in range(on.size):
        dT[on[k]] = x[k]


@jit_inline
def linear_step(problem, i, state, work, inverse, du, dT):
    """Solve the linear problem: changes of nodes du (nq,) and tensions dT (t,). Tendons may become slack or taut.

    On entry du is the last step, for a further update. Returns the number of updates.
    """
    tendons, T, response, nt = work.tendons, state.tension, work.tension_response, state.tension.size
    push = np.zeros((du.size, 1 + nt), np.float32)
    push[:, 0] = -work.f
    for t in range(nt):
        if problem.held[t]:
            push[:, 1 + t] = tendons.pull[t]
    moved = np.dot(inverse.matrix, push)
    n_update = apply_updates(moved, work, inverse.n_update, inverse.learns, du)
    assign(du, moved[:, 0])
    changes = TautTendons(np.empty(nt), np.zeros(nt, np.bool_), np.zeros(nt, np.bool_))
    gap, taut, was_taut = changes.gap, changes.taut, changes.was_taut
    for t in range(nt):
        assign(response[t], moved[:, 1 + t])
        if problem.held[t]:
            gap[t] = tendons.path[t] - problem.free_length[i, t] - problem.stretch[i, t] * T[t] + np.dot(tendons.gradient[t], du)
            taut[t] = T[t] > 0.0 or gap[t] > 0.0
            was_taut[t] = taut[t]
    for _ in range(4 * nt):
        tension_changes(problem, i, state, work, changes, dT)
        changed = False
        for t in range(nt):
            if taut[t]:
                if T[t] + dT[t] < 0.0:
                    taut[t], changed = False, True
            elif problem.held[t]:
                left = gap[t]
                for s in range(nt):
                    if was_taut[s]:
                        left -= np.dot(tendons.gradient[t], response[s]) * dT[s]
                if left > SLACK_GAP:
                    taut[t], was_taut[t], changed = True, True, True
        if not changed:
            break
    for t in range(nt):
        if was_taut[t]:
            du -= dT[t] * response[t]
    return n_update


@jit_inline
def predict_pressures(body, du, work):
    """Predict the pressures after a step du (nq,), for the next tangent, which then needs fewer steps."""
    unknowns, tangent = body.cells.unknowns, work.tangent
    for e in range(unknowns.shape[0]):
        for k in range(4):
            tangent.pressure[e, k] = work.pressure[e, k]
            for a in range(81):
                if unknowns[e, a] >= 0:
                    tangent.pressure[e, k] += tangent.pressure_response[e, k, a] * du[unknowns[e, a]]


@jit_inline
def commit_slip(body, problem, state, work):
    """Commit slip and distal lengths at the present state."""
    trace_tendons(body.cables, state.u.reshape(-1, 3), state.slip, state.distal, problem.mu, problem.presliding, work.tendons)
    state.slip[:] = work.tendons.slip
    state.distal[:] = work.tendons.distal


@jit_inline
def solve_sample(body, problem, i, state, work, near):
    """Bring `state` to equilibrium at sample i. Return the number of steps; 0, and the state as it was, on failure.

    `near` (nq, nq) m/N is a neighbour's inverse tangent.
    """
    u, T, last, fresh, fails = state.u.copy(), state.tension.copy(), 1e9, False, 0
    if work.relaxed.shape[0] > 0:
        work.relaxed[:] = state.relaxed.sum(axis=0)
    for t in range(T.size):
        if not problem.held[t]:
            state.tension[t] = problem.tension[i, t] / problem.stiffness_ratio[i]
    du, dT = np.zeros(u.size), np.empty(T.size)
    n_update, poor = 0, 0
    for step in range(MOST_NEWTON_STEPS):
        if not node_residual(body, problem, i, state, work):
            break
        if not (state.source[0] != NO_TANGENT or invert_tangent(body, problem, i, state, work)):
            break
        matrix = near if state.source[0] == NEIGHBOUR_TANGENT else state.inverse
        n_update = linear_step(problem, i, state, work, InverseTangent(matrix, n_update, last < 1e9), du, dT)
        length = np.abs(du).max()
        poor += not (length < POOR_STEP_SHARE * last or fresh)
        if not ((poor <= MOST_POOR_STEPS and length < LOST_STEP_GROWTH * last) or fresh or problem.single_step):
            state.source[0] = NO_TANGENT
            fails += 1
            if fails > MOST_NEWTON_STEPS // 4 or not np.isfinite(length):
                break
            last, fresh, n_update, poor = 1e9, True, 0, 0  # the next turn inverts a new tangent here
            continue
        share = min(1.0, LONGEST_NODE_STEP / max(length, 1e-12))
        predict_pressures(body, share * du, work)
        state.u[:] += share * du
        for t in range(T.size):
            if problem.held[t]:
                state.tension[t] = max(0.0, state.tension[t] + share * dT[t])
        if problem.single_step or length < problem.tolerance:
            commit_slip(body, problem, state, work)
            if problem.keep_tangent and step >= STALE_AFTER_STEPS:
                invert_tangent(body, problem, i, state, work)
            elif state.source[0] == OWN_TANGENT and not problem.keep_tangent:
                keep_updates(state.inverse, work, n_update)
            return step + 1
        if share < 1.0:
            state.source[0], n_update = NO_TANGENT, 0
        last, fresh = length if share == 1.0 else 1e9, False
    assign(state.u, u)
    assign(state.tension, T)
    state.source[0] = NO_TANGENT
    return 0


@jit
def solve_samples(body, problem, neighbour, i, state, result, work):
    """Solve samples from i on until one fails: fill `result`, advance `state`. Return the first sample not found, n if all were."""
    n, near = problem.time.size, state.inverse
    while i < n:
        if neighbour.u.shape[0] > 0:
            assign(state.u, neighbour.u[i])
            state.tension[:] = neighbour.tension[i] / problem.stiffness_ratio[i]
            near = neighbour.inverse[i]
            state.source[0], work.pressures_predicted[0] = NEIGHBOUR_TANGENT, False
        steps = solve_sample(body, problem, i, state, work, near)
        if steps == 0:
            return i
        if result.inverse.shape[0] > 0:
            result.borrowed[i] = state.source[0] == NEIGHBOUR_TANGENT
            if not result.borrowed[i]:
                result.inverse[i] = state.inverse
        assign(result.u[i], state.u)
        assign(result.path[i], work.tendons.path)
        result.tension[i] = state.tension * problem.stiffness_ratio[i]
        if state.relaxed.shape[0] > 0 and i + 1 < n:
            work.all_nodes[body.clamped :] = state.u.reshape(-1, 3)
            amplitude, dt = problem.creep_amplitude, problem.time[i + 1] - problem.time[i]
            advance_relaxed_stress(work.all_nodes, body.cells, amplitude, problem.creep_time, dt, state.relaxed)
        i += 1
    return n
