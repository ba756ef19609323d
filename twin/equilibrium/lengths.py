"""Tensions that hold given tendon lengths, where motors command displacements: a tendon pulls or is slack, it never pushes.

For each such tendon   T >= 0,   gap <= 0,   T gap = 0,   the gap by how much it is too long for what holds it (holder.py).

Newton on shape and tensions at once: dpath_i/dT_j = -A_i J^-1 B_j with A_i = dpath_i/dq, B_j = dr/dT_j and J the tangent of the
balance; which tendons are taut is settled on the linear problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, dot, inner, jit
from twin.effects.tendon_friction import turn
from twin.equilibrium.chain import balance, copied, lever, settle
from twin.equilibrium.holder import GIVE, PULL, lack, linearise, longer, loose
from twin.equilibrium.linear import factorise, substitute
from twin.equilibrium.newton import CONTRACTION, GROWTH, LONGEST_STEP, allowed, commit, place

CLOSED = 0.2  # m/rad: a gap below this times the solver's tolerance counts as none (2e-8 m: some 1e-5 N)
STEPS = 40
PIECES = 8  # of springs' laws, tried before a first-order step ends on the last
SAME = 1e-3  # of a stretch: pieces of a spring's law differ by more
SMALLEST = 1e-3  # of a jump
WARY = 2e-4  # m: a part of it by a post, before which the robot may be caught; its tip moves by some 3 mm


@inner
def pulls(at, z, path_gradient, pull):
    """dpath/dq and dr/dT, (n_tendon, nv) each, at the geometry in MuJoCo's data and committed slip states z."""
    chain, law = at.chain, at.law
    for t in range(chain.hole.shape[0]):
        nd = chain.pieces[t]
        wrapped, share = 0.0, 1.0
        before = (0.0, 0.0, 0.0)
        for d in range(nd):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            length = np.sqrt(dot(v, v))
            u = (v[0] / length, v[1] / length, v[2] / length)
            if d > 0 and law.mu > 0.0:
                wrapped += z[t, d] * turn(np.arccos(min(1.0, dot(before, u))))[0]
                share = np.exp(-law.mu * wrapped)
            before = u
            for i in range(chain.first[d], chain.first[d + 1]):
                path_gradient[t, i] = dot(u, lever(chain, i, b))
                pull[t, i] = share * path_gradient[t, i]
        for i in range(chain.first[nd], path_gradient.shape[1]):
            path_gradient[t, i] = pull[t, i] = 0.0


@inner
def tauten(C, gap, T, by_length, dT):
    """dT with C dT = gap for the tendons that end up taut, T + dT = 0 for those that end up slack, 0 where tension is given."""
    nt = T.size
    taut, M = np.empty(nt, np.bool_), np.empty((nt, nt))
    for t in range(nt):
        taut[t] = by_length[t] and (T[t] > 0.0 or gap[t] > 0.0)
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
            if not by_length[i]:
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


@inner
def tangent(at, state, by_length, LU, held_by, yielding):
    """Factors of P = J + PULL sum B_i A_i' over the taut tendons of `by_length`, which `held_by` (n_tendon,) then names, and
    `yielding` (n_tendon, nv) rad/N, P^-1 B.

    J alone need not be positive: a shape that gives way under constant tension may be held by the lengths. Returns whether P is.
    """
    nt, nv = state.T.size, state.q.size
    r, A, B = np.empty(nv), np.empty((nt, nv)), yielding
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    place(at, state.q)
    balance(at, state, z, s, r, LU)
    pulls(at, z, A, B)
    for t in range(nt):
        held_by[t] = by_length[t] and state.T[t] > 0.0
        if held_by[t]:
            for i in range(nv):
                for j in range(nv):
                    LU[i, j] += PULL * B[t, i] * A[t, j]
    if not factorise(LU):
        return False
    for t in range(nt):
        substitute(LU, B[t])
    return True


class Sought(NamedTuple):
    """What holds the tendons is to become: free lengths (n_tendon,) m of motors, temperatures (n_tendon,) K of springs."""

    free: np.ndarray
    temperature: np.ndarray


@jit
def reach(at, state, factors, held, last, sought, tol, wary):
    """Equilibrium with the tendons that motors and springs hold as `sought`, and all tensions.

    Where the guess state.q does not lead there the jump is made from the shape `last`, which was at held.free and held.temperature,
    in ever smaller parts if need be, or at once in such as `WARY` says. held.free and held.temperature follow.

    Returns 1, 2 where parts were needed, 0 where no tensions were found. Commits the slip; with parts, after each. The springs'
    memory is left to `remember`.
    """
    T, fresh = state.T, factors.fresh
    q0, T0, T1, was = last.copy(), T.copy(), T.copy(), Sought(held.free.copy(), held.temperature.copy())
    for t in range(T.size):
        if held.by_spring[t]:  # what it had at `last`; T may be a guess
            T0[t] = held.factor[0] * held.tension[t]
    move(held, was, sought, 1.0)
    if not wary and hold(at, state, factors, held, tol) == 1:
        return 1
    longest = 0.0
    for t in range(T.size):
        longest = max(longest, abs(held.free[t] - was.free[t]) if held.which[t] and not held.by_spring[t] else 0.0)
    whole = min(1.0, WARY / longest) if wary and longest > 0.0 else 1.0
    done, part = 0.0, whole
    while done < 1.0:
        move(held, was, sought, done + part)
        assign(T, T0)
        assign(state.q, q0)
        fresh[0] = False
        if hold(at, state, factors, held, tol) == 1:
            done += part
            part = min(2.0 * part, whole, 1.0 - done)
            assign(q0, state.q)
            assign(T0, T)
        else:
            part *= 0.5
            if part < SMALLEST:
                move(held, was, sought, 1.0)
                assign(T, T1)
                return 0
    return 1 if wary else 2


@inner
def move(held, was, sought, share):
    """Sets held.free and held.temperature on the way from one to the other."""
    for t in range(sought.free.size):
        if not held.by_spring[t]:
            held.free[t] = was.free[t] + share * (sought.free[t] - was.free[t])
        held.temperature[t] = was.temperature[t] + share * (sought.temperature[t] - was.temperature[t])


@inner
def advance(at, state, factors, held, z, s, r):
    """One Newton step on shape and tensions together, with the `tangent` in the factors and the balance's (z, s, r) there.

    Returns the longest change of a hinge (rad), negative where the lengths have no solution.
    """
    A, B = np.empty(factors.yielding.shape), np.empty(factors.yielding.shape)
    pulls(at, z, A, B)
    substitute(factors.LU, r)
    return step(at, state, factors.held_by, held, A, factors.yielding, s, r)


@inner
def step(at, state, held_by, held, A, yielding, s, turn):
    """As `advance`, from what the `tangent` P makes of the balance, turn (nv,) = P^-1 r, and of tensions, `yielding`: neither
    changes with the piece of its law that a spring is on."""
    tension, q = state.T, state.q
    nt, nv = tension.size, q.size
    C, gap, dT, turn, D = np.empty((nt, nt)), np.empty(nt), np.empty(nt), turn.copy(), yielding.copy()
    for t in range(nt):
        gap[t] = lack(held, t, s[t, 0], tension)
        if held_by[t]:
            for i in range(nv):
                turn[i] += PULL * gap[t] * yielding[t, i]
    for t in range(nt):
        gap[t] -= dot_n(A[t], turn)
    for j in range(nt):
        for i in range(nt):
            if held_by[i]:
                share = PULL * longer(held, i, j)
                for k in range(nv):
                    D[j, k] -= share * yielding[i, k]
        for i in range(nt):
            C[i, j] = dot_n(A[i], D[j]) + longer(held, i, j)
    if not tauten(C, gap, tension, held.which, dT):
        return -1.0
    longest = 0.0
    for i in range(nv):
        step = turn[i]
        for t in range(nt):
            step += dT[t] * D[t, i]
        q[i] -= step
        longest = max(longest, abs(step) / at.chain.unit[i])
    for t in range(nt):
        tension[t] = max(0.0, tension[t] + dT[t])
    return longest


@inner
def unmet(at, state, held, s, r):
    """How far (rad) shape and lengths are from what they should be; the springs' laws are linearised on the way."""
    size = 0.0
    for i in range(r.size):
        size = max(size, abs(r[i] / at.chain.stiffness[i]) / at.chain.unit[i])
    linearise(held, s, state.T)
    for t in range(state.T.size):
        if held.which[t]:
            gap = lack(held, t, s[t, 0], state.T)
            if held.stretch[t] >= GIVE / held.factor[0]:  # (T_s - T) / PULL, as large as the other piece has it where they meet
                gap /= GIVE * PULL
            elif held.by_spring[t]:  # (Y - T) / slope, on either side of an end of the gap
                gap *= loose(held, t, s[t, 0])[1]
            size = max(size, (abs(gap) if state.T[t] > 0.0 else gap) / CLOSED)
    return size


@inner
def between(state, start, end, share):
    """Shape and tensions a share of the way from start to end."""
    for i in range(state.q.size):
        state.q[i] = start.q[i] + share * (end.q[i] - start.q[i])
    for t in range(state.T.size):
        state.T[t] = start.T[t] + share * (end.T[t] - start.T[t])


@inner
def hold(at, state, factors, held, tol):
    """Newton on shape and tensions at once, with the chord LU while it contracts; a step that lets the residual grow is halved.

    Returns 1 and commits the slip, or 0.
    """
    r, none, fresh = np.empty(state.q.size), np.empty((0, 0)), factors.fresh
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    start, end = copied(state), copied(state)
    before, step, chord = 1e300, 1.0, True
    for _ in range(STEPS):
        place(at, state.q)
        balance(at, state, z, s, r, none)
        size = unmet(at, state, held, s, r)
        if size < tol:
            settle(state, z, s)
            return 1
        if not size < GROWTH * before:
            if chord and fresh[0]:  # the fault may be the old tangent's: from the last shape with a new one
                step = 1.0
                between(state, start, start, 0.0)
                fresh[0], before = False, 1e300
                continue
            step *= 0.5
            if step < SMALLEST:
                return 0
            between(state, start, end, step)
            continue
        chord = fresh[0] and size <= CONTRACTION * before
        if not chord:
            fresh[0] = tangent(at, state, held.which, factors.LU, factors.held_by, factors.yielding)
            if not fresh[0]:
                return 0
        before, step = size, 1.0
        assign(start.q, state.q)
        assign(start.T, state.T)
        longest = advance(at, state, factors, held, z, s, r)
        if longest < 0.0:
            return 0
        assign(end.q, state.q)
        assign(end.T, state.T)
        for i in range(r.size):
            r[i] = end.q[i] - start.q[i]
        step = allowed(at, r, longest)
        if step < 1.0:
            between(state, start, end, step)
    return 0


@inner
def hold_once(at, state, held_by, held, LU, yielding):
    """One Newton step on shape and tensions from a neighbouring solution with the factors of its tangent and its `yielding`, each
    spring on the piece of its law where the step ends: the neighbour's, beside which it has another past, may be another one.

    Returns 1 and commits the slip, or 0 where shape and tensions are lost. The path of a taut spring is the step's own, to first
    order as its tension is: they are where its law goes on from, and what a bent path has more, once a sample, would add up.
    """
    r, none, A, B = np.empty(state.q.size), np.empty((0, 0)), np.empty(yielding.shape), np.empty(yielding.shape)
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    place(at, state.q)
    bowing = balance(at, state, z, s, r, none)
    pulls(at, z, A, B)
    substitute(LU, r)
    q0, T0, own = state.q.copy(), state.T.copy(), s.copy()
    linearise(held, s, state.T)
    for _ in range(PIECES):
        assign(state.q, q0)
        assign(state.T, T0)
        longest = step(at, state, held_by, held, A, yielding, s, r)
        if not 0.0 <= longest < LONGEST_STEP:
            return 0
        if not elsewhere(held, state.T, own):
            break
    place(at, state.q)
    commit(at, state, bowing)
    for t in range(state.T.size):
        if held.by_spring[t] and state.T[t] > 0.0:
            state.s[t, 0] = own[t, 0]
    return 1


@inner
def elsewhere(held, tension, s):
    """Whether a taut spring, at the path that its linear piece has at its tension, is on another piece; s[t, 0] are these paths,
    and the springs are linearised there."""
    was, other = held.stretch.copy(), False
    for t in range(tension.size):
        if held.by_spring[t] and tension[t] > 0.0:
            s[t, 0] = held.free[t] + held.bedded[t] + held.stretch[t] * tension[t]
    linearise(held, s, tension)
    for t in range(tension.size):
        if held.by_spring[t] and tension[t] > 0.0:
            other = other or abs(held.stretch[t] - was[t]) > SAME * was[t]
    return other


@inner
def stay(at, state):
    """Commits the slip of the shape and tensions that the state has."""
    r, none = np.empty(state.q.size), np.empty((0, 0))
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    place(at, state.q)
    balance(at, state, z, s, r, none)
    settle(state, z, s)


@inner
def dot_n(a, b):
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
