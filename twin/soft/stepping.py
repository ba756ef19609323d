"""Silicone bodies from step to step, among what MuJoCo says they touch: the law of the statics, tendons with friction, contacts.

    M (v+ - v) / h = -f(u) - b K v+ - sum_t T_t pull_t(u) + contacts,        u+ = u + h v+

Elastic force and the tendons' directions are those of the present shape; damping, the tensions of held tendons and the contacts are
those at the step's end (`metric.py`, `contact.py`): with b at least the step h, that is stable. MuJoCo's part is where everything
is, what touches, and how contacts move with the nodes; things that are no silicone it only carries on.

A tendon under a given tension is a force of that size; one that is held is a stiff spring that only pulls. Friction's slip states
follow the travel from step to step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.soft.cables import follow
from twin.soft.contact import Law, balance
from twin.soft.metric import Metric, back, halfway, weighed
from twin.soft.newton import Parts, Room
from twin.soft.silicone import LEAST, forces

DONE, INVERTED, LOST, UNBALANCED = 0, 1, 2, 3  # how a step ended
SAME = 1e-9  # m: places that are one
FASTEST = 1e3  # m/s: a node that fast is lost, long before its numbers overflow


class Limb(NamedTuple):
    """One body: its parts, room, metric and place among the coordinates; which tendons are held, and their stiffness (t,) N/m; the
    lengths (t,) m they hang at; slip states and lengths beyond (t, p - 2) m; tensions (t,) N of the last step; force (nq,) N on its
    nodes besides; mu and pre-sliding."""

    parts: Parts
    room: Room
    metric: Metric
    dof: np.ndarray
    held: np.ndarray
    stiffness: np.ndarray
    hanging: np.ndarray
    slip: np.ndarray
    beyond: np.ndarray
    tension: np.ndarray
    force: np.ndarray
    mu: float
    presliding: float


class Engine(NamedTuple):
    """MuJoCo's coordinates, speeds and their bias force (nv,), the masses (nv,) that they have alone; which limb each is of, -1
    for a thing's, and where among its own; how many are things'; and the step (s)."""

    qpos: np.ndarray
    qvel: np.ndarray
    bias: np.ndarray
    mass: np.ndarray
    limb: np.ndarray
    place: np.ndarray
    things: int
    step: float


class Touch(NamedTuple):
    """MuJoCo's contacts, three rows each: the sparse rows' values, columns, starts (n,) and counts (n,); their stiffness, damping
    and impedance (n, 4), gaps (n,) m and speeds (n,) m/s; each contact's friction (c,); and `impratio`."""

    value: np.ndarray
    column: np.ndarray
    start: np.ndarray
    count: np.ndarray
    spring: np.ndarray
    gap: np.ndarray
    speed: np.ndarray
    friction: np.ndarray
    impratio: float


class Rows(NamedTuple):
    """The tendons that are held, then the contacts, three rows each: what resists them, W (n, n) 1/kg; their lags e (n,) m/s
    without force; their forces f (n,) N; and their law."""

    W: np.ndarray
    e: np.ndarray
    f: np.ndarray
    law: Law


class Felt(NamedTuple):
    """What one body makes of a step: how it ended; the rows (m,) it feels; and, by U'^-1 of its metric, its momentum at the step's
    end without them and how they move with its nodes, (nq, 1 + m)."""

    how: int
    rows: np.ndarray
    moved: np.ndarray


def advance(limbs: Sequence[Limb], engine: Engine, touch: Touch, command: np.ndarray) -> tuple[int, int]:
    """All speeds a step on, under the commands (limb, t), N or m. Returns how that ended, and for which limb, -1 for no one."""
    held = [int(limb.held.sum()) for limb in limbs]
    tendons, n = sum(held), sum(held) + len(touch.gap)
    rows = Rows(np.zeros((n, n)), np.zeros(n), np.zeros(n), Law(np.zeros(n), tendons, touch.friction))
    felt, first = [], [0, *accumulate(held)]
    for k, limb in enumerate(limbs):
        felt.append(Felt(*feel(limb, k, engine, touch, command[k], first[k], rows)))
        if felt[k].how != DONE:
            return felt[k].how, k
    if not settle(engine, touch, rows):
        return UNBALANCED, -1
    for k, limb in enumerate(limbs):
        if not after(limb, engine, felt[k], rows.f, first[k]):
            return LOST, k
    return DONE, -1


@jit
def feel(limb, k, engine, touch, command, first, rows):
    """What limb k makes of a step, its tendons' rows from `first` on; its share in the rows."""
    tendons, own = rows.law.tendons, concerned(limb, k, engine, touch, first, rows.law.tendons)
    moved = np.zeros((limb.dof.size, 1 + own.size))
    if not shape(limb, engine.qpos):
        return INVERTED, own, moved
    row = first
    for t in range(limb.held.size):
        pull(limb, t, command[t], row, 1 + row - first, engine.step, rows, moved)
        row += limb.held[t]
    fill(limb, k, engine, touch, tendons, own, moved)
    weighed(limb.metric, limb.parts.cells, limb.room.whole)
    halfway(limb.metric, moved)
    both = np.dot(moved.T, moved)
    if not np.isfinite(both.sum()):
        return LOST, own, moved
    for i in range(own.size):
        rows.e[own[i]] += both[1 + i, 0]
        for j in range(own.size):
            rows.W[own[i], own[j]] += both[1 + i, 1 + j]
    return DONE, own, moved


@jit
def once(pos, geom, flex):
    """Of contacts at places (n, 3) m between geometries and flexes (n, 2) the first at each place."""
    kept, count = np.empty(pos.shape[0], np.int64), 0
    for i in range(pos.shape[0]):
        new = True
        for k in range(count):
            j = kept[k]
            near = max(abs(pos[i, 0] - pos[j, 0]), abs(pos[i, 1] - pos[j, 1]), abs(pos[i, 2] - pos[j, 2])) < SAME
            same = geom[i, 0] == geom[j, 0] and geom[i, 1] == geom[j, 1] and flex[i, 0] == flex[j, 0] and flex[i, 1] == flex[j, 1]
            new = new and not (near and same)
        if new:
            kept[count] = i
            count += 1
    return kept[:count]


@jit
def settle(engine, touch, rows):
    """The rows' forces, and the things' speeds at the step's end. False where forces are not found."""
    carry(engine, touch, rows)
    contacts(touch, engine.step, rows)
    if rows.f.size > 0 and not balance(rows.law, engine.step * rows.W, rows.e, rows.f):
        return False
    carried(engine, touch, rows)
    return True


@jit
def shape(limb, qpos):
    """The force in room.f and what the tendons do, in room.pulled. False where a cell has turned inside out."""
    room, parts = limb.room, limb.parts
    u = room.whole[parts.clamped :]
    for a in range(limb.dof.size):
        u[a // 3, a % 3] = qpos[limb.dof[a]]
    if not forces(room.whole, parts.cells, room.relaxed, room.f, room.p) >= LEAST:
        return False
    follow(parts.cables, u, limb.slip, limb.beyond, limb.mu, limb.presliding, room.pulled)
    return True


@inner
def concerned(limb, k, engine, touch, first, tendons):
    """The rows that limb k feels: of its held tendons, from `first` on, and of its contacts."""
    count, own = limb.held.sum(), np.empty(limb.held.size + touch.gap.size, np.int64)
    for i in range(count):
        own[i] = first + i
    for r in range(touch.gap.size):
        for i in range(touch.start[r], touch.start[r] + touch.count[r]):
            if engine.limb[touch.column[i]] == k:
                own[count] = tendons + r
                count += 1
                break
    return own[:count]


@inner
def pull(limb, t, command, row, column, h, rows, moved):
    """Tendon t under its command (N or m): a force that is given, or the row of a spring and how it moves with the nodes."""
    pulled, nq = limb.room.pulled, limb.dof.size
    limb.slip[t] = pulled.slip[t]
    limb.beyond[t] = pulled.beyond[t]
    if limb.held[t]:
        rows.law.D[row] = limb.stiffness[t] * h
        rows.e[row] -= (pulled.length[t] - limb.hanging[t] + command) / h
        rows.f[row] = limb.tension[t]
        for a in range(nq):
            moved[a, column] = -pulled.pull[t, a]
    else:
        limb.tension[t] = max(0.0, command)
        for a in range(nq):
            limb.room.f[a] += limb.tension[t] * pulled.pull[t, a]


@inner
def fill(limb, k, engine, touch, tendons, own, moved):
    """The nodes' momentum at the step's end without what the rows give, and how the contacts' rows move with them."""
    h = engine.step
    for a in range(limb.dof.size):
        d = limb.dof[a]
        force = limb.force[a] - limb.room.f[a] - engine.bias[d]
        moved[a, 0] = limb.metric.mass[a] * engine.qvel[d] + h * force
    for i in range(own.size):
        r = own[i] - tendons
        if r >= 0:
            for j in range(touch.start[r], touch.start[r] + touch.count[r]):
                if engine.limb[touch.column[j]] == k:
                    moved[engine.place[touch.column[j]], 1 + i] = touch.value[j]


@inner
def carry(engine, touch, rows):
    """Things' own share in how contacts move: in what resists them and in their speeds at the step's end without contact."""
    tendons, moved = rows.law.tendons, np.zeros((rows.e.size, engine.things))
    for r in range(touch.gap.size):
        for i in range(touch.start[r], touch.start[r] + touch.count[r]):
            d = touch.column[i]
            if engine.limb[d] < 0:
                free = engine.qvel[d] - engine.step * engine.bias[d] / engine.mass[d]
                rows.e[tendons + r] += touch.value[i] * free
                moved[tendons + r, engine.place[d]] = touch.value[i] / np.sqrt(engine.mass[d])
    rows.W[:] += np.dot(moved, moved.T)


@inner
def contacts(touch, h, rows):
    """The contacts' D, and their lags from their speeds."""
    tendons, D = rows.law.tendons, rows.law.D
    for r in range(touch.gap.size):
        damping, impedance = touch.spring[r, 1], touch.spring[r, 2]
        spring, own, normal = touch.spring[r, 0] * impedance, tendons + r, tendons + r - r % 3
        hard = 1.0 / h + damping + h * spring
        rows.e[own] -= (touch.speed[r] / h - spring * touch.gap[r]) / hard
        D[own] = touch.impratio * D[normal] if r % 3 else hard * impedance / ((1.0 - impedance) * rows.W[own, own])


@inner
def carried(engine, touch, rows):
    """The things' speeds at the step's end."""
    for d in range(engine.mass.size):
        if engine.limb[d] < 0:
            engine.qvel[d] -= engine.step * engine.bias[d] / engine.mass[d]
    for r in range(touch.gap.size):
        for i in range(touch.start[r], touch.start[r] + touch.count[r]):
            d = touch.column[i]
            if engine.limb[d] < 0:
                engine.qvel[d] += engine.step * touch.value[i] * rows.f[rows.law.tendons + r] / engine.mass[d]


@jit
def after(limb, engine, felt, f, row):
    """The nodes' speeds, and the tensions of held tendons. False where a node has no finite place or speed."""
    v = felt.moved[:, 0].copy()
    for i in range(felt.rows.size):
        for a in range(v.size):
            v[a] += engine.step * f[felt.rows[i]] * felt.moved[a, 1 + i]
    back(limb.metric, v)
    for a in range(v.size):
        d = limb.dof[a]
        if not (abs(v[a]) < FASTEST and abs(engine.qpos[d]) < FASTEST):
            return False
        engine.qvel[d] = v[a]
    for t in range(limb.held.size):
        if limb.held[t]:
            limb.tension[t] = f[row]
            row += 1
    return True
