"""A trial some of whose tendons are held, by motors at given lengths or by SMA springs, sample by sample: as pulled.py, with the
tensions sought.

Springs pull from the beginning, cold: with them gravity and payload come in `RAMP` equal steps. Their temperature advances once a
sample, under the current and at the elongation of the sample before.
"""

from __future__ import annotations

from twin.compiled import assign, jit, part
from twin.equilibrium.holder import remember
from twin.equilibrium.lengths import hold_once, move, reach, stay, tangent
from twin.equilibrium.trial import RAMP, at_rest, borrow, guess, record, relax, soften, some, wary, weigh
from twin.springs.heat import heated

FINE = 1e-7  # rad, where tensions are sought: a rough shape has no sharp ones
# And where springs go on from them: what a guess is let off at a sample, 16 uN with `FINE`, adds up over all that follow; on a body
# that softens slowly they did not move at all.
FINEST = 1e-9


@part
def fine(held, tol):
    """The tolerance of a step, no rougher than what holds the tendons allows."""
    return min(tol, FINEST if some(held.by_spring) else FINE)


@part
def sought(now, tol):
    """A step of the start: the shape whose tendons have the lengths and temperatures wanted; remembered. Returns its status."""
    state, held = now.state, now.held
    assign(now.last, state.q)
    status = reach(now.at, state, now.factors, held, now.last, now.sought, fine(held, tol), now.at.law.wall[9] > 0.0)
    remember(held, state.s, state.T)
    return status


@part
def weigh_on_springs(now, driving, tol):
    """Gravity, payload and force come on in steps, under cold springs. Returns the status of the start, 1 or 0."""
    started = 1
    for k in range(1, RAMP + 1):
        soften(now, driving, 0, k / RAMP)
        if sought(now, tol) == 0:
            started = 0
    return started


@part
def unmoved(now):
    """Tendons held by their motors have not moved while the weight came on."""
    for t in range(now.state.T.size):
        if not now.held.by_spring[t]:
            assign(now.state.s[t], now.straight[t])
            for d in range(now.state.z.shape[1]):
                now.state.z[t, d] = 0.0


@part
def command(now, driving, i, weight):
    """The share `weight` of the displacements and tensions of sample i; what a current does, `warm` says."""
    for t in range(now.state.T.size):
        if driving.by_length[t]:
            now.sought.free[t] = driving.straight[t] - driving.command[i, t] * weight
        elif not driving.by_spring[t]:
            now.state.T[t] = now.held.factor[0] * driving.command[i, t] * weight


@part
def first_pull(now, driving, tol, started):
    """The first displacements and tensions, in equal steps. Returns the status of the start."""
    for k in range(RAMP + 1):
        command(now, driving, 0, k / RAMP)
        if sought(now, tol) == 0:
            started = 0
    return started


@part
def begin(now, driving, near, tol):
    """Loads, then first commands. Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near
    straight, 0 where none was found."""
    springs, others, started = some(driving.by_spring), False, 1
    remembers = springs or now.at.law.mu > 0.0 or near.q.size == 0  # else a trial has no memory of its start
    if remembers and springs:
        started = weigh_on_springs(now, driving, tol)
    elif remembers:
        started = weigh(now, tol)
        now.factors.fresh[0] = False  # no length is in that tangent
    for t in range(now.state.T.size):
        now.held.which[t] = driving.by_length[t] or driving.by_spring[t]
        others = others or not driving.by_spring[t]
    unmoved(now)
    if others and remembers:
        started = first_pull(now, driving, tol, started)
    assign(now.last, now.state.q)
    assign(now.second, now.state.q)
    return started


@part
def warm(now, driving, i):
    """The temperatures to which springs have been heated since the sample before."""
    held, temperature = now.held, now.sought.temperature
    dt = driving.time[i] - driving.time[i - 1]
    for t in range(temperature.size):
        if driving.by_spring[t]:
            current, room = driving.command[i - 1, t], driving.ambient[i - 1]
            temperature[t] = heated(driving.spring, t, temperature[t], held.elongation[t], current, room, dt)


@part
def first_tensions(now, near, i):
    """A neighbour's tensions of what is held as first guess."""
    for t in range(now.state.T.size):
        if near.q.size and now.held.which[t]:
            now.state.T[t] = now.held.factor[0] * near.T[i, t]
            now.factors.held_by[t] = now.state.T[t] > 0.0


@part
def settled(now, near, how, i):
    """The equilibrium of sample i. Returns its status; the shape stays the last one where there is none.

    Friction and play want it in full: they carry what a single step leaves on to all samples that follow. Where such a step is
    lost, as beside a spring about to change the branch of its law, there is no first order, and the neighbour's own shape stays.
    """
    if how.once and near.q.size > 0 and not now.at.law.mu > 0.0 and not some(now.held.play > 0.0):
        move(now.held, now.sought, now.sought, 1.0)
        status = hold_once(now.at, now.state, now.factors.held_by, now.held, near.LU[i], near.yielding[i])
        if status == 0:
            assign(now.state.q, near.q[i])
            first_tensions(now, near, i)
            stay(now.at, now.state)
            status = 1
    else:
        borrow(now, near, i)
        if near.q.size:
            for t in range(now.state.T.size):
                assign(now.factors.yielding[t], near.yielding[i, t])
        status = reach(now.at, now.state, now.factors, now.held, now.last, now.sought, fine(now.held, how.tol), wary(now, near))
    if status == 0:
        assign(now.state.q, now.last)
    return status


@part
def keep_tangent(now, LU, yielding):
    """The present tangent's factors to LU, where it has none those last used; and how tendons yield."""
    if not tangent(now.at, now.state, now.held.which, LU, now.factors.held_by, yielding):
        for k in range(now.last.size):
            assign(LU[k], now.factors.LU[k])
        for t in range(now.state.T.size):
            assign(yielding[t], now.factors.yielding[t])


@jit
def run(plain, driving, slow, near, how, state, found):
    """As in pulled.py."""
    now = at_rest(plain, driving, slow, state)
    started = begin(now, driving, near, how.tol)
    for i in range(driving.time.size):
        if i > 0:
            if slow.amplitude.size:
                relax(now, slow, driving.time[i] - driving.time[i - 1])
            warm(now, driving, i)
        guess(now, near, i)
        soften(now, driving, i, 1.0)
        command(now, driving, i, 1.0)
        first_tensions(now, near, i)
        found.status[i] = settled(now, near, how, i)
        if how.keep:
            keep_tangent(now, found.LU[i], found.yielding[i])
        remember(now.held, state.s, state.T)
        assign(now.last, state.q)
        record(now, i, found)
    return started
