"""A trial of given tensions, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together. Apart from held.py, since this loop compiles in half the time of that.
"""

from __future__ import annotations

from twin.compiled import assign, jit, part
from twin.equilibrium.move import onward
from twin.equilibrium.newton import is_minimum, step_once
from twin.equilibrium.trial import RAMP, at_rest, borrow, guess, record, relax, soften, wary, weigh

RAMP_TOLERANCE = 1e-6  # rad


@part
def tensions(now, driving, i, weight, before):
    """Tensions of sample i: the share `weight` of them, after the share `before`."""
    factor = now.held.factor[0]
    for t in range(now.state.T.size):
        now.state.T[t] = factor * driving.command[i, t] * weight
        now.T1[t] = factor * driving.command[max(0, i - 1), t] * before


@part
def begin(now, driving, near, tol):
    """Loads, then first tensions in equal steps. Returns the status of the start, as `weigh` does."""
    started, rubs = 1, now.at.law.mu > 0.0
    if rubs or near.q.size == 0:  # else a trial has no memory of its start
        started = weigh(now, tol)
        steps = RAMP if rubs else 1
        for k in range(1, steps + 1):
            tensions(now, driving, 0, k / steps, (k - 1) / steps)
            assign(now.last, now.state.q)
            if onward(now.at, now.state, now.factors, now.T1, now.last, RAMP_TOLERANCE, wary(now, near)) == 0:
                started = 0
    assign(now.last, now.state.q)
    assign(now.second, now.state.q)
    return started


@part
def settled(now, near, how, i):
    """The equilibrium of the present sample. Returns its status; the shape stays the last one where there is none.

    Friction wants it in full: slip carries what a single step leaves on to all samples that follow.
    """
    if how.once and near.q.size > 0 and not now.at.law.mu > 0.0:
        status = step_once(now.at, now.state, near.LU[i])
    else:
        borrow(now, near, i)
        status = onward(now.at, now.state, now.factors, now.T1, now.last, how.tol, wary(now, near))
    if status == 0:
        assign(now.state.q, now.last)
    return status


@part
def keep_tangent(now, LU):
    """The present tangent's factors to LU; where it has none, those last used."""
    if not is_minimum(now.at, now.state, LU):
        for k in range(now.last.size):
            assign(LU[k], now.factors.LU[k])


@jit
def run(plain, driving, slow, near, how, state, found):
    """Solve a whole trial of what is in balance as `plain` says, to `found`; `state` becomes that at its end.

    Returns the status of the start.
    """
    now = at_rest(plain, driving, slow, state)
    started = begin(now, driving, near, how.tol)
    for i in range(driving.time.size):
        if slow.amplitude.size and i > 0:
            relax(now, slow, driving.time[i] - driving.time[i - 1])
        guess(now, near, i)
        soften(now, driving, i, 1.0)
        tensions(now, driving, i, 1.0, 1.0)
        found.status[i] = settled(now, near, how, i)
        if how.keep:
            keep_tangent(now, found.LU[i])
        assign(now.last, state.q)
        record(now, i, found)
    return started
