"""From one equilibrium to another, with the friction met on the way; and how the tip answers to tensions.

Tensions change together along a straight line from those of now to those wanted. A robot's state is (T, q, z, s): base tensions,
hinge angles, slip states and distal tendon lengths.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, inner, jit, part
from twin.equilibrium.chain import become, copied, lever, settle
from twin.equilibrium.lengths import pulls
from twin.equilibrium.linear import substitute
from twin.equilibrium.newton import is_minimum, newton, place, solve, still

STRIDE = 0.75  # N: the largest part; 0.75 against 0.02 moves the tip by some 0.1 mm at most (tests/test_kinematics.py)
WARY = 0.1  # N: the same by a post, where the robot may be caught before it or come to lie behind it; its tip moves by some 3 mm
SHORTEST = 1.0 / 16.0  # of a part: below it the robot is let go where it wants
TRIALS = 25  # Gauss-Newton steps of `seek`
CORRECTIONS = 12  # of its answer, the way there considered
DAMPING = 1e-3  # m/N: of a step, against directions in which all tendons pull against each other and the tip hardly moves
STALLED = 0.9  # of the error: a step that leaves more has found the nearest point, if the one before did too


class Aim(NamedTuple):
    """What the tip should reach, and with which tensions."""

    target: np.ndarray  # (3,) m
    used: np.ndarray  # (n_tendon,) whether a tendon may pull
    least: np.ndarray  # (n_tendon,) N
    limit: float  # N
    near: float  # m: where the search stops


@jit
def pull(at, state, factors, goal, stride, tol):
    """Advance the state to tensions `goal` (n_tendon,) N in parts of at most `stride` N; 0 where lost."""
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
            q[i] += parted * (q[i] - before[i])  # `parted`: this part over the one before
        if newton(at, state, factors, still(last), tol) <= 0:
            # Short pre-sliding makes friction kinked, and Newton lose its way: a shorter part passes fewer kinks.
            assign(q, last)
            factors.fresh[0] = False
            if part > SHORTEST * whole:
                part, parted = 0.5 * part, 0.5 * parted
                continue
            if solve(at, state, factors, tol) == 0:
                return 0
        assign(before, last)
        done += part
        if done > 1.0 - 1e-12:
            return 1
        longer = min(whole, 2.0 * part, 1.0 - done)
        part, parted = longer, longer / part


@part
def onward(at, state, factors, T0, q0, tol, wary):
    """Equilibrium at the state's tensions from its guess q; where Newton does not lead there, or `wary`, from (T0, q0) before by
    `pull`.

    Short pre-sliding and large steps from sample to sample leave Newton no way, and what a robot let go of does on its own is not
    what a pulled one does. Returns 1, 2 where it was pulled, 0 where lost.
    """
    if not wary and newton(at, state, factors, still(q0), tol) > 0:
        return 1
    wanted = copied(state)
    assign(state.T, T0)
    assign(state.q, q0)
    factors.fresh[0] = False
    if pull(at, state, factors, wanted.T, WARY if wary else STRIDE, tol) == 1:
        return 1 if wary else 2
    become(state, wanted)  # it snaps over on the way
    assign(state.q, q0)
    factors.fresh[0] = False
    return solve(at, state, factors, tol)


@jit
def answer(at, state, LU, site, below, gradient):
    """dx/dT (n_tendon, n_site, 3) m/N of the sites, each moved by the `below` (n_site,) first hinges, at an equilibrium.

    dq/dT_t = -J^-1 dr/dT_t; LU (nv, nv) then holds the factors of J. False where the shape is unstable.
    """
    nt, nv = state.T.size, state.q.size
    A, B = np.empty((nt, nv)), np.empty((nt, nv))
    if not is_minimum(at, state, LU):
        return False
    pulls(at, state.z, A, B)
    for t in range(nt):
        substitute(LU, B[t])
        for k in range(site.size):
            x = at.chain.site[site[k]]
            for a in range(3):
                gradient[t, k, a] = 0.0
            for i in range(below[k]):
                v = lever(at.chain, i, x)
                for a in range(3):
                    gradient[t, k, a] -= v[a] * B[t, i]
    return True


@part
def miss(at, q, target, error):
    """From the tip at q to the target: error (3,) m, and its size."""
    place(at, q)
    tip = at.chain.site[at.chain.disk[-1]]
    for a in range(3):
        error[a] = target[a] - tip[a]
    return np.sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2])


@part
def within(aim, T, dT, share, t):
    """The tension of tendon t after a share of its step, in the range allowed."""
    return min(aim.limit, max(aim.least[t], T[t] + share * dT[t]))


@jit
def seek(at, aim, start, state, factors, tol):
    """Tensions whose tip comes nearest to the target when pulled at once from `start`; `state` holds a first guess of T and q, and
    then the answer. Returns the distance (m), negative where lost.

    Bounded, damped Gauss-Newton, its steps halved while they lead away.
    """
    T, q, nt = state.T, state.q, state.T.size
    gradient, error, dT = np.empty((nt, 1, 3)), np.empty(3), np.zeros(nt)
    site, below, free = at.chain.disk[-1:], np.full(1, q.size), np.empty(nt, np.bool_)
    found = copied(state)
    best, share, slow = 1e300, 1.0, 0
    factors.fresh[0] = False
    for _ in range(TRIALS):
        settle(state, start.z, start.s)
        solved = solve(at, state, factors, tol)
        size = miss(at, q, aim.target, error)
        if solved == 0 or size > best:
            share *= 0.5
            if share < 1e-3:
                break
            for t in range(nt):
                T[t] = within(aim, found.T, dT, share, t)
            assign(q, found.q)
            factors.fresh[0] = False
            continue
        slow = slow + 1 if size > STALLED * best else 0
        best, share = size, 1.0
        assign(found.T, T)
        assign(found.q, q)
        if size < aim.near or slow > 1 or not answer(at, state, factors.LU, site, below, gradient):
            break
        factors.fresh[0] = True
        assign(free, aim.used)
        step(gradient[:, 0], error, T, aim, free, dT)
        moved = 0.0
        for t in range(nt):
            new = within(aim, T, dT, 1.0, t)
            moved = max(moved, abs(new - T[t]))
            T[t] = new
        if moved < 1e-7:
            break
    assign(T, found.T)
    assign(q, found.q)
    return best if best < 1e299 else -1.0


@inner
def step(gradient, error, T, aim, free, dT):
    """The Gauss-Newton step dT of the free tendons; one that would leave the range allowed from its end of it is held there."""
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
            A[i, i] = DAMPING**2
            for j in range(nt):
                if free[j]:
                    for a in range(3):
                        A[i, j] += gradient[i, a] * gradient[j, a]
        dT[:] = np.linalg.solve(A, dT)
        held = False
        for i in range(nt):
            if free[i] and ((T[i] <= aim.least[i] and dT[i] < 0.0) or (T[i] >= aim.limit and dT[i] > 0.0)):
                free[i] = False
                held = True
        if not held:
            return


@jit
def refine(at, aim, start, state, factors, tol):
    """As `seek`, from its answer, but moving as `pull` does, whose friction is the one that counts.

    `state` becomes the one nearest to the target. Returns the distance (m), negative where lost.
    """
    nt, goal = state.T.size, state.T.copy()
    gradient, error, dT = np.empty((nt, 1, 3)), np.empty(3), np.zeros(nt)
    site, below, free = at.chain.disk[-1:], np.full(1, state.q.size), np.empty(nt, np.bool_)
    nearest, best, share = copied(state), 1e300, 1.0
    for _ in range(CORRECTIONS):
        become(state, start)
        factors.fresh[0] = False
        if pull(at, state, factors, goal, STRIDE, tol) == 0:
            break
        size = miss(at, state.q, aim.target, error)
        if size >= best:
            share *= 0.5
            for t in range(nt):
                goal[t] = within(aim, nearest.T, dT, share, t)
            continue
        best, share = size, 1.0
        become(nearest, state)
        if size < aim.near or not answer(at, state, factors.LU, site, below, gradient):
            break
        assign(free, aim.used)
        step(gradient[:, 0], error, state.T, aim, free, dT)
        for t in range(nt):
            goal[t] = within(aim, state.T, dT, 1.0, t)
    become(state, nearest)
    return best if best < 1e299 else -1.0
