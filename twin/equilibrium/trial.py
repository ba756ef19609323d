"""A trial, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import assign, jit
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import balance
from twin.equilibrium.elastic import bendings
from twin.equilibrium.newton import follow, is_minimum, place, solve

RAMP = 8  # steps from slack to the first tensions; 8 against 64 moved the tip by at most 0.005 mm in 40 random poses, mu 0.2

RAMP_TOLERANCE = 1e-6  # rad


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
def run(
    model, data, chain, spring, law, load, amplitude, retardation, delayed, time, tension, guess, guess_LU, tol, keep, z, s, LUs,
    q_out, marker, path, status,
):  # fmt: skip
    """Solve a whole trial.

    `spring` (nv,) rest angles; `delayed` (n_element, nv) creep strains, advanced in place; `time` (n,), `tension` (n, n_tendon).
    `guess` (n, nv) and `guess_LU` (n, nv, nv), empty or from a neighbouring solution, replace extrapolation as first guess.
    With `keep` a tangent factorised at each solution goes to LUs (n, nv, nv).
    Out: slip states z and distal lengths s (n_tendon, n_disk) at the end, angles q_out (n, nv), markers
    (n, n_marker, 3), path lengths (n, n_tendon), status (n,) as `solve` returns it.
    Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near straight.
    """
    n, nv, nt = tension.shape[0], spring.size, tension.shape[1]
    q, q1, q2, rest, instant = np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv), np.empty(nv)
    LU, fresh, T = np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt)
    r, z1, s1, none = np.empty(nv), np.empty(z.shape), np.empty(z.shape), np.empty((0, 0))
    D = np.empty((chain.hand.size, 3, 3))
    rested(spring, delayed, rest)
    assign(q, rest)
    place(model, data, chain, q)
    for t in range(nt):
        for d in range(z.shape[1]):
            z[t, d] = 0.0
    balance(q, rest, chain, T, law, load, z, s, z1, s1, r, none)
    for t in range(nt):
        assign(s[t], s1[t])
    started = 1
    if law.mu > 0.0 or not guess.size:  # without friction a trial has no memory of its start
        started = solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol)
        if started == 1 and not is_minimum(model, data, chain, rest, T, law, load, z, s, q, LU):
            started = 2 if follow(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol) else 0
        steps = RAMP if law.mu > 0.0 else 1
        for k in range(1, steps + 1):
            for t in range(nt):
                T[t] = tension[0, t] * (k / steps)
            if solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, RAMP_TOLERANCE) == 0:
                started = 0
    assign(q1, q)
    assign(q2, q)
    for i in range(n):
        if amplitude.size and i > 0:
            bendings(q1, chain.hand, instant, D)
            for k in range(nv):
                instant[k] -= rest[k]
            creep(delayed, instant, amplitude, retardation, time[i] - time[i - 1])
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
        assign(T, tension[i])
        status[i] = solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol)
        if status[i] == 0:
            assign(q, q1)
        if keep and not is_minimum(model, data, chain, rest, T, law, load, z, s, q, LUs[i]):
            for k in range(nv):
                assign(LUs[i, k], LU[k])
        assign(q1, q)
        assign(q_out[i], q)
        for k in range(chain.marker.size):
            assign(marker[i, k], chain.site[chain.marker[k]])
        for t in range(nt):
            path[i, t] = s[t, 0]
    return started
