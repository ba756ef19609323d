"""Tensions that hold given tendon lengths, where motors command displacements. A tendon pulls or is slack; only a rod pushes.

For each such tendon   T >= 0,   gap <= 0,   T gap = 0,   and of rods   gap = 0,   with gap its excess length over that of its
motor or spring (tendon_actuation.py).

Newton's method solves shape and tensions at once: dpath_i/dT_j = -A_i J^-1 B_j with A_i = dpath_i/dq, B_j = dr/dT_j and J the
tangent of the force balance. Which tendons are taut is found on the linear problem.
"""

from typing import NamedTuple

import numpy as np

from twin.effects.tendon_friction import rounded_turn_angle
from twin.foundation.by_reference import by_reference, refer_to
from twin.foundation.compiled import assign, dot, jit, jit_internal
from twin.mechanics.rod.balance.chain import commit_slip, copy_state, force_balance, friction_of, point_velocity
from twin.mechanics.rod.balance.elastic import add_arc_gradients
from twin.mechanics.rod.balance.linear import dot_n, factorise, substitute
from twin.mechanics.rod.balance.newton import (
    CHORD_CONTRACTION,
    LONGEST_HINGE_STEP,
    RESIDUAL_GROWTH,
    advance_slip,
    step_fraction,
    update_kinematics,
)
from twin.mechanics.rod.balance.tendon_actuation import (
    LENGTH_STIFFNESS,
    STALL_COMPLIANCE,
    backlash_at,
    length_gap,
    linearise_tendons,
    tendon_compliance,
)

GAP_PER_ANGLE = 0.2  # m/rad; a gap below this times the solver's tolerance counts as none (2e-8 m: some 1e-5 N)
MOST_HELD_STEPS = 40
MOST_PIECES_TRIED = 8  # of the springs' force laws in a first-order step, which else ends on the last one
SAME_STRETCH_SHARE = 1e-3  # of a compliance; pieces of a spring's force law differ by more
SMALLEST_LENGTH_PART = 1e-3  # of a move to the target
LENGTH_PART_NEAR_POST = 2e-4  # m; near a post, which may catch the robot, parts are so small that the tip moves by some 3 mm


@jit_internal
def chord_gradients(system, tension, z, path_gradient, pull):
    """Fill dpath/dq and dr/dT, (n_tendon, nv) each, at the geometry in MuJoCo's data, tensions (N) and committed slip states z."""
    chain, law = system.chain, system.law
    for t in range(chain.hole.shape[0]):
        nd = chain.n_piece[t]
        wrapped, share, mu = 0.0, 1.0, friction_of(law, tension[t])
        before = (0.0, 0.0, 0.0)
        for d in range(nd):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            length = np.sqrt(dot(v, v))
            u = (v[0] / length, v[1] / length, v[2] / length)
            if d > 0 and law.mu > 0.0:
                wrapped += z[t, d] * rounded_turn_angle(np.arccos(min(1.0, dot(before, u))))[0]
                share = np.exp(-mu * wrapped)
            before = u
            for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
                path_gradient[t, i] = dot(u, point_velocity(chain, i, b))
                pull[t, i] = share * path_gradient[t, i]
        for i in range(chain.first_joint[nd], path_gradient.shape[1]):
            path_gradient[t, i] = pull[t, i] = 0.0


@jit_internal
def tension_gradients(system, tension, z, path_gradient, pull):
    """Fill the gradients as `chord_gradients`, with rods' arcs."""
    chord_gradients(system, tension, z, path_gradient, pull)
    add_arc_gradients(system.chain.arc, system.chain, path_gradient, pull)


@jit_internal
def solve_taut_set(C, gap, T, by_length, pushes, dT):
    """Solve C dT = gap for the tendons that end up taut. T + dT = 0 for those that end up slack, 0 where the tension is given.

    Returns False where the matrix of a taut set has no factors.
    """
    nt = T.size
    taut, M = np.empty(nt, np.bool_), np.empty((nt, nt))
    for t in range(nt):
        taut[t] = by_length[t] and (T[t] > 0.0 or gap[t] > 0.0 or pushes)
    for _ in range(2 * nt + 2):
        for i in range(nt):
            dT[i] = gap[i] if taut[i] else (-T[i] if by_length[i] else 0.0)
            for j in range(nt):
                M[i, j] = C[i, j] if taut[i] else 0.0
            if not taut[i]:
                M[i, i] = 1.0
        if not factorise(M):
            return False
        substitute(M, dT)
        worst, change = 1e-12, -1
        for i in range(nt):
            if not by_length[i] or pushes:
                continue
            if taut[i]:
                violation = -(T[i] + dT[i])  # pushes
            else:
                violation = gap[i]  # still too long
                for j in range(nt):
                    violation -= C[i, j] * dT[j]
                violation /= C[i, i]
            if violation > worst:
                worst, change = violation, i
        if change < 0:
            return True
        taut[change] = not taut[change]
    return True


@jit_internal
def held_tangent(system, state, by_length, pushes, LU, held_tendons, tension_response):
    """Factorise P = J + LENGTH_STIFFNESS sum B_i A_i', the sum over the taut tendons of `by_length`. Return whether P is positive.

    Fills LU with the factors, `held_tendons` (n_tendon,) with the taut tendons, and `tension_response` (n_tendon, nv) rad/N with
    P^-1 B. J alone need not be positive: a shape that is unstable under constant tension may be held by the lengths.
    """
    nt, nv = state.T.size, state.q.size
    r, A, B = np.empty(nv), np.empty((nt, nv)), tension_response
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    update_kinematics(system, state.q)
    force_balance(system, state, z, s, r, LU)
    tension_gradients(system, state.T, z, A, B)
    for t in range(nt):
        held_tendons[t] = by_length[t] and (state.T[t] > 0.0 or pushes)
        if held_tendons[t]:
            for i in range(nv):
                for j in range(nv):
                    LU[i, j] += LENGTH_STIFFNESS * B[t, i] * A[t, j]
    if not factorise(LU):
        return False
    for t in range(nt):
        substitute(LU, B[t])
    return True


@by_reference
class HeldTarget(NamedTuple):
    """Target of a move with held tendons, and the shape that it starts from."""

    start: np.ndarray  # (nv,) rad, shape at the start of the move
    free_length: np.ndarray  # (n_tendon,) m, of motors
    temperature: np.ndarray  # (n_tendon,) K, of springs


@jit
def reach_target(system, state, factors, actuation, target, tol, in_parts):
    """Find the equilibrium, and all tensions, with the tendons that motors and springs hold at the target.

    If the guess state.q does not lead there, the move is made from the shape `target.start`, which was at the actuation's free
    lengths and temperatures, in ever smaller parts; with `in_parts` at once in parts of `LENGTH_PART_NEAR_POST`. The actuation's
    free lengths and temperatures follow.

    Returns 1, 2 where parts were needed, 0 where no tensions were found. Commits the slip; with parts, after each. The springs'
    history is left to `commit_springs`.
    """
    T, usable = state.T, factors.usable
    q0, T0, T1 = target.start.copy(), T.copy(), T.copy()
    origin = refer_to(HeldTarget(target.start, actuation.free_length.copy(), actuation.temperature.copy()))
    for t in range(T.size):
        if actuation.by_spring[t]:  # its tension at the start; T may be a guess
            T0[t] = actuation.softness[0] * actuation.tension[t]
    interpolate_target(actuation, origin, target, 1.0)
    if not in_parts and solve_held(system, state, factors, actuation, tol) == 1:
        return 1
    longest = 0.0
    for t in range(T.size):
        by_motor = actuation.held[t] and not actuation.by_spring[t]
        longest = max(longest, abs(actuation.free_length[t] - origin.free_length[t]) if by_motor else 0.0)
    whole = min(1.0, LENGTH_PART_NEAR_POST / longest) if in_parts and longest > 0.0 else 1.0
    done, part = 0.0, whole
    while done < 1.0:
        interpolate_target(actuation, origin, target, done + part)
        assign(T, T0)
        assign(state.q, q0)
        usable[0] = False
        if solve_held(system, state, factors, actuation, tol) == 1:
            done += part
            part = min(2.0 * part, whole, 1.0 - done)
            assign(q0, state.q)
            assign(T0, T)
        else:
            part *= 0.5
            if part < SMALLEST_LENGTH_PART:
                interpolate_target(actuation, origin, target, 1.0)
                assign(T, T1)
                return 0
    return 1 if in_parts else 2


@jit_internal
def interpolate_target(actuation, origin, target, share):
    """Set the actuation's free lengths and temperatures a share of the way from `origin` to `target`."""
    for t in range(target.free_length.size):
        if not actuation.by_spring[t]:
            actuation.free_length[t] = origin.free_length[t] + share * (target.free_length[t] - origin.free_length[t])
        actuation.temperature[t] = origin.temperature[t] + share * (target.temperature[t] - origin.temperature[t])


@jit_internal
def coupled_step(system, state, factors, actuation, z, s, r):
    """Take one Newton step on shape and tensions together, with the factors of `held_tangent` and the balance's (z, s, r).

    Returns the largest change of a hinge (rad), negative where the lengths have no solution.
    """
    A, B = np.empty(factors.tension_response.shape), np.empty(factors.tension_response.shape)
    tension_gradients(system, state.T, z, A, B)
    substitute(factors.LU, r)
    return apply_coupled_step(system, state, factors, actuation, A, s, r)


@jit_internal
def apply_coupled_step(system, state, factors, actuation, A, s, turn):
    """Take the step of `coupled_step` from turn (nv,) = P^-1 r and the path gradient A (n_tendon, nv).

    Neither depends on the piece of its force law that a spring is on.
    """
    tension, q, held_tendons, tension_response = state.T, state.q, factors.held_tendons, factors.tension_response
    nt, nv = tension.size, q.size
    C, gap, dT, turn, D = np.empty((nt, nt)), np.empty(nt), np.empty(nt), turn.copy(), tension_response.copy()
    for t in range(nt):
        gap[t] = length_gap(actuation, t, s[t, 0], tension)
        if held_tendons[t]:
            for i in range(nv):
                turn[i] += LENGTH_STIFFNESS * gap[t] * tension_response[t, i]
    for t in range(nt):
        gap[t] -= dot_n(A[t], turn)
    for j in range(nt):
        for i in range(nt):
            if held_tendons[i]:
                share = LENGTH_STIFFNESS * tendon_compliance(actuation, i, j)
                for k in range(nv):
                    D[j, k] -= share * tension_response[i, k]
        for i in range(nt):
            C[i, j] = dot_n(A[i], D[j]) + tendon_compliance(actuation, i, j)
    if not solve_taut_set(C, gap, tension, actuation.held, actuation.pushes, dT):
        return -1.0
    longest = 0.0
    for i in range(nv):
        step = turn[i]
        for t in range(nt):
            step += dT[t] * D[t, i]
        q[i] -= step
        longest = max(longest, abs(step) / system.chain.unit[i])
    for t in range(nt):
        tension[t] += dT[t]
        if not actuation.pushes:
            tension[t] = max(0.0, tension[t])
    return longest


@jit_internal
def coupled_residual(system, state, actuation, s, r):
    """Return the residual (rad) of shape and lengths. The springs' force laws are linearised here."""
    size = 0.0
    for i in range(r.size):
        size = max(size, abs(r[i] / system.chain.stiffness[i]) / system.chain.unit[i])
    linearise_tendons(actuation, s, state.T)
    for t in range(state.T.size):
        if actuation.held[t]:
            gap = length_gap(actuation, t, s[t, 0], state.T)
            if actuation.stretch[t] >= STALL_COMPLIANCE / actuation.softness[0]:
                # (T_s - T) / LENGTH_STIFFNESS, as large as on the other piece where they meet
                gap /= STALL_COMPLIANCE * LENGTH_STIFFNESS
            elif actuation.by_spring[t]:  # (Y - T) / slope, on either side of an end of the backlash
                gap *= backlash_at(actuation, t, s[t, 0])[1]
            size = max(size, (abs(gap) if state.T[t] > 0.0 or actuation.pushes else gap) / GAP_PER_ANGLE)
    return size


@jit_internal
def interpolate_state(state, start, end, share):
    """Set shape and tensions a share of the way from start to end."""
    for i in range(state.q.size):
        state.q[i] = start.q[i] + share * (end.q[i] - start.q[i])
    for t in range(state.T.size):
        state.T[t] = start.T[t] + share * (end.T[t] - start.T[t])


@jit_internal
def solve_held(system, state, factors, actuation, tol):
    """Solve shape and tensions by Newton's method, with the chord LU while it contracts. A step after which the residual grows is
    halved.

    Returns 1 and commits the slip, or 0.
    """
    r, none, usable = np.empty(state.q.size), np.empty((0, 0)), factors.usable
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    start, end = copy_state(state), copy_state(state)
    before, step, chord = 1e300, 1.0, True
    for _ in range(MOST_HELD_STEPS):
        update_kinematics(system, state.q)
        force_balance(system, state, z, s, r, none)
        size = coupled_residual(system, state, actuation, s, r)
        if size < tol:
            commit_slip(state, z, s)
            return 1
        if not size < RESIDUAL_GROWTH * before:
            if chord and usable[0]:  # the old tangent may be the cause: retry from the last shape with a new one
                step = 1.0
                interpolate_state(state, start, start, 0.0)
                usable[0], before = False, 1e300
                continue
            step *= 0.5
            if step < SMALLEST_LENGTH_PART:
                return 0
            interpolate_state(state, start, end, step)
            continue
        chord = usable[0] and size <= CHORD_CONTRACTION * before
        if not chord:
            held, response = actuation.held, factors.tension_response
            usable[0] = held_tangent(system, state, held, actuation.pushes, factors.LU, factors.held_tendons, response)
            if not usable[0]:
                return 0
        before, step = size, 1.0
        assign(start.q, state.q)
        assign(start.T, state.T)
        longest = coupled_step(system, state, factors, actuation, z, s, r)
        if longest < 0.0:
            return 0
        assign(end.q, state.q)
        assign(end.T, state.T)
        for i in range(r.size):
            r[i] = end.q[i] - start.q[i]
        step = step_fraction(system, r, longest)
        if step < 1.0:
            interpolate_state(state, start, end, step)
    return 0


@jit_internal
def single_held_step(system, state, factors, actuation):
    """Take one Newton step on shape and tensions from a neighbouring solution, whose tangent and response are in `factors`.

    Each spring ends on the piece of its force law where the step ends, which may differ from the neighbour's, since its history
    differs. Returns 1 and commits the slip, or 0 where the step is too long.

    The path of a taut spring is the step's own, to first order like its tension. Its force law goes on from there: the curvature of
    the exact path, added at every sample, would accumulate.
    """
    r, none, response = np.empty(state.q.size), np.empty((0, 0)), factors.tension_response
    A, B = np.empty(response.shape), np.empty(response.shape)
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    update_kinematics(system, state.q)
    bowing = force_balance(system, state, z, s, r, none)
    tension_gradients(system, state.T, z, A, B)
    substitute(factors.LU, r)
    q0, T0, own = state.q.copy(), state.T.copy(), s.copy()
    linearise_tendons(actuation, s, state.T)
    for _ in range(MOST_PIECES_TRIED):
        assign(state.q, q0)
        assign(state.T, T0)
        longest = apply_coupled_step(system, state, factors, actuation, A, s, r)
        if not 0.0 <= longest < LONGEST_HINGE_STEP:
            return 0
        if not changes_piece(actuation, state.T, own):
            break
    update_kinematics(system, state.q)
    advance_slip(system, state, bowing)
    for t in range(state.T.size):
        if actuation.by_spring[t] and state.T[t] > 0.0:
            state.s[t, 0] = own[t, 0]
    return 1


@jit_internal
def changes_piece(actuation, tension, s):
    """Return whether a taut spring is on another piece at the path that its linear piece gives for its tension.

    Fills s[t, 0] with these paths, and linearises the springs there.
    """
    was, other = actuation.stretch.copy(), False
    for t in range(tension.size):
        if actuation.by_spring[t] and tension[t] > 0.0:
            s[t, 0] = actuation.free_length[t] + actuation.bedding_offset[t] + actuation.stretch[t] * tension[t]
    linearise_tendons(actuation, s, tension)
    for t in range(tension.size):
        if actuation.by_spring[t] and tension[t] > 0.0:
            other = other or abs(actuation.stretch[t] - was[t]) > SAME_STRETCH_SHARE * was[t]
    return other


@jit_internal
def commit_present_slip(system, state):
    """Commit the slip of the state's present shape and tensions."""
    r, none = np.empty(state.q.size), np.empty((0, 0))
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    update_kinematics(system, state.q)
    force_balance(system, state, z, s, r, none)
    commit_slip(state, z, s)
