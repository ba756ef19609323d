"""Tensions that hold given tendon lengths, where motors command displacements: a tendon pulls or is slack, it never pushes.

For each such tendon   T >= 0,   gap = path(T) - free length - stretch T - COMPRESSION sum T <= 0,   T gap = 0,

the sum over the tendons that motors hold: what all of them pull, the backbone carries in compression.

An SMA spring holds its tendon in the same way: on each linear piece Y = Y_0 + slope (e - e_0) of its law (twin/springs/force.py),
at an elongation e = e_start + path - straight path - stretch T, it is a tendon of free length path - stretch T - Y/slope whose
stretch is 1/slope more, so gap = (Y - T)/slope. The piece is taken anew at every step (semi-smooth Newton: all pieces rise with e).

Newton on shape and tensions at once: dpath_i/dT_j = -A_i J^-1 B_j with A_i = dpath_i/dq, B_j = dr/dT_j and J the tangent of the
balance; which tendons are taut is settled on the linear problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, dot, jit
from twin.effects.tendon_friction import turn
from twin.equilibrium.chain import balance, lever
from twin.equilibrium.linear import factorise, substitute
from twin.equilibrium.newton import CONTRACTION, GROWTH, LONGEST_STEP, commit, place
from twin.springs.force import piece
from twin.springs.spring import Spring

CLOSED = 0.2  # m/rad: a gap below this times the solver's tolerance counts as none (2e-8 m: some 1e-5 N)
STIFFEST = 1e-6  # m/N of any tendon: two taut ones may run side by side
# m/N of the backbone: three taut tendons are redundant, and this decides between them. An inextensible robot has none, 120 mm of
# NiTi of 0.8 mm 3e-6; at 3 N this is 3 um, less than any encoder sees.
COMPRESSION = 1e-6
PULL = 1e3  # N/m: some of the stiffness a held length has against its tendon's pull
STEPS = 40
SMALLEST = 1e-3  # of a jump


class Held(NamedTuple):
    """Tendons held at lengths, by motors or by springs, (n_tendon,) each. Tensions count times `factor`, as in `trial.softened`."""

    which: np.ndarray  # whether a tendon is held, and not pulled with a given tension
    by_spring: np.ndarray  # whether a spring holds it
    free: np.ndarray  # m
    stretch: np.ndarray  # m/N
    straight: np.ndarray  # m, path lengths on the straight robot
    elastic: float  # m/N, stretch of the tendon alone
    factor: np.ndarray  # (1,)
    spring: Spring
    temperature: np.ndarray  # K, of the springs
    elongation: np.ndarray  # m, of the springs when they last were at rest
    tension: np.ndarray  # N, theirs then


@jit
def elongation(held, t, path, tension):
    """Elongation (m) of the spring that pulls tendon t at a path length (m) and a tension."""
    return held.spring.initial_elongation[t] + path - held.straight[t] - held.elastic * tension / held.factor[0]


@jit
def linearise(held, s, tension):
    """Free length and stretch of the tendons that springs hold, from the piece of their law they are on; s[t, 0] is the path."""
    for t in range(tension.size):
        if held.by_spring[t]:
            e = elongation(held, t, s[t, 0], tension[t])
            Y, slope = piece(held.spring, t, held.temperature[t], e, held.elongation[t], held.tension[t])
            elastic = held.elastic / held.factor[0]
            held.free[t] = s[t, 0] - elastic * tension[t] - Y / slope
            held.stretch[t] = elastic + 1.0 / (slope * held.factor[0])


@jit
def longer(held, i, j):
    """How much (m/N) tendon j's tension gives tendon i, both held: by i's own stretch and by the backbone's compression."""
    own = held.stretch[i] if i == j else 0.0
    if held.by_spring[i] or held.by_spring[j] or not (held.which[i] and held.which[j]):
        return own
    return own + COMPRESSION / held.factor[0]


@jit
def lack(held, t, path, tension):
    """How much too long (m) tendon t is at a path length (m) and all tensions."""
    gap = path - held.free[t]
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


@jit
def pulls(chain, law, z, path_gradient, pull):
    """dpath/dq and dr/dT, (n_tendon, nv) each, at the geometry in MuJoCo's data and committed slip states z."""
    nt, nd = chain.hole.shape[0], chain.hole.shape[1] - 1
    for t in range(nt):
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


@jit
def settle(C, gap, T, by_length, dT):
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


@jit
def tangent(model, data, chain, rest, law, load, z, s, q, tension, by_length, LU, held_by):
    """Factors of J + PULL sum B_i A_i' over the taut tendons of `by_length`, which `held_by` (n_tendon,) then names.

    J alone need not be positive: a shape that gives way under constant tension may be held by the lengths. Returns whether this is.
    """
    nt, nv = tension.size, q.size
    r, A, B = np.empty(nv), np.empty((nt, nv)), np.empty((nt, nv))
    z1, s1 = np.empty(z.shape), np.empty(s.shape)
    place(model, data, chain, q)
    balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, LU)
    pulls(chain, law, z1, A, B)
    for t in range(nt):
        held_by[t] = by_length[t] and tension[t] > 0.0
        if held_by[t]:
            for i in range(nv):
                for j in range(nv):
                    LU[i, j] += PULL * B[t, i] * A[t, j]
    return factorise(LU)


@jit
def reach(model, data, chain, rest, law, load, z, s, q, LU, held_by, fresh, tol, tension, held, last, free, temperature):
    """Equilibrium with the tendons that motors hold at lengths `free` (n_tendon,) m and the springs at `temperature` (n_tendon,) K,
    and all tensions.

    Where the guess q does not lead there the jump is made from `last`, which was at held.free and held.temperature, in ever smaller
    parts if need be. held.free and held.temperature follow.

    Returns 1, 2 where parts were needed, 0 where no tensions were found. Commits (z, s); with parts, after each. The springs'
    memory is left to `remember`.
    """
    nt = tension.size
    q0, T0, T1, free0, warm0 = last.copy(), tension.copy(), tension.copy(), held.free.copy(), held.temperature.copy()
    move(held, free0, warm0, free, temperature, 1.0)
    if hold(model, data, chain, rest, law, load, z, s, q, LU, held_by, fresh, tol, tension, held) == 1:
        return 1
    done, part = 0.0, 1.0
    while done < 1.0:
        move(held, free0, warm0, free, temperature, done + part)
        assign(tension, T0)
        assign(q, q0)
        fresh[0] = False
        if hold(model, data, chain, rest, law, load, z, s, q, LU, held_by, fresh, tol, tension, held) == 1:
            done += part
            part = min(2.0 * part, 1.0 - done)
            assign(q0, q)
            assign(T0, tension)
        else:
            part *= 0.5
            if part < SMALLEST:
                move(held, free0, warm0, free, temperature, 1.0)
                for t in range(nt):
                    tension[t] = T1[t]
                return 0
    return 2


@jit
def move(held, free0, warm0, free, warm, share):
    """Sets held.free and held.temperature on the way from (free0, warm0) to (free, warm)."""
    for t in range(free.size):
        if not held.by_spring[t]:
            held.free[t] = free0[t] + share * (free[t] - free0[t])
        held.temperature[t] = warm0[t] + share * (warm[t] - warm0[t])


@jit
def advance(chain, law, z1, s1, q, r, LU, held_by, tension, held):
    """One Newton step on shape and tensions together, with the `tangent` (LU, held_by) and the balance's (r, z1, s1) at q.

    Returns the longest change of a hinge (rad), negative where the lengths have no solution.
    """
    nt, nv = tension.size, q.size
    A, B, C, gap, dT = np.empty((nt, nv)), np.empty((nt, nv)), np.empty((nt, nt)), np.empty(nt), np.empty(nt)
    pulls(chain, law, z1, A, B)
    for t in range(nt):
        gap[t] = lack(held, t, s1[t, 0], tension)
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
    if not settle(C, gap, tension, held.which, dT):
        return -1.0
    longest = 0.0
    for i in range(nv):
        step = r[i]
        for t in range(nt):
            step += dT[t] * D[t, i]
        q[i] -= step
        longest = max(longest, abs(step) / chain.unit[i])
    for t in range(nt):
        tension[t] = max(0.0, tension[t] + dT[t])
    return longest


@jit
def hold(model, data, chain, rest, law, load, z, s, q, LU, held_by, fresh, tol, tension, held):
    """Newton on shape and tensions at once, with the chord LU while it contracts; a step that lets the residual grow is halved.

    Returns 1 and commits (z, s), or 0.
    """
    nt, nv = tension.size, q.size
    r, none, q0, T0, q1, T1 = np.empty(nv), np.empty((0, 0)), q.copy(), tension.copy(), q.copy(), tension.copy()
    z1, s1 = np.empty(z.shape), np.empty(s.shape)
    before, step, chord = 1e300, 1.0, True
    for _ in range(STEPS):
        place(model, data, chain, q)
        balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, none)
        size = 0.0
        for i in range(nv):
            size = max(size, abs(r[i] / chain.stiffness[i]) / chain.unit[i])
        linearise(held, s1, tension)
        for t in range(nt):
            if held.which[t]:
                gap = lack(held, t, s1[t, 0], tension)
                size = max(size, (abs(gap) if tension[t] > 0.0 else gap) / CLOSED)
        if size < tol:
            for t in range(nt):
                assign(z[t], z1[t])
                assign(s[t], s1[t])
            return 1
        if not size < GROWTH * before:
            if chord and fresh[0]:  # the fault may be the old tangent's: from the last shape with a new one
                step = 1.0
                assign(q, q0)
                assign(tension, T0)
                fresh[0], before = False, 1e300
                continue
            step *= 0.5
            if step < SMALLEST:
                return 0
            for i in range(nv):
                q[i] = q0[i] + step * (q1[i] - q0[i])
            for t in range(nt):
                tension[t] = T0[t] + step * (T1[t] - T0[t])
            continue
        chord = fresh[0] and size <= CONTRACTION * before
        if not chord:
            fresh[0] = tangent(model, data, chain, rest, law, load, z, s, q, tension, held.which, LU, held_by)
            if not fresh[0]:
                return 0
        before, step = size, 1.0
        assign(q0, q)
        assign(T0, tension)
        longest = advance(chain, law, z1, s1, q, r, LU, held_by, tension, held)
        if longest < 0.0:
            return 0
        assign(q1, q)
        assign(T1, tension)
        if longest > LONGEST_STEP:
            step = LONGEST_STEP / longest
            for i in range(nv):
                q[i] = q0[i] + step * (q1[i] - q0[i])
            for t in range(nt):
                tension[t] = T0[t] + step * (T1[t] - T0[t])
    return 0


@jit
def hold_once(model, data, chain, rest, law, load, z, s, q, LU, held_by, tension, held):
    """One Newton step on shape and tensions from a neighbouring solution with the factors LU of its tangent. Commits (z, s).

    Returns 1, or 0 where lost.
    """
    r, none = np.empty(q.size), np.empty((0, 0))
    z1, s1 = np.empty(z.shape), np.empty(s.shape)
    place(model, data, chain, q)
    bowing = balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, none)
    linearise(held, s1, tension)
    longest = advance(chain, law, z1, s1, q, r, LU, held_by, tension, held)
    place(model, data, chain, q)
    commit(chain, law, z, s, bowing)
    return 1 if 0.0 <= longest < LONGEST_STEP else 0


@jit
def dot_n(a, b):
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
