"""Trials solved from the kept answers to a neighbouring problem: a fraction of what a trial costs from its start.

At each sample the kept inverse of the neighbour's tangent stands for the present one. The residual is the present one, so what is
found is right; where the steps do not shrink, the sample is left to `statics.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.soft.cables import Cables, Pulled, follow
from twin.soft.creep import relax_for
from twin.soft.silicone import LEAST, Cells, forces
from twin.soft.wall import Skin, press

STEPS = 25
SLOW = 0.9  # steps that shrink by less than this each are given up
LONGEST = 3e-3  # m


class Parts(NamedTuple):
    """A body: cells, cables, skin, and how many nodes are clamped."""

    cells: Cells
    cables: Cables
    skin: Skin
    clamped: int


class Way(NamedTuple):
    """What is asked at each sample: tensions and free lengths (n, t) and which of them are `held`; stretch (n, t) m/N; forces
    (n_free, 3) N, wall (5,) and the stiffness (n,) they count over; friction and pre-sliding; times (n,) s, amplitude and time
    (k,) of creep; the step (m) that counts as none, and whether one step is all that is taken."""

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


class Kept(NamedTuple):
    """A neighbour's shapes (n, nq) m, tensions (n, t) N and inverse tangents (n, nq, nq)."""

    u: np.ndarray
    tension: np.ndarray
    inverse: np.ndarray


class Room(NamedTuple):
    """Arrays to work in: forces (nq,), pressures (c, 4), all nodes (n_node, 3), nothing (1, 1), what the tendons do."""

    f: np.ndarray
    p: np.ndarray
    whole: np.ndarray
    none: np.ndarray
    pulled: Pulled


@jit
def along(parts, way, kept, i, slip, taken, found, room):
    """From sample i on as far as it goes; fills `found` (u (n, nq), tensions (n, t), lengths (n, t)) and advances slip and `taken`
    (k, c, q, 6). Returns the first sample that was not found, n if all were."""
    n = way.time.size
    out_u, out_tension, out_length = found
    relaxed = np.empty((0, 0, 6)) if taken.shape[0] == 0 else np.empty(taken.shape[1:])
    while i < n:
        if taken.shape[0] > 0:
            relaxed[:] = taken.sum(axis=0)
        u, T = kept.u[i].copy(), kept.tension[i] / way.scale[i]
        for t in range(T.size):
            if not way.held[t]:
                T[t] = way.tension[i, t] / way.scale[i]
        if not near(parts, way, kept.inverse[i], i, slip, relaxed, u, T, room):
            return i
        follow(parts.cables, u.reshape(-1, 3), slip, way.mu, way.presliding, room.pulled)
        slip.state[:] = room.pulled.slip.state
        slip.beyond[:] = room.pulled.slip.beyond
        out_u[i], out_length[i] = u, room.pulled.length
        out_tension[i] = T * way.scale[i]
        if taken.shape[0] > 0 and i + 1 < n:
            room.whole[parts.clamped :] = u.reshape(-1, 3)
            relax_for(room.whole, parts.cells, way.amplitude, way.lag, way.time[i + 1] - way.time[i], taken)
        i += 1
    return n


@inner
def near(parts, way, inverse, i, slip, relaxed, u, T, room):
    """Bring u (nq,) and T (t,) to equilibrium at sample i by steps of one kept tangent. False where they do not shrink."""
    nt, last = T.size, 1e9
    reach, dT = np.empty((nt, u.size)), np.empty(nt)
    taut, gap, C = np.empty(nt, np.bool_), np.empty(nt), np.empty((nt, nt))
    for _ in range(STEPS):
        room.whole[parts.clamped :] = u.reshape(-1, 3)
        if forces(room.whole, parts.cells, relaxed, room.f, room.p) < LEAST:
            return False
        follow(parts.cables, u.reshape(-1, 3), slip, way.mu, way.presliding, room.pulled)
        r = room.f - way.force.ravel() / way.scale[i]
        if way.wall[4] > 0.0:
            wall = way.wall.copy()
            wall[4] /= way.scale[i]
            press(parts.skin, u.reshape(-1, 3), wall, r, room.none, False)
        for t in range(nt):
            r += T[t] * room.pulled.pull[t]
        du = -np.dot(inverse, r.astype(np.float32)).astype(np.float64)
        for t in range(nt):
            if way.held[t] and T[t] > 0.0:
                reach[t] = np.dot(inverse, room.pulled.pull[t].astype(np.float32))
        for t in range(nt):
            gap[t] = room.pulled.length[t] - way.free[i, t] - way.stretch[i, t] * T[t] + np.dot(room.pulled.gradient[t], du)
            taut[t] = way.held[t] and (T[t] > 0.0 or gap[t] > 0.0)
            if taut[t] and T[t] == 0.0:
                reach[t] = np.dot(inverse, room.pulled.pull[t].astype(np.float32))
        tauten(way, room.pulled.gradient, reach, gap, T, taut, C, dT, i)
        for t in range(nt):
            if way.held[t] and (taut[t] or T[t] > 0.0):
                du -= dT[t] * reach[t]
        length = np.abs(du).max()
        if not length < min(LONGEST, SLOW * last + way.close):
            return False
        u += du
        for t in range(nt):
            if way.held[t]:
                T[t] = max(0.0, T[t] + dT[t])
        if way.once or length < way.close:
            return True
        last = length
    return False


@inner
def tauten(way, gradient, reach, gap, T, taut, C, dT, i):
    """Changes of tension dT (t,) that close the gaps of the tendons that end up taut; those that would push end up slack."""
    nt = T.size
    for _ in range(2 * nt):
        on = np.flatnonzero(taut)
        for t in range(nt):
            dT[t] = -T[t] if way.held[t] else 0.0
        if on.size:
            C = np.empty((on.size, on.size))
            b = np.empty(on.size)
            for k in range(on.size):
                t = on[k]
                b[k] = gap[t]
                for s in range(nt):
                    if way.held[s] and not taut[s] and T[s] > 0.0:
                        b[k] -= np.dot(gradient[t], reach[s]) * dT[s]
                for m in range(on.size):
                    C[k, m] = np.dot(gradient[t], reach[on[m]]) + (way.stretch[i, t] if k == m else 0.0)
            x = np.linalg.solve(C, b)
            for k in range(on.size):
                dT[on[k]] = x[k]
        pushes = False
        for t in range(nt):
            if taut[t] and T[t] + dT[t] < 0.0:
                taut[t], pushes = False, True
        if not pushes:
            return
