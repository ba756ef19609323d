"""A trial, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, jit
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import Law, Load, balance
from twin.equilibrium.elastic import bendings
from twin.equilibrium.lengths import hold_once, reach, tangent
from twin.equilibrium.newton import follow, is_minimum, place, solve, step_once

RAMP = 8  # steps from slack to the first tensions; 8 against 512 moved the tip by at most 0.015 mm in 180 random poses, mu 0.2

RAMP_TOLERANCE = 1e-6  # rad
FINE = 1e-7  # rad, where tensions are sought


class Drive(NamedTuple):
    """What a trial is driven by, sample by sample."""

    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) base tension in N, or displacement in m
    by_length: np.ndarray  # (n_tendon,) whether it is a displacement
    straight: np.ndarray  # (n_tendon,) m, path lengths on the straight robot
    stretch: float  # m/N, of a tendon
    stiffness: np.ndarray  # (n,) of the body over that at its reference temperature


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
def softened(load, law, now_load, now_law, factor):
    """Loads on a body that is 1/factor as stiff: statics knows loads over stiffness only, and friction has no scale of force."""
    for a in range(3):
        now_load.gravity[a] = load.gravity[a] * factor
        now_load.force[a] = load.force[a] * factor
    now_law.wall[4] = law.wall[4] * factor


@jit
def run(
    model, data, chain, spring, law, load, amplitude, retardation, delayed, drive, guess, guess_T, guess_LU, tol, keep, once, z, s,
    LUs, q_out, T_out, marker, path, status,
):  # fmt: skip
    """Solve a whole trial.

    `spring` (nv,) rest angles; `delayed` (n_element, nv) creep strains, advanced in place. `guess` (n, nv), `guess_T`
    (n, n_tendon) and `guess_LU` (n, nv, nv), empty or from a neighbouring solution, replace extrapolation as first guess; with
    `once` a single Newton step is taken from them: exact to first order in the neighbours' difference.
    With `keep` a tangent factorised at each solution goes to LUs (n, nv, nv).
    Out: slip states z and distal lengths s (n_tendon, n_disk) at the end, angles q_out (n, nv), base tensions T_out (n, n_tendon),
    markers (n, n_marker, 3), path lengths (n, n_tendon), status (n,) as `solve` returns it.
    Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near straight.
    """
    n, nv, nt = drive.time.size, spring.size, drive.command.shape[1]
    q, q1, q2, rest, instant = np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv)
    LU, fresh, T, free = np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt), drive.straight.copy()
    held, held_by = drive.straight.copy(), np.zeros(nt, np.bool_)
    r, z1, s1, none = np.empty(nv), np.empty(z.shape), np.empty(z.shape), np.empty((0, 0))
    D = np.empty((chain.hand.size, 3, 3))
    now_load = Load(load.gravity.copy(), load.payload, load.force.copy())
    now_law = Law(law.mu, law.presliding, law.wall.copy())
    by_length = False
    for t in range(nt):
        by_length = by_length or drive.by_length[t]
    factor = 1.0 / drive.stiffness[0]
    softened(load, law, now_load, now_law, factor)
    rested(spring, delayed, rest)
    assign(q, rest)
    place(model, data, chain, q)
    for t in range(nt):
        for d in range(z.shape[1]):
            z[t, d] = 0.0
    balance(q, rest, chain, T, now_law, now_load, z, s, z1, s1, r, none)
    for t in range(nt):
        assign(s[t], s1[t])
    started, fine = 1, min(tol, FINE)  # a rough shape has no sharp tensions
    if law.mu > 0.0 or not guess.size:  # without friction a trial has no memory of its start
        started = solve(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, tol)
        if started == 1 and not is_minimum(model, data, chain, rest, T, now_law, now_load, z, s, q, LU):
            started = 2 if follow(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, tol) else 0
        if by_length:  # tendons held by their motors have not moved while the weight came on
            for t in range(nt):
                assign(s[t], s1[t])
                for d in range(z.shape[1]):
                    z[t, d] = 0.0
        steps = RAMP if law.mu > 0.0 or by_length else 1
        for k in range(0 if by_length else 1, steps + 1):
            for t in range(nt):
                if drive.by_length[t]:
                    free[t] = drive.straight[t] - drive.command[0, t] * (k / steps)
                else:
                    T[t] = factor * drive.command[0, t] * (k / steps)
            if by_length:
                assign(q1, q)
                found = reach(
                    model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, fresh, fine, T, drive.by_length, q1, held,
                    free, drive.stretch / factor,
                )  # fmt: skip
                assign(held, free)
            else:
                found = solve(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, RAMP_TOLERANCE)
            if found == 0:
                started = 0
    assign(q1, q)
    assign(q2, q)
    for i in range(n):
        if amplitude.size and i > 0:
            bendings(q1, chain.hand, instant, D)
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
        softened(load, law, now_load, now_law, factor)
        for t in range(nt):
            if drive.by_length[t]:
                free[t] = drive.straight[t] - drive.command[i, t]
                if guess.size:
                    T[t] = factor * guess_T[i, t]
                    held_by[t] = T[t] > 0.0
            else:
                T[t] = factor * drive.command[i, t]
        if by_length and once and guess.size:
            status[i] = hold_once(
                model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, T, drive.by_length, free, drive.stretch / factor
            )  # fmt: skip
        elif by_length:
            status[i] = reach(
                model, data, chain, rest, now_law, now_load, z, s, q, LU, held_by, fresh, fine, T, drive.by_length, q1, held, free,
                drive.stretch / factor,
            )  # fmt: skip
            assign(held, free)
        elif once and guess.size:
            status[i] = step_once(model, data, chain, rest, T, now_law, now_load, z, s, q, LU)
        else:
            status[i] = solve(model, data, chain, rest, T, now_law, now_load, z, s, q, LU, fresh, tol)
        if status[i] == 0:
            assign(q, q1)
        if keep:
            if by_length:
                kept = tangent(model, data, chain, rest, now_law, now_load, z, s, q, T, drive.by_length, LUs[i], held_by)
            else:
                kept = is_minimum(model, data, chain, rest, T, now_law, now_load, z, s, q, LUs[i])
            if not kept:
                for k in range(nv):
                    assign(LUs[i, k], LU[k])
        assign(q1, q)
        assign(q_out[i], q)
        for k in range(chain.marker.size):
            assign(marker[i, k], chain.site[chain.marker[k]])
        for t in range(nt):
            path[i, t] = s[t, 0]
            T_out[i, t] = T[t] / factor
    return started
