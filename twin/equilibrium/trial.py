"""A trial, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together. SMA springs pull from the beginning, cold: with them gravity and payload
come in `RAMP` equal steps. Their temperature advances once a sample, under the current and at the elongation of the sample before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, jit
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import Law, Load, balance
from twin.equilibrium.elastic import bendings
from twin.equilibrium.lengths import Held, hold_once, move, reach, remember, tangent
from twin.equilibrium.move import onward
from twin.equilibrium.newton import follow, is_minimum, place, solve, step_once
from twin.springs.heat import heated
from twin.springs.spring import Spring

RAMP = 8  # steps from slack to the first tensions; 8 against 512 moved the tip by at most 0.015 mm in 180 random poses, mu 0.2

RAMP_TOLERANCE = 1e-6  # rad
FINE = 1e-7  # rad, where tensions are sought


class Drive(NamedTuple):
    """What a trial is driven by, sample by sample."""

    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) base tension in N, displacement in m, or current in A
    by_length: np.ndarray  # (n_tendon,) whether it is a displacement
    by_spring: np.ndarray  # (n_tendon,) whether it is the current of an SMA spring
    straight: np.ndarray  # (n_tendon,) m, path lengths on the straight robot
    stretch: float  # m/N, of a tendon
    least_stretch: float  # m/N, of one that a motor holds at a length
    stiffness: np.ndarray  # (n,) of the body over that at its reference temperature
    ambient: np.ndarray  # (n,) K, around the springs
    spring: Spring


@jit
def creep(delayed, instant, amplitude, time, dt):
    """Advance the delayed strains (n_element, nv) by dt under the instant strain (nv,)."""
    for m in range(amplitude.size):
        for i in range(instant.size):
            delayed[m, i] = retard(delayed[m, i], instant[i], amplitude[m], time[m], dt)


@jit
def rested(spring, delayed, rest):
    """Rest angles (nv,) after creep: the springs' own plus all delayed strains."""
    for i in range(spring.size):
        rest[i] = spring[i]
        for m in range(delayed.shape[0]):
            rest[i] += delayed[m, i]


@jit
def softened(load, law, now_load, now_law, held, least_stretch, factor, weight):
    """The share `weight` of the loads, on a body that is 1/factor as stiff: statics knows loads over stiffness only, and friction
    has no scale of force."""
    for a in range(3):
        now_load.gravity[a] = load.gravity[a] * factor * weight
        now_load.force[a] = load.force[a] * factor * weight
    now_law.wall[4] = law.wall[4] * factor
    held.factor[0] = factor
    for t in range(held.stretch.size):
        if not held.by_spring[t]:
            held.stretch[t] = max(held.elastic, least_stretch) / factor


@jit
def run(
    model, data, chain, spring, law, load, amplitude, retardation, delayed, drive, guess, guess_T, guess_LU, tol, keep, once, z, s,
    LUs, q_out, T_out, marker, path, warm_out, status,
):  # fmt: skip
    """Solve a whole trial.

    `spring` (nv,) rest angles; `delayed` (n_element, nv) creep strains, advanced in place. `guess` (n, nv), `guess_T`
    (n, n_tendon) and `guess_LU` (n, nv, nv), empty or from a neighbouring solution, replace extrapolation as first guess; with
    `once` a single Newton step is taken from them: exact to first order in the neighbours' difference.
    With `keep` a tangent factorised at each solution goes to LUs (n, nv, nv).
    Out: slip states z and distal lengths s (n_tendon, n_disk) at the end, angles q_out (n, nv), base tensions T_out (n, n_tendon),
    markers (n, n_marker, 3), path lengths and temperatures of springs (n, n_tendon), status (n,) as `solve` returns it.
    Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near straight.
    """
    n, nv, nt = drive.time.size, spring.size, drive.command.shape[1]
    q, q1, q2, rest, instant = np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv)
    LU, fresh, T, T1, free = np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt), np.zeros(nt), drive.straight.copy()
    which, held_by, warm = np.zeros(nt, np.bool_), np.zeros(nt, np.bool_), np.full(nt, drive.ambient[0])
    by_spring = False
    for t in range(nt):
        which[t] = drive.by_spring[t]
        by_spring = by_spring or drive.by_spring[t]
    held = Held(
        which, drive.by_spring, free.copy(), np.empty(nt), drive.straight, drive.stretch, np.ones(1), drive.spring, warm.copy(),
        drive.spring.initial_elongation.copy(), drive.spring.initial_tension.copy(),
    )  # fmt: skip
    r, z1, s1, none = np.empty(nv), np.empty(z.shape), np.empty(z.shape), np.empty((0, 0))
    D = np.empty((chain.hand.size, 3, 3))
    now_load = Load(load.gravity.copy(), load.payload, load.force.copy())
    now_law = Law(law.mu, law.presliding, law.wall.copy())
    factor = 1.0 / drive.stiffness[0]
    softened(load, law, now_load, now_law, held, drive.least_stretch, factor, 1.0)
    rested(spring, delayed, rest)
    assign(q, rest)
    place(model, data, chain, q)
    for t in range(nt):
        for d in range(z.shape[1]):
            z[t, d] = 0.0
        if by_spring and drive.by_spring[t]:
            T[t] = factor * held.tension[t]
    balance(q, rest, chain, T, now_law, now_load, z, s, z1, s1, r, none)
    for t in range(nt):
        assign(s[t], s1[t])
    started, fine = 1, min(tol, FINE)  # a rough shape has no sharp tensions
    if by_spring:
        for k in range(1, RAMP + 1):
            softened(load, law, now_load, now_law, held, drive.least_stretch, factor, k / RAMP)
            assign(q1, q)
            found = reach(
                model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, fresh, fine, T, held, q1, free, warm
            )  # fmt: skip
            started = 0 if found == 0 else started
            remember(held, s, T)
    elif law.mu > 0.0 or not guess.size:  # without friction a trial has no memory of its start
        started = solve(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, tol)
        if started == 1 and not is_minimum(model, data, chain, rest, T, now_law, now_load, z, s, q, LU):
            started = 2 if follow(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, tol) else 0
    lengths, others = by_spring, False
    for t in range(nt):
        which[t] = drive.by_length[t] or drive.by_spring[t]
        lengths = lengths or which[t]
        others = others or not drive.by_spring[t]
    for t in range(nt):  # tendons held by their motors have not moved while the weight came on
        if lengths and not drive.by_spring[t]:
            assign(s[t], s1[t])
            for d in range(z.shape[1]):
                z[t, d] = 0.0
    if others and (by_spring or law.mu > 0.0 or not guess.size):
        steps = RAMP if law.mu > 0.0 or lengths else 1
        for k in range(0 if lengths else 1, steps + 1):
            for t in range(nt):
                if drive.by_length[t]:
                    free[t] = drive.straight[t] - drive.command[0, t] * (k / steps)
                elif not drive.by_spring[t]:
                    T[t] = factor * drive.command[0, t] * (k / steps)
            if lengths:
                assign(q1, q)
                found = reach(
                    model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, fresh, fine, T, held, q1, free, warm
                )  # fmt: skip
                remember(held, s, T)
            else:
                for t in range(nt):
                    T1[t] = factor * drive.command[0, t] * ((k - 1) / steps)
                assign(q1, q)
                found = onward(model, data, chain, rest, now_law, now_load, T1, q1, RAMP_TOLERANCE, T, q, z, s, LU, fresh)
            if found == 0:
                started = 0
    assign(q1, q)
    assign(q2, q)
    for i in range(n):
        if amplitude.size and i > 0:
            bendings(q1, chain, instant, D)
            for k in range(nv):
                instant[k] -= rest[k]
            creep(delayed, instant, amplitude, retardation, drive.time[i] - drive.time[i - 1])
            rested(spring, delayed, rest)
        if guess.size:
            assign(q, guess[i])
            for k in range(nv):
                assign(LU[k], guess_LU[i, k])
            fresh[0] = True
        else:
            for k in range(nv):
                q[k] = 2.0 * q1[k] - q2[k]
        assign(q2, q1)
        factor = 1.0 / drive.stiffness[i]
        softened(load, law, now_load, now_law, held, drive.least_stretch, factor, 1.0)
        for t in range(nt):
            if drive.by_spring[t] and i > 0:
                dt = drive.time[i] - drive.time[i - 1]
                warm[t] = heated(drive.spring, t, warm[t], held.elongation[t], drive.command[i - 1, t], drive.ambient[i - 1], dt)
            elif drive.by_length[t]:
                free[t] = drive.straight[t] - drive.command[i, t]
            elif not drive.by_spring[t]:
                T[t] = factor * drive.command[i, t]
            if guess.size and which[t]:
                T[t] = factor * guess_T[i, t]
                held_by[t] = T[t] > 0.0
        if lengths and once and guess.size:
            move(held, free, warm, free, warm, 1.0)
            status[i] = hold_once(model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, T, held)
        elif lengths:
            status[i] = reach(
                model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, fresh, fine, T, held, q1, free, warm
            )  # fmt: skip
        elif once and guess.size:
            status[i] = step_once(model, data, chain, rest, T, now_law, now_load, z, s, q, LU)
        else:
            for t in range(nt):
                T1[t] = factor * drive.command[max(0, i - 1), t]
            status[i] = onward(model, data, chain, rest, now_law, now_load, T1, q1, tol, T, q, z, s, LU, fresh)
        if status[i] == 0:
            assign(q, q1)
        if keep:
            if lengths:
                kept = tangent(model, data, chain, rest, now_law, now_load, z, s, q, T, which, LUs[i], held_by)
            else:
                kept = is_minimum(model, data, chain, rest, T, now_law, now_load, z, s, q, LUs[i])
            if not kept:
                for k in range(nv):
                    assign(LUs[i, k], LU[k])
        remember(held, s, T)
        assign(q1, q)
        assign(q_out[i], q)
        for k in range(chain.marker.size):
            assign(marker[i, k], chain.site[chain.marker[k]])
        for t in range(nt):
            path[i, t] = s[t, 0]
            T_out[i, t] = T[t] / factor
            warm_out[i, t] = warm[t]
    return started
