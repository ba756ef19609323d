"""Moves from one equilibrium to another, with the friction met on the way, and searches for tensions that bring the tip to a point.

Tensions change together along a straight line from the present to the wanted ones. A robot's state is (T, q, z, s): base tensions,
hinge angles, slip states and distal tendon lengths.
"""

from typing import NamedTuple

import numpy as np

from twin.foundation.compiled import assign, jit, jit_inline, jit_internal
from twin.mechanics.rod.balance.chain import commit_slip, copy_state, point_velocity, set_state
from twin.mechanics.rod.balance.lengths import tension_gradients
from twin.mechanics.rod.balance.linear import substitute
from twin.mechanics.rod.balance.newton import is_minimum, no_flow, solve_near, solve_newton, update_kinematics

TENSION_PART = 0.75  # N; 0.02 instead moves the tip by some 0.1 mm at most (tests/prediction/test_kinematics.py)
TENSION_PART_NEAR_POST = 0.1  # N; near a post, which may catch the robot, the tip then moves by some 3 mm a part
SMALLEST_TENSION_PART = 1.0 / 16.0  # of a part; below it the robot snaps to another equilibrium
SEARCH_STEPS = 25  # Gauss-Newton steps of `seek_tensions`
REFINEMENT_STEPS = 12  # of `refine_tensions`
GAUSS_NEWTON_DAMPING = 1e-3  # m/N, for directions in which tendons pull against each other and the tip hardly moves
STALLED_ERROR_SHARE = 0.9  # of the error; two steps in turn that leave more have found the nearest point


class TipTarget(NamedTuple):
    """The point that the tip should reach, and the tensions allowed."""

    tip: np.ndarray  # (3,) m
    used: np.ndarray  # (n_tendon,) whether a tendon may pull more than `least`
    least: np.ndarray  # (n_tendon,) N
    limit: float  # N
    tolerance: float  # m, distance at which the search stops


@jit
def move_to_tensions(system, state, factors, goal, stride, tol):
    """Advance the state to tensions `goal` (n_tendon,) N in parts of at most `stride` N. Return 0 where lost, else 1."""
    T, q, longest = state.T, state.q, 0.0
    nt = T.size
    start, before, last = T.copy(), q.copy(), q.copy()
    for t in range(nt):
        longest = max(longest, abs(goal[t] - T[t]))
    whole = min(1.0, stride / longest) if longest > 0.0 else 1.0
    done, part, parted = 0.0, whole, 0.0
    while True:
        for t in range(nt):
            T[t] = start[t] + (goal[t] - start[t]) * (done + part)
        for i in range(q.size):
            last[i] = q[i]
            q[i] += parted * (q[i] - before[i])  # `parted` is this part over the one before
        if solve_newton(system, state, factors, no_flow(last), tol) <= 0:
            # With short pre-sliding friction has kinks, where Newton may fail: a shorter part passes fewer of them.
            assign(q, last)
            factors.usable[0] = False
            if part > SMALLEST_TENSION_PART * whole:
                part, parted = 0.5 * part, 0.5 * parted
                continue
            if solve_near(system, state, factors, tol) == 0:
                return 0
        assign(before, last)
        done += part
        if done > 1.0 - 1e-12:
            return 1
        longer = min(whole, 2.0 * part, 1.0 - done)
        part, parted = longer, longer / part


@jit_inline
def next_equilibrium(system, state, factors, T0, q0, tol, in_parts):
    """Find the equilibrium at the state's tensions from its guess q; where Newton fails, or `in_parts`, move from (T0, q0) in
    parts.

    Short pre-sliding and large steps between samples may defeat Newton, and a robot released to move by itself may end elsewhere
    than one that is pulled. Returns 1, 2 where it was moved in parts after a failure, 0 where lost.
    """
    if not in_parts and solve_newton(system, state, factors, no_flow(q0), tol) > 0:
        return 1
    wanted = copy_state(state)
    assign(state.T, T0)
    assign(state.q, q0)
    factors.usable[0] = False
    if move_to_tensions(system, state, factors, wanted.T, TENSION_PART_NEAR_POST if in_parts else TENSION_PART, tol) == 1:
        return 1 if in_parts else 2
    set_state(state, wanted)  # it snaps to another equilibrium on the way
    assign(state.q, q0)
    factors.usable[0] = False
    return solve_near(system, state, factors, tol)


@jit
def site_gradient(system, state, LU, site, below, gradient):
    """Fill dx/dT (n_tendon, n_site, 3) m/N of the sites, each moved by the `below` (n_site,) first hinges, at an equilibrium.

    dq/dT_t = -J^-1 dr/dT_t; LU (nv, nv) then holds the factors of J. Returns False where the shape is unstable.
    """
    nt, nv = state.T.size, state.q.size
    A, B = np.empty((nt, nv)), np.empty((nt, nv))
    if not is_minimum(system, state, LU):
        return False
    tension_gradients(system, state.T, state.z, A, B)
    for t in range(nt):
        substitute(LU, B[t])
        for k in range(site.size):
            x = system.chain.site[site[k]]
            for a in range(3):
                gradient[t, k, a] = 0.0
            for i in range(below[k]):
                v = point_velocity(system.chain, i, x)
                for a in range(3):
                    gradient[t, k, a] -= v[a] * B[t, i]
    return True


@jit_inline
def tip_error(system, q, target, error):
    """Fill the vector from the tip at q to the target, error (3,) m. Return its length."""
    update_kinematics(system, q)
    tip = system.chain.site[system.chain.disk[-1]]
    for a in range(3):
        error[a] = target[a] - tip[a]
    return np.sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2])


@jit_inline
def bounded_tension(target, T, dT, share, t):
    """Return the tension of tendon t after a share of its step, within the allowed range."""
    return min(target.limit, max(target.least[t], T[t] + share * dT[t]))


@jit
def seek_tensions(system, target, start, state, factors, tol):
    """Find the tensions that bring the tip nearest to the target when applied at once from `start`.

    `state` holds a first guess of T and q, then the result. Returns the distance (m), negative where lost. The method is bounded,
    damped Gauss-Newton; a step that increases the distance is halved.
    """
    T, q, nt = state.T, state.q, state.T.size
    gradient, error, dT = np.empty((nt, 1, 3)), np.empty(3), np.zeros(nt)
    site, below, free = system.chain.disk[-1:], np.full(1, q.size), np.empty(nt, np.bool_)
    found = copy_state(state)
    best, fraction, slow = 1e300, 1.0, 0
    factors.usable[0] = False
    for _ in range(SEARCH_STEPS):
        commit_slip(state, start.z, start.s)
        solved = solve_near(system, state, factors, tol)
        size = tip_error(system, q, target.tip, error)
        if solved == 0 or size > best:
            fraction *= 0.5
            if fraction < 1e-3:
                break
            for t in range(nt):
                T[t] = bounded_tension(target, found.T, dT, fraction, t)
            assign(q, found.q)
            factors.usable[0] = False
            continue
        slow = slow + 1 if size > STALLED_ERROR_SHARE * best else 0
        best, fraction = size, 1.0
        assign(found.T, T)
        assign(found.q, q)
        if size < target.tolerance or slow > 1 or not site_gradient(system, state, factors.LU, site, below, gradient):
            break
        factors.usable[0] = True
        assign(free, target.used)
        gauss_newton_step(gradient[:, 0], error, T, target, free, dT)
        moved = 0.0
        for t in range(nt):
            new = bounded_tension(target, T, dT, 1.0, t)
            moved = max(moved, abs(new - T[t]))
            T[t] = new
        if moved < 1e-7:
            break
    assign(T, found.T)
    assign(q, found.q)
    return best if best < 1e299 else -1.0


@jit_internal
def gauss_newton_step(gradient, error, T, target, free, dT):
    """Compute the Gauss-Newton step dT of the free tendons.

    Tendons whose step would leave the allowed range from its end are fixed.
    """
    nt = T.size
    for _ in range(nt + 1):
        A = np.zeros((nt, nt))
        for i in range(nt):
            dT[i] = 0.0
            if not free[i]:
                A[i, i] = 1.0
                continue
            for a in range(3):
                dT[i] += gradient[i, a] * error[a]
            A[i, i] = GAUSS_NEWTON_DAMPING**2
            for j in range(nt):
                if free[j]:
                    for a in range(3):
                        A[i, j] += gradient[i, a] * gradient[j, a]
        dT[:] = np.linalg.solve(A, dT)
        held = False
        for i in range(nt):
            if free[i] and ((T[i] <= target.least[i] and dT[i] < 0.0) or (T[i] >= target.limit and dT[i] > 0.0)):
                free[i] = False
                held = True
        if not held:
            return


@jit
def refine_tensions(system, target, start, state, factors, tol):
    """Refine the result of `seek_tensions` along the actual path of `move_to_tensions`, whose friction counts.

    `state` becomes the one nearest to the target. Returns the distance (m), negative where lost.
    """
    nt, goal = state.T.size, state.T.copy()
    gradient, error, dT = np.empty((nt, 1, 3)), np.empty(3), np.zeros(nt)
    site, below, free = system.chain.disk[-1:], np.full(1, state.q.size), np.empty(nt, np.bool_)
    nearest, best, share = copy_state(state), 1e300, 1.0
    for _ in range(REFINEMENT_STEPS):
        set_state(state, start)
        factors.usable[0] = False
        if move_to_tensions(system, state, factors, goal, TENSION_PART, tol) == 0:
            break
        size = tip_error(system, state.q, target.tip, error)
        if size >= best:
            share *= 0.5
            for t in range(nt):
                goal[t] = bounded_tension(target, nearest.T, dT, share, t)
            continue
        best, share = size, 1.0
        set_state(nearest, state)
        if size < target.tolerance or not site_gradient(system, state, factors.LU, site, below, gradient):
            break
        assign(free, target.used)
        gauss_newton_step(gradient[:, 0], error, state.T, target, free, dT)
        for t in range(nt):
            goal[t] = bounded_tension(target, state.T, dT, 1.0, t)
    set_state(state, nearest)
    return best if best < 1e299 else -1.0
