"""Tensions that hold given tendon lengths, where motors command displacements: a tendon pulls or is slack, it never pushes.

For each such tendon   T >= 0,   gap = path(T) - free length - stretch T - COMPRESSION sum T <= 0,   T gap = 0,

the sum over the tendons that motors hold: what all of them pull, the backbone carries in compression. A tendon that beds in gives
way by e = bedding (1 - exp(-T/T_b)) besides: at each step it is one of free length free + e - e' T whose stretch is e' more. A
motor that stalls pulls no more than T_s: a tendon that would need more is one that gives `GIVE` a newton from there.

An SMA spring holds its tendon in the same way: on each linear piece Y = Y_0 + slope (e - e_0) of its law (twin/springs/force.py),
at an elongation e = e_start + path - straight path - stretch T, it is a tendon of free length path - stretch T - Y/slope whose
stretch is 1/slope more, so gap = (Y - T)/slope. The piece is taken anew at every step (semi-smooth Newton: all pieces rise with e).

Newton on shape and tensions at once: dpath_i/dT_j = -A_i J^-1 B_j with A_i = dpath_i/dq, B_j = dr/dT_j and J the tangent of the
balance; which tendons are taut is settled on the linear problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, dot, inner, jit
from twin.effects.tendon_friction import turn
from twin.equilibrium.chain import balance, copied, lever, settle
from twin.equilibrium.linear import factorise, substitute
from twin.equilibrium.newton import CONTRACTION, GROWTH, LONGEST_STEP, allowed, commit, place
from twin.springs.force import piece

CLOSED = 0.2  # m/rad: a gap below this times the solver's tolerance counts as none (2e-8 m: some 1e-5 N)
STIFFEST = 1e-6  # m/N of any tendon: two taut ones may run side by side
# m/N of the backbone: three taut tendons are redundant, and this decides between them. An inextensible robot has none, 120 mm of
# NiTi of 0.8 mm 3e-6; at 3 N this is 3 um, less than any encoder sees.
COMPRESSION = 1e-6
PULL = 1e3  # N/m: some of the stiffness a held length has against its tendon's pull
GIVE = 10.0  # m/N of a motor that stalls: a millimetre less than commanded is a tenth of a millinewton more
STEPS = 40
SMALLEST = 1e-3  # of a jump
WARY = 2e-4  # m: a part of it by a post, before which the robot may be caught; its tip moves by some 3 mm


class Held(NamedTuple):
    """Tendons held at lengths, by motors or by springs, (n_tendon,) each. Tensions count times `factor`, as in `trial.softened`."""

    which: np.ndarray  # whether a tendon is held, and not pulled with a given tension
    by_spring: np.ndarray  # whether a spring holds it
    free: np.ndarray  # m
    stretch: np.ndarray  # m/N
    straight: np.ndarray  # m, path lengths on the straight robot
    elastic: float  # m/N, stretch of the tendon alone
    factor: np.ndarray  # (1,)
    spring: np.ndarray  # (n_tendon,) `Spring.records`
    temperature: np.ndarray  # K, of the springs
    elongation: np.ndarray  # m, of the springs when they last were at rest
    tension: np.ndarray  # N, theirs then
    bedding: float  # m, of tendons that motors hold
    bedding_tension: float  # N
    bedded: np.ndarray  # (n_tendon,) m, e - e' T
    stall: float  # N, of motors


@inner
def elongation(held, t, path, tension):
    """Elongation (m) of the spring that pulls tendon t at a path length (m) and a tension."""
    return held.spring[t].initial_elongation + path - held.straight[t] - held.elastic * tension / held.factor[0]


@inner
def linearise(held, s, tension):
    """Free length and stretch of the tendons that springs hold, from the piece of their law they are on, and of those that bed in;
    s[t, 0] is the path."""
    for t in range(tension.size):
        if held.by_spring[t]:
            e = elongation(held, t, s[t, 0], tension[t])
            Y, slope = piece(held.spring, t, held.temperature[t], e, held.elongation[t], held.tension[t])
            elastic = held.elastic / held.factor[0]
            held.free[t] = s[t, 0] - elastic * tension[t] - Y / slope
            held.stretch[t] = elastic + 1.0 / (slope * held.factor[0])
        elif held.bedding > 0.0 or held.stall < np.inf:
            bed_in(held, t, tension[t])
    if held.stall < np.inf:
        for t in range(tension.size):
            if held.which[t] and not held.by_spring[t]:
                give_way(held, t, s[t, 0], tension)


@inner
def bed_in(held, t, tension):
    """What is left of the bedding in of tendon t at a tension, and its stretch there."""
    over = held.bedding_tension * held.factor[0]
    loose = np.exp(-tension / over)
    held.bedded[t] = held.bedding * (1.0 - loose * (1.0 + tension / over))
    held.stretch[t] = max(held.elastic, STIFFEST) / held.factor[0] + held.bedding / over * loose


@inner
def give_way(held, t, path, tension):
    """Tendon t on the piece where its motor stalls, if at this path and these tensions it would pull more than that."""
    if tension[t] / held.factor[0] + PULL * lack(held, t, path, tension) > held.stall:
        longer_by = max(held.elastic, STIFFEST) * held.stall + held.bedding * (1.0 - np.exp(-held.stall / held.bedding_tension))
        held.bedded[t] = longer_by - GIVE * held.stall
        held.stretch[t] = GIVE / held.factor[0]


@inner
def longer(held, i, j):
    """How much (m/N) tendon j's tension gives tendon i, both held: by i's own stretch and by the backbone's compression."""
    own = held.stretch[i] if i == j else 0.0
    if held.by_spring[i] or held.by_spring[j] or not (held.which[i] and held.which[j]):
        return own
    return own + COMPRESSION / held.factor[0]


@inner
def lack(held, t, path, tension):
    """How much too long (m) tendon t is at a path length (m) and all tensions."""
    gap = path - held.free[t] - held.bedded[t]
    for j in range(tension.size):
        gap -= longer(held, t, j) * tension[j]
    return gap


@jit
def remember(held, s, tension):
    """The springs come to rest: their elongations and tensions become those their law goes on from."""
    for t in range(tension.size):
        if held.by_spring[t]:
            held.elongation[t] = elongation(held, t, s[t, 0], tension[t])
            held.tension[t] = tension[t] / held.factor[0]


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
def tangent(at, state, by_length, LU, held_by):
    """Factors of J + PULL sum B_i A_i' over the taut tendons of `by_length`, which `held_by` (n_tendon,) then names.

    J alone need not be positive: a shape that gives way under constant tension may be held by the lengths. Returns whether this is.
    """
    nt, nv = state.T.size, state.q.size
    r, A, B = np.empty(nv), np.empty((nt, nv)), np.empty((nt, nv))
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
    return factorise(LU)


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
    tension, q, LU, held_by = state.T, state.q, factors.LU, factors.held_by
    nt, nv = tension.size, q.size
    A, B, C, gap, dT = np.empty((nt, nv)), np.empty((nt, nv)), np.empty((nt, nt)), np.empty(nt), np.empty(nt)
    pulls(at, z, A, B)
    for t in range(nt):
        gap[t] = lack(held, t, s[t, 0], tension)
        if held_by[t]:
            for i in range(nv):
                r[i] += PULL * gap[t] * B[t, i]
    substitute(LU, r)
    for t in range(nt):
        gap[t] -= dot_n(A[t], r)
    D = B.copy()
    for j in range(nt):
        for i in range(nt):
            if held_by[i]:
                for k in range(nv):
                    D[j, k] -= PULL * longer(held, i, j) * B[i, k]
        substitute(LU, D[j])
        for i in range(nt):
            C[i, j] = dot_n(A[i], D[j]) + longer(held, i, j)
    if not tauten(C, gap, tension, held.which, dT):
        return -1.0
    longest = 0.0
    for i in range(nv):
        step = r[i]
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
            fresh[0] = tangent(at, state, held.which, factors.LU, factors.held_by)
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
def hold_once(at, state, factors, held):
    """One Newton step on shape and tensions from a neighbouring solution with the factors of its tangent. Commits the slip.

    Returns 1, or 0 where lost.
    """
    r, none = np.empty(state.q.size), np.empty((0, 0))
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    place(at, state.q)
    bowing = balance(at, state, z, s, r, none)
    linearise(held, s, state.T)
    longest = advance(at, state, factors, held, z, s, r)
    place(at, state.q)
    commit(at, state, bowing)
    return 1 if 0.0 <= longest < LONGEST_STEP else 0


@inner
def dot_n(a, b):
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
