"""A trial, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import balance
from twin.equilibrium.linear import factorise
from twin.equilibrium.newton import place, solve

RAMP = 8  # steps from slack to the first tensions; 8 against 64 moves the tip by less than 0.05 mm


@jit
def creep(delayed, instant, amplitude, time, dt):
    """Advance the delayed strains (n_element, nv) by dt under the instant strain (nv,)."""
    for m in range(amplitude.size):
        for i in range(instant.size):
            delayed[m, i] = retard(delayed[m, i], instant[i], amplitude[m], time[m], dt)


@jit
def run(
    model, data, chain, spring, law, load, amplitude, retardation, delayed, time, tension, guess, guess_LU, tol, keep, z, s, LUs,
    q_out, marker, path, status,
):  # fmt: skip
    """Solve a whole trial.

    `spring` (nv,) rest angles; `delayed` (n_element, nv) creep strains, advanced in place; `time` (n,), `tension` (n, n_tendon).
    `guess` (n, nv) and `guess_LU` (n, nv, nv), empty or from a neighbouring solution, replace extrapolation as first guess.
    With `keep` a tangent factorised at each solution goes to LUs (n, nv, nv).
    Out: slip states z and distal lengths s (n_tendon, n_disk) at the end, angles q_out (n, nv), markers (n, n_marker, 3), path lengths (n, n_tendon), status (n,) as `solve` returns it.
    Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near straight.
    """
    n, nv, nt = tension.shape[0], spring.size, tension.shape[1]
    q, q1, q2 = spring.copy(), np.empty(nv), np.empty(nv)
    for m in range(amplitude.size):
        q += delayed[m]
    rest = q.copy()
    z[:] = 0.0
    LU, fresh, T = np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt)
    r, z1, s1 = np.empty(nv), np.empty_like(z), np.empty_like(s)
    place(model, data, chain, q)
    balance(q, rest, chain, T, law, load, z, s, z1, s1, r, LU, False)
    s[:] = s1
    started = solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol, True)
    for k in range(1, RAMP + 1):
        T[:] = tension[0] * (k / RAMP)
        if solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, 1e-6 if k < RAMP else tol, False) == 0:
            started = 0
    q1[:] = q
    q2[:] = q
    for i in range(n):
        if amplitude.size and i > 0:
            creep(delayed, q1 - rest, amplitude, retardation, time[i] - time[i - 1])
            rest[:] = spring
            for m in range(amplitude.size):
                rest += delayed[m]
        if guess.size:
            q[:] = guess[i]
            LU[:] = guess_LU[i]
            fresh[0] = True
        else:
            q[:] = 2.0 * q1 - q2
        q2[:] = q1
        T[:] = tension[i]
        status[i] = solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol, False)
        if status[i] == 0:
            q[:] = q1
        if keep:
            balance(q, rest, chain, T, law, load, z, s, z1, s1, r, LUs[i], True)
            if not factorise(LUs[i]):
                LUs[i] = LU
        q1[:] = q
        q_out[i] = q
        for k in range(chain.marker.size):
            marker[i, k] = chain.site[chain.marker[k]]
        path[i] = s[:, 0]
    return started
