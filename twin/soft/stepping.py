"""Silicone bodies between MuJoCo's steps: the true elastic force in place of the flex's own, and tendons with friction.

A step is MuJoCo's, in two halves. Before the first each body's force f(u) and tendons are found at its present shape; MuJoCo then
knows the flex's own force, and to `qfrc_applied` goes what the true one differs from it by:

    M (v+ - v) / h = f_flex + (-f(u) - f_flex) - sum_t T_t pull_t(u) - (h D + h^2 K) / h v+ + contact

A tendon under a given tension is a force of that size. One that is held is a MuJoCo tendon along its present pull, a spring at its
free length, which `discrete` integrates implicitly: T = stiffness (length - free) at the step's end. It is slack, no spring, from
where its tension comes out negative to where it is longer than free. Friction's slip states follow the travel from step to step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.engine import mj_step1, mj_step2
from twin.soft.cables import follow
from twin.soft.flex import OPEN, Wraps
from twin.soft.newton import Parts, Room
from twin.soft.silicone import LEAST, forces

DONE, INVERTED, LOST = 0, 1, 2  # how a run of steps ended
FASTEST = 1e3  # m/s: a node that fast is lost, long before its numbers overflow


class Limb(NamedTuple):
    """One body: its parts, room and place; which tendons are held, and their stiffness (t,) N/m; the lengths (t,) m they hang at;
    slip states and lengths beyond (t, p - 2) m; tensions (t,) N of the last step; force (nq,) N on its nodes besides; mu and
    pre-sliding."""

    parts: Parts
    room: Room
    dof: np.ndarray
    wraps: Wraps
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
    """MuJoCo's model and data, and its own arrays that are read and written between half steps."""

    model: int
    data: int
    qpos: np.ndarray
    qvel: np.ndarray
    spring: np.ndarray  # qfrc_spring (nv,)
    applied: np.ndarray  # qfrc_applied (nv,)
    wrap: np.ndarray  # wrap_prm (n_wrap,)
    length: np.ndarray  # ten_length (n_tendon,)
    band: np.ndarray  # tendon_lengthspring (n_tendon, 2)


@jit
def advance(limbs, engine, start, end, n):
    """n steps while the commands go straight from `start` to `end` (limb, t). Returns how it ended, at which step, and which
    limb."""
    for step in range(n):
        share = (step + 1.0) / n
        for k in range(len(limbs)):
            if not before(limbs[k], engine, start[k], end[k], share):
                return INVERTED, k
        mj_step1(engine.model, engine.data)
        for k in range(len(limbs)):
            between(limbs[k], engine)
        mj_step2(engine.model, engine.data)
        for k in range(len(limbs)):
            if not after(limbs[k], engine):
                return LOST, k
    return DONE, -1


@inner
def before(limb, engine, start, end, share):
    """Force and tendons at the present shape. False where a cell has turned inside out."""
    room, wraps = limb.room, limb.wraps
    if not shape(limb, engine):
        return False
    pulled, nq = room.pulled, limb.dof.size
    limb.slip[:] = pulled.slip
    limb.beyond[:] = pulled.beyond
    for a in range(nq):
        room.f[a] -= limb.force[a]
    for t in range(limb.held.size):
        command = (1.0 - share) * start[t] + share * end[t]
        if not limb.held[t]:
            limb.tension[t] = max(0.0, command)
            for a in range(nq):
                room.f[a] += limb.tension[t] * pulled.pull[t, a]
            continue
        for w in range(wraps.place.shape[1]):
            if wraps.place[t, w] >= 0:
                engine.wrap[wraps.place[t, w]] = pulled.pull[t, wraps.unknown[t, w]]
        here = 0.0
        for a in range(nq):
            here += pulled.pull[t, a] * engine.qpos[limb.dof[a]]
        gap = limb.hanging[t] - command - pulled.length[t]
        taut = limb.tension[t] > 0.0 or gap < 0.0
        engine.band[wraps.tendon[t], 0] = here + gap if taut else -OPEN
        engine.band[wraps.tendon[t], 1] = here + gap if taut else OPEN
    return True


@jit
def shape(limb, engine):
    """The force in room.f and what the tendons do, in room.pulled. False where a cell has turned inside out."""
    room, parts = limb.room, limb.parts
    u = room.whole[parts.clamped :]
    for a in range(limb.dof.size):
        u[a // 3, a % 3] = engine.qpos[limb.dof[a]]
    if not forces(room.whole, parts.cells, room.relaxed, room.f, room.p) >= LEAST:
        return False
    follow(parts.cables, u, limb.slip, limb.beyond, limb.mu, limb.presliding, room.pulled)
    return True


@inner
def between(limb, engine):
    """The force in place of the flex's own: MuJoCo's springs are those of the flex and of the held tendons."""
    for a in range(limb.dof.size):
        engine.applied[limb.dof[a]] = -limb.room.f[a] - engine.spring[limb.dof[a]]
    for t in range(limb.held.size):
        if limb.held[t]:
            beyond = engine.length[limb.wraps.tendon[t]] - engine.band[limb.wraps.tendon[t], 1]
            if beyond > -OPEN / 2:
                for a in range(limb.dof.size):
                    engine.applied[limb.dof[a]] -= limb.stiffness[t] * beyond * limb.room.pulled.pull[t, a]


@inner
def after(limb, engine):
    """Tensions of held tendons at the step's end. False where a node has no finite place or speed."""
    for a in range(limb.dof.size):
        if not (abs(engine.qvel[limb.dof[a]]) < FASTEST and abs(engine.qpos[limb.dof[a]]) < FASTEST):
            return False
    for t in range(limb.held.size):
        if limb.held[t]:
            here = 0.0
            for a in range(limb.dof.size):
                here += limb.room.pulled.pull[t, a] * engine.qpos[limb.dof[a]]
            limb.tension[t] = limb.stiffness[t] * max(0.0, here - engine.band[limb.wraps.tendon[t], 1])
    return True
