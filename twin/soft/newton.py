"""Equilibria of a silicone body by Newton's method, one sample after another.

    f(u) + sum_t T_t pull_t(u) = F,       path_t - free_t - stretch_t T_t <= 0,  T_t >= 0,  one of them zero,

for tendons that motors hold at a length; for the others T_t is given. A tangent, inverted once, serves as long as steps shrink:
from sample to sample, and from a neighbouring problem's kept answers, which cost a fraction of a new one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg.cython_blas  # noqa: F401  compiled products call it: it must be there before anyone limits its threads

from twin.compiled import inner, jit, part
from twin.soft.cables import Cables, Pulled, follow, geometric, sticking
from twin.soft.creep import relax_for
from twin.soft.silicone import LEAST, Cells, Tangent, forces, stiffness
from twin.soft.wall import Skin, press

STEPS = 60
LONGEST = 6e-3  # m, of a step at any node
SHRINKS = 0.6  # a step that leaves more than this of the one before is a poor one
PATIENCE = 3  # poor steps, after which a tangent is made anew; a step costs a fiftieth of that
GROWS = 5.0  # a step longer than the one before by this is lost
LEARNT = 16  # steps that a tangent learns from
BENT = 0.1  # a step along which the tangent is further off than by this factor teaches nothing
SLACK = 1e-9  # m: a gap below this is none
STALE = 5  # steps after which a tangent that is wanted is made anew
NONE, OWN, NEAR = 0, 1, 2  # whose inverse tangent serves: none yet, the state's, or that of the neighbour's sample, used in place


class Parts(NamedTuple):
    """A body: cells, cables, skin, and how many nodes are clamped."""

    cells: Cells
    cables: Cables
    skin: Skin
    clamped: int


class Way(NamedTuple):
    """What is asked at each sample: tensions and free lengths (n, t) and which tendons are `held`; stretch (n, t) m/N; forces
    (n_free, 3) N, wall (10,) and the stiffness (n,) they count over; friction and pre-sliding; times (n,) s, amplitude and time
    (k,) of creep; the step (m) that counts as none, whether one step is all that is taken, and whether its tangent is wanted."""

    tension: np.ndarray
    free: np.ndarray
    held: np.ndarray
    stretch: np.ndarray
    force: np.ndarray
    wall: np.ndarray
    scale: np.ndarray
    mu: float
    presliding: float
    time: np.ndarray
    amplitude: np.ndarray
    lag: np.ndarray
    close: float
    once: bool
    sharp: bool


class Kept(NamedTuple):
    """A neighbour's shapes (n, nq) m, tensions (n, t) N and inverse tangents (n, nq, nq) m/N; none of them where n is 0."""

    u: np.ndarray
    tension: np.ndarray
    inverse: np.ndarray


class Found(NamedTuple):
    """Answers: u (n, nq) m, tensions (n, t) N, path lengths (n, t) m; inverse tangents, if they are to be kept, but for the samples
    that were found by the neighbour's, `borrowed` (n,)."""

    u: np.ndarray
    tension: np.ndarray
    length: np.ndarray
    inverse: np.ndarray
    borrowed: np.ndarray


class State(NamedTuple):
    """Where the body is: u (nq,) m, tensions (t,) N over the stiffness, slip states (t, p - 2) and lengths beyond, relaxed
    stress (k, c, q, 6) Pa; the inverse of a tangent near it (nq, nq), and whose serves, `has` (1,)."""

    u: np.ndarray
    tension: np.ndarray
    slip: np.ndarray
    beyond: np.ndarray
    taken: np.ndarray
    inverse: np.ndarray
    has: np.ndarray


class Room(NamedTuple):
    """Arrays to work in: forces (nq,), pressures (c, 4), all nodes (n_node, 3), the tangent, what the tendons do, how far each
    tendon's unit pull moves the nodes (t, nq), relaxed stress (c, q, 6) or (0, 0, 6), whether the tangent's pressures are
    foreseen (1,), and what the inverse tangent has learnt from steps: B <- (1 + better along') B (LEARNT, nq) each."""

    f: np.ndarray
    p: np.ndarray
    whole: np.ndarray
    tangent: Tangent
    pulled: Pulled
    reach: np.ndarray
    relaxed: np.ndarray
    foresees: np.ndarray
    along: np.ndarray
    better: np.ndarray


@inner
def better(moved, s, g):
    """moved += g (s' moved), in place."""
    nq, m = moved.shape
    for c in range(m):
        share = 0.0
        for a in range(nq):
            share += s[a] * moved[a, c]
        for a in range(nq):
            moved[a, c] += g[a] * share


@part
def corrected(moved, room, learnt, learns, step):
    """Columns `moved` (nq, m) by the inverse tangent as better by steps taken (Broyden's good update); how many of them now."""
    for k in range(learnt):
        better(moved, room.along[k], room.better[k])
    if not learns or learnt == LEARNT:
        return learnt
    s, g = room.along[learnt], room.better[learnt]
    s[:], g[:] = step, moved[:, 0]  # what the step left, by the tangent that led to it
    size, bent = np.dot(s, s), np.dot(s, s) - np.dot(s, g)
    if not BENT * size < bent < size / BENT:
        return learnt
    g /= bent
    better(moved, s, g)
    return learnt + 1


@part
def remember(inverse, room, learnt):
    """The inverse tangent with what it has learnt."""
    for k in range(learnt):
        row = np.dot(room.along[k].astype(np.float32), inverse)
        for a in range(row.size):
            inverse[a] += np.float32(room.better[k, a]) * row


@part
def residual(parts, way, i, state, room):
    """Forces that are left, in room.f. False where a cell has turned inside out."""
    u = state.u.reshape(-1, 3)
    room.whole[parts.clamped :] = u
    if forces(room.whole, parts.cells, room.relaxed, room.f, room.p) < LEAST:
        return False
    follow(parts.cables, u, state.slip, state.beyond, way.mu, way.presliding, room.pulled)
    room.f[:] -= way.force.ravel() / way.scale[i]
    if way.wall[4] > 0.0:
        press(parts.skin, u, way.wall, way.scale[i], room.f, room.tangent.K, False)
    for t in range(state.tension.size):
        room.f[:] += state.tension[t] * room.pulled.pull[t]
    return True


@inner
def renew(parts, way, i, state, room):
    """Invert the tangent at the state's shape, after `residual` there. False where it has no inverse."""
    K, tangent = room.tangent.K, room.tangent
    if state.has[0] != NONE or not room.foresees[0]:
        tangent.pressure[:] = room.p
    if stiffness(room.whole, parts.cells, room.relaxed, tangent) < LEAST:
        return False
    geometric(parts.cables, state.tension, room.pulled, K)
    if way.mu > 0.0:
        sticking(parts.cables, state.tension, room.pulled, way.mu, way.presliding, K)
    if way.wall[4] > 0.0:
        press(parts.skin, state.u.reshape(-1, 3), way.wall, way.scale[i], room.f, K, True)
    if not np.isfinite(K.sum()):
        return False
    state.inverse[:] = np.linalg.inv(K).astype(np.float32)
    state.has[0], room.foresees[0] = OWN, True
    return True


@part
def balance(way, i, state, room, gap, taut, had, dT):
    """dT (t,) that closes the gaps of the taut tendons and lets go of those that were."""
    p, T, reach = room.pulled, state.tension, room.reach
    on = np.flatnonzero(taut)
    for t in range(T.size):
        dT[t] = -T[t] if had[t] else 0.0
    if on.size == 0:
        return
    C, b = np.empty((on.size, on.size)), np.empty(on.size)
    for k in range(on.size):
        t = on[k]
        b[k] = gap[t]
        for s in range(T.size):
            if had[s] and not taut[s]:
                b[k] -= np.dot(p.gradient[t], reach[s]) * dT[s]
        for m in range(on.size):
            C[k, m] = np.dot(p.gradient[t], reach[on[m]]) + (way.stretch[i, t] if k == m else 0.0)
    x = np.linalg.solve(C, b)
    for k in range(on.size):
        dT[on[k]] = x[k]


@part
def linear(way, i, state, room, inverse, learnt, learns, du, dT):
    """Changes of nodes du (nq,) and tensions dT (t,) that solve the linear problem; tendons fall slack or taut on the way.

    The tangent is better by `learnt` steps, and, if it `learns`, by the last, which du held. Returns how many it has learnt from.
    """
    p, T, reach, nt = room.pulled, state.tension, room.reach, state.tension.size
    push = np.zeros((du.size, 1 + nt), np.float32)
    push[:, 0] = -room.f
    for t in range(nt):
        if way.held[t]:
            push[:, 1 + t] = p.pull[t]
    moved = np.dot(inverse, push)
    learnt = corrected(moved, room, learnt, learns, du)
    du[:] = moved[:, 0]
    gap, taut, had = np.empty(nt), np.zeros(nt, np.bool_), np.zeros(nt, np.bool_)
    for t in range(nt):
        reach[t] = moved[:, 1 + t]
        if way.held[t]:
            gap[t] = p.length[t] - way.free[i, t] - way.stretch[i, t] * T[t] + np.dot(p.gradient[t], du)
            taut[t] = T[t] > 0.0 or gap[t] > 0.0
            had[t] = taut[t]
    for _ in range(4 * nt):
        balance(way, i, state, room, gap, taut, had, dT)
        changed = False
        for t in range(nt):
            if taut[t]:
                if T[t] + dT[t] < 0.0:
                    taut[t], changed = False, True
            elif way.held[t]:
                left = gap[t]
                for s in range(nt):
                    if had[s]:
                        left -= np.dot(p.gradient[t], reach[s]) * dT[s]
                if left > SLACK:
                    taut[t], had[t], changed = True, True, True
        if not changed:
            break
    for t in range(nt):
        if had[t]:
            du -= dT[t] * reach[t]
    return learnt


@part
def foresee(parts, du, room):
    """The pressures after a step du (nq,), for the next tangent: with them it takes fewer steps."""
    unknowns, tangent = parts.cells.unknowns, room.tangent
    for e in range(unknowns.shape[0]):
        for k in range(4):
            tangent.pressure[e, k] = room.p[e, k]
            for a in range(81):
                if unknowns[e, a] >= 0:
                    tangent.pressure[e, k] += tangent.follow[e, k, a] * du[unknowns[e, a]]


@part
def commit(parts, way, state, room):
    """Slip and lengths where the state is now."""
    follow(parts.cables, state.u.reshape(-1, 3), state.slip, state.beyond, way.mu, way.presliding, room.pulled)
    state.slip[:] = room.pulled.slip
    state.beyond[:] = room.pulled.beyond


@part
def settle(parts, way, i, state, room, near):
    """Bring `state` to equilibrium at sample i; `near` (nq, nq) m/N is a neighbour's inverse tangent. Returns the steps it took; 0,
    and all as it was, where it is lost."""
    u, T, last, fresh, fails = state.u.copy(), state.tension.copy(), 1e9, False, 0
    if room.relaxed.shape[0] > 0:
        room.relaxed[:] = state.taken.sum(axis=0)
    for t in range(T.size):
        if not way.held[t]:
            state.tension[t] = way.tension[i, t] / way.scale[i]
    du, dT = np.zeros(u.size), np.empty(T.size)
    learnt, poor = 0, 0
    for step in range(STEPS):
        if not (residual(parts, way, i, state, room) and (state.has[0] != NONE or renew(parts, way, i, state, room))):
            break
        learnt = linear(way, i, state, room, near if state.has[0] == NEAR else state.inverse, learnt, last < 1e9, du, dT)
        length = np.abs(du).max()
        poor += not (length < SHRINKS * last or fresh)
        if not ((poor <= PATIENCE and length < GROWS * last) or fresh or way.once):
            state.has[0] = NONE
            fails += 1
            if fails > STEPS // 4 or not np.isfinite(length):
                break
            last, fresh, learnt, poor = 1e9, True, 0, 0  # the next turn makes a new tangent here
            continue
        share = min(1.0, LONGEST / max(length, 1e-12))
        foresee(parts, share * du, room)
        state.u[:] += share * du
        for t in range(T.size):
            if way.held[t]:
                state.tension[t] = max(0.0, state.tension[t] + share * dT[t])
        if way.once or length < way.close:
            commit(parts, way, state, room)
            if way.sharp and step >= STALE:
                renew(parts, way, i, state, room)
            elif state.has[0] == OWN and not way.sharp:
                remember(state.inverse, room, learnt)
            return step + 1
        if share < 1.0:
            state.has[0], learnt = NONE, 0
        last, fresh = length if share == 1.0 else 1e9, False
    state.u[:] = u
    state.tension[:] = T
    state.has[0] = NONE
    return 0


@jit
def along(parts, way, kept, i, state, found, room):
    """From sample i on as far as it goes: fills `found`, advances `state`. Returns the first sample not found, n if all were."""
    n, near = way.time.size, state.inverse
    while i < n:
        if kept.u.shape[0] > 0:
            state.u[:] = kept.u[i]
            state.tension[:] = kept.tension[i] / way.scale[i]
            near = kept.inverse[i]
            state.has[0], room.foresees[0] = NEAR, False
        steps = settle(parts, way, i, state, room, near)
        if steps == 0:
            return i
        if found.inverse.shape[0] > 0:
            found.borrowed[i] = state.has[0] == NEAR
            if not found.borrowed[i]:
                found.inverse[i] = state.inverse
        found.u[i], found.length[i] = state.u, room.pulled.length
        found.tension[i] = state.tension * way.scale[i]
        if state.taken.shape[0] > 0 and i + 1 < n:
            room.whole[parts.clamped :] = state.u.reshape(-1, 3)
            relax_for(room.whole, parts.cells, way.amplitude, way.lag, way.time[i + 1] - way.time[i], state.taken)
        i += 1
    return n
