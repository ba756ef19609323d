"""Silicone bodies from step to step, among what MuJoCo says they touch: the law of the statics, tendons with friction, contacts.

    M (v+ - v) / h = -f(u) - b K v+ - sum_t T_t pull_t(u) + contacts,        u+ = u + h v+

Elastic force and the tendons' directions are those of the present shape; damping, the tensions of held tendons and the contacts are
those at the step's end (`metric.py`, `contact.py`): with b at least the step h, that is stable. MuJoCo's part is where everything
is, what touches, and how contacts move with the nodes; things that are no silicone it only carries on.

A tendon under a given tension is a force of that size; one that is held is a stiff spring that only pulls. Friction's slip states
follow the travel from step to step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.soft.cables import follow
from twin.soft.contact import Law, balance
from twin.soft.metric import Metric, back, halfway, weighed
from twin.soft.newton import Parts, Room
from twin.soft.silicone import LEAST, forces

DONE, INVERTED, LOST, UNBALANCED = 0, 1, 2, 3  # how a step ended
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
    """MuJoCo's contacts, three rows each: the sparse rows' values, columns, starts (n,) and counts (n,); their stiffness, damping and
    impedance (n, 4), gaps (n,) m and speeds (n,) m/s; each contact's friction (c,); and `impratio`."""

    value: np.ndarray
    column: np.ndarray
    start: np.ndarray
    count: np.ndarray
    spring: np.ndarray
    gap: np.ndarray
    speed: np.ndarray
    friction: np.ndarray
    impratio: float


@jit
def advance(limbs, engine, touch, start, end, share):
    """All speeds a step on; commands are `share` of the way from `start` to `end` (limb, t). Returns how
    it ended, and with which limb, -1 for no one."""
    tendons = 0
    for k in range(len(limbs)):
        tendons += limbs[k].held.sum()
    n, h = tendons + touch.gap.size, engine.step
    law = Law(np.zeros(n), tendons, touch.friction)
    W, e, f = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    carry(engine, touch, tendons, W, e)
    columns, rows, first = [np.empty((0, 0))], [np.empty(0, np.int64)], 0
    for k in range(len(limbs)):
        limb = limbs[k]
        if not shape(limb, engine.qpos):
            return INVERTED, k
        own = concerned(limb, k, engine, touch, first, tendons)
        moved = np.zeros((limb.dof.size, 1 + own.size))
        for t in range(limb.held.size):
            command = (1.0 - share) * start[k, t] + share * end[k, t]
            pull(limb, t, command, first, h, law, e, f, moved)
            first += limb.held[t]
        fill(limb, k, engine, touch, tendons, own, moved)
        weighed(limb.metric, limb.parts.cells, limb.room.whole)
        halfway(limb.metric, moved)
        if not np.isfinite(moved.sum()):
            return LOST, k
        both = np.dot(moved.T, moved)
        for i in range(own.size):
            e[own[i]] += both[1 + i, 0]
            for j in range(own.size):
                W[own[i], own[j]] += both[1 + i, 1 + j]
        columns.append(moved)
        rows.append(own)
    contacts(touch, h, tendons, W, e, law)
    if n > 0 and not balance(law, h * W, e, f):
        return UNBALANCED, -1
    first = 0
    for k in range(len(limbs)):
        own, v = rows[k + 1], columns[k + 1][:, 0].copy()
        for i in range(own.size):
            v += h * f[own[i]] * columns[k + 1][:, 1 + i]
        back(limbs[k].metric, v)
        if not after(limbs[k], engine, v, f, first):
            return LOST, k
        first += limbs[k].held.sum()
    carried(engine, touch, tendons, f)
    return DONE, -1


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
def pull(limb, t, command, row, h, law, e, f, moved):
    """Tendon t under its command (N or m): a force that is given, or the row of a spring and how it moves with the nodes."""
    pulled, nq = limb.room.pulled, limb.dof.size
    limb.slip[t] = pulled.slip[t]
    limb.beyond[t] = pulled.beyond[t]
    if not limb.held[t]:
        limb.tension[t] = max(0.0, command)
        for a in range(nq):
            limb.room.f[a] += limb.tension[t] * pulled.pull[t, a]
        return
    law.D[row] = limb.stiffness[t] * h
    e[row] -= (pulled.length[t] - limb.hanging[t] + command) / h
    f[row] = limb.tension[t]
    column = 1
    for s in range(t):
        column += limb.held[s]
    for a in range(nq):
        moved[a, column] = -pulled.pull[t, a]


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
def carry(engine, touch, tendons, W, e):
    """Things' own share in how contacts move: into W (n, n) and, for the speeds at the step's end without contact, e (n,)."""
    moved = np.zeros((W.shape[0], engine.things))
    for r in range(touch.gap.size):
        for i in range(touch.start[r], touch.start[r] + touch.count[r]):
            d = touch.column[i]
            if engine.limb[d] < 0:
                e[tendons + r] += touch.value[i] * (engine.qvel[d] - engine.step * engine.bias[d] / engine.mass[d])
                moved[tendons + r, engine.place[d]] = touch.value[i] / np.sqrt(engine.mass[d])
    W += np.dot(moved, moved.T)


@inner
def contacts(touch, h, tendons, W, e, law):
    """The contacts' D, and their lags from their speeds."""
    for c in range(touch.friction.size):
        for i in range(3):
            r = 3 * c + i
            damping, impedance = touch.spring[r, 1], touch.spring[r, 2]
            spring = touch.spring[r, 0] * impedance
            hard = 1.0 / h + damping + h * spring
            e[tendons + r] -= (touch.speed[r] / h - spring * touch.gap[r]) / hard
            if i == 0:
                own = tendons + r
                law.D[own] = hard * impedance / ((1.0 - impedance) * W[own, own])
            else:
                law.D[tendons + r] = touch.impratio * law.D[tendons + 3 * c]


@inner
def after(limb, engine, v, f, row):
    """The nodes' speeds, and the tensions of held tendons. False where a node has no finite place or speed."""
    for a in range(limb.dof.size):
        d = limb.dof[a]
        if not (abs(v[a]) < FASTEST and abs(engine.qpos[d]) < FASTEST):
            return False
        engine.qvel[d] = v[a]
    for t in range(limb.held.size):
        if limb.held[t]:
            limb.tension[t] = f[row]
            row += 1
    return True


@inner
def carried(engine, touch, tendons, f):
    """The things' speeds at the step's end."""
    for d in range(engine.mass.size):
        if engine.limb[d] < 0:
            engine.qvel[d] -= engine.step * engine.bias[d] / engine.mass[d]
    for r in range(touch.gap.size):
        for i in range(touch.start[r], touch.start[r] + touch.count[r]):
            d = touch.column[i]
            if engine.limb[d] < 0:
                engine.qvel[d] += engine.step * touch.value[i] * f[tendons + r] / engine.mass[d]
