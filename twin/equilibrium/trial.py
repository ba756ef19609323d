"""A trial, sample by sample: slow states advance in measured time, one static solve a sample, warm-started.

The order in which loads are applied is part of the answer, since friction remembers it (millimetres under a sideways payload):
straight and unloaded; gravity, payload and tip force at once with slack tendons; the first tensions in `RAMP` equal steps;
then the log. Within a sample all tensions change together. SMA springs pull from the beginning, cold: with them gravity and payload
come in `RAMP` equal steps. Their temperature advances once a sample, under the current and at the elongation of the sample before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, inner, jit, part
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import Law, Load, State, Statics, balance, settle
from twin.equilibrium.elastic import bendings
from twin.equilibrium.lengths import Held, Sought, hold_once, move, reach, remember, tangent
from twin.equilibrium.move import onward
from twin.equilibrium.newton import Factors, follow, is_minimum, no_factors, place, solve, step_once
from twin.springs.heat import heated

RAMP = 8  # steps from slack to the first tensions; 8 against 512 moved the tip by at most 0.015 mm in 180 random poses, mu 0.2

RAMP_TOLERANCE = 1e-6  # rad
FINE = 1e-7  # rad, where tensions are sought


class Driving(NamedTuple):
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
    spring: np.ndarray  # (n_tendon,) `Spring.records`


class Slow(NamedTuple):
    """Creep: of each element the amplitude and retardation time (n_element,), and the delayed strains, advanced in place."""

    amplitude: np.ndarray
    time: np.ndarray
    delayed: np.ndarray  # (n_element, nv)


class Near(NamedTuple):
    """A neighbouring solution on the same samples, instead of extrapolation as first guess; or empty."""

    q: np.ndarray  # (n, nv)
    T: np.ndarray  # (n, n_tendon)
    LU: np.ndarray  # (n, nv, nv)


class How(NamedTuple):
    """To which tolerance (rad); whether a tangent factorised at each solution is kept; whether a single Newton step is taken from a
    neighbour, exact to first order in the difference, where no tendon rubs."""

    tol: float
    keep: bool
    once: bool


class Found(NamedTuple):
    """The equilibria, one a sample."""

    LU: np.ndarray  # (n, nv, nv), or empty
    q: np.ndarray  # (n, nv)
    tension: np.ndarray  # (n, n_tendon) at the base, N
    markers: np.ndarray  # (n, n_marker, 3) m
    path: np.ndarray  # (n, n_tendon) lengths of tendons, m
    temperature: np.ndarray  # (n, n_tendon) of springs, K
    status: np.ndarray  # (n,) as `solve` returns it


class Now(NamedTuple):
    """The present instant of a trial: `at` with loads over the present stiffness and the crept rest shape, and these as described;
    tendon lengths on the straight robot; and the shapes and tensions of the samples before."""

    at: Statics
    gravity: np.ndarray  # (3,) m/s^2
    force: np.ndarray  # (3,) N
    push: np.ndarray  # (3,) N
    wall: float  # N/m
    rest: np.ndarray  # (nv,)
    state: State
    factors: Factors
    held: Held
    sought: Sought
    straight: np.ndarray  # (n_tendon, n_piece) distal lengths, m
    last: np.ndarray  # (nv,)
    second: np.ndarray  # (nv,) the one before
    T1: np.ndarray  # (n_tendon,)


@part
def some(mask):
    count = 0
    for x in mask:
        count += x
    return count > 0


@inner
def creep(slow, instant, dt):
    """Advance the delayed strains by dt under the instant strain (nv,)."""
    for m in range(slow.amplitude.size):
        for i in range(instant.size):
            slow.delayed[m, i] = retard(slow.delayed[m, i], instant[i], slow.amplitude[m], slow.time[m], dt)


@inner
def rested(spring, delayed, rest):
    """Rest angles (nv,) after creep: the springs' own plus all delayed strains."""
    for i in range(spring.size):
        rest[i] = spring[i]
        for m in range(delayed.shape[0]):
            rest[i] += delayed[m, i]


@part
def soften(now, driving, i, weight):
    """The share `weight` of the loads at sample i, on a body that is 1/factor as stiff: statics knows loads over stiffness only,
    and friction has no scale of force."""
    factor = 1.0 / driving.stiffness[i]
    for a in range(3):
        now.at.load.gravity[a] = now.gravity[a] * factor * weight
        now.at.load.force[a] = now.force[a] * factor * weight
        now.at.load.push[a] = now.push[a] * factor * weight
    now.at.law.wall[4] = now.wall * factor
    now.held.factor[0] = factor
    for t in range(now.held.stretch.size):
        if not now.held.by_spring[t]:
            now.held.stretch[t] = max(now.held.elastic, driving.least_stretch) / factor


@part
def at_rest(plain, driving, slow, state):
    """The straight robot before its loads, its springs cold."""
    nv, nt, straight, spring = plain.rest.size, state.T.size, driving.straight, driving.spring
    law, load, warm = plain.law, plain.load, np.full(nt, driving.ambient[0])
    at = Statics(
        plain.model, plain.data, plain.chain, np.empty(nv), Law(law.mu, law.presliding, law.wall.copy()),
        Load(load.gravity.copy(), load.payload, load.force.copy(), load.push.copy(), load.pushed),
    )  # fmt: skip
    elongation, tension = np.empty(nt), np.empty(nt)
    for t in range(nt):
        elongation[t], tension[t] = spring[t].initial_elongation, spring[t].initial_tension
    held = Held(
        driving.by_spring.copy(), driving.by_spring, straight.copy(), np.empty(nt), straight, driving.stretch, np.ones(1), spring,
        warm.copy(), elongation, tension,
    )  # fmt: skip
    now = Now(
        at, load.gravity, load.force, load.push, law.wall[4], plain.rest, state, no_factors(nv, nt), held,
        Sought(straight.copy(), warm), np.empty(state.s.shape), np.empty(nv), np.empty(nv), np.zeros(nt),
    )  # fmt: skip
    soften(now, driving, 0, 1.0)
    rested(plain.rest, slow.delayed, at.rest)
    assign(state.q, at.rest)
    place(at, state.q)
    r, z, none = np.empty(nv), np.empty(state.z.shape), np.empty((0, 0))
    for t in range(nt):
        state.T[t] = held.factor[0] * held.tension[t] if driving.by_spring[t] else 0.0
        for d in range(state.z.shape[1]):
            state.z[t, d] = 0.0
    balance(at, state, z, now.straight, r, none)
    settle(state, state.z, now.straight)
    return now


@part
def unmoved(now):
    """Tendons held by their motors have not moved while the weight came on."""
    for t in range(now.state.T.size):
        if not now.held.by_spring[t]:
            assign(now.state.s[t], now.straight[t])
            for d in range(now.state.z.shape[1]):
                now.state.z[t, d] = 0.0


@part
def load_on(now, driving, tol):
    """Gravity, payload and force come on with slack tendons, under cold springs in steps. Returns the status of the start."""
    state, factors = now.state, now.factors
    if not some(driving.by_spring):
        started = solve(now.at, state, factors, tol)
        if started == 1 and not is_minimum(now.at, state, factors.LU):
            started = 2 if follow(now.at, state, factors, tol) else 0
        return started
    started = 1
    for k in range(1, RAMP + 1):
        soften(now, driving, 0, k / RAMP)
        assign(now.last, state.q)
        if reach(now.at, state, factors, now.held, now.last, now.sought, min(tol, FINE)) == 0:
            started = 0
        remember(now.held, state.s, state.T)
    return started


@part
def first_pull(now, driving, tol, started):
    """The first tensions or displacements, in equal steps. Returns the status of the start."""
    state, factors, held = now.state, now.factors, now.held
    lengths, factor = some(held.which), held.factor[0]
    steps = RAMP if now.at.law.mu > 0.0 or lengths else 1
    for k in range(0 if lengths else 1, steps + 1):
        for t in range(state.T.size):
            if driving.by_length[t]:
                now.sought.free[t] = driving.straight[t] - driving.command[0, t] * (k / steps)
            elif not driving.by_spring[t]:
                state.T[t] = factor * driving.command[0, t] * (k / steps)
                now.T1[t] = factor * driving.command[0, t] * ((k - 1) / steps)
        assign(now.last, state.q)
        if lengths:
            found = reach(now.at, state, factors, held, now.last, now.sought, min(tol, FINE))  # a rough shape has no sharp tensions
            remember(held, state.s, state.T)
        else:
            found = onward(now.at, state, factors, now.T1, now.last, RAMP_TOLERANCE)
        if found == 0:
            started = 0
    return started


@part
def begin(now, driving, near, tol):
    """Loads, then first commands. Returns the status of the start: 1, or 2 where the loaded robot has no stable equilibrium near
    straight, 0 where none was found."""
    springs, others, started = some(driving.by_spring), False, 1
    remembers = springs or now.at.law.mu > 0.0 or near.q.size == 0  # else a trial has no memory of its start
    if remembers:
        started = load_on(now, driving, tol)
    for t in range(now.state.T.size):
        now.held.which[t] = driving.by_length[t] or driving.by_spring[t]
        others = others or not driving.by_spring[t]
    if some(now.held.which):
        unmoved(now)
    if others and remembers:
        started = first_pull(now, driving, tol, started)
    assign(now.last, now.state.q)
    assign(now.second, now.state.q)
    return started


@part
def relax(now, slow, dt):
    """Creep under the last shape, dt long."""
    instant, D = np.empty(now.last.size), np.empty((now.at.chain.hand.size, 3, 3))
    bendings(now.last, now.at.chain, instant, D)
    for k in range(instant.size):
        instant[k] -= now.at.rest[k]
    creep(slow, instant, dt)
    rested(now.rest, slow.delayed, now.at.rest)


@part
def guess(now, near, i):
    """A first shape for sample i: a neighbour's, else extrapolated from the two before."""
    q, factors = now.state.q, now.factors
    if near.q.size:
        assign(q, near.q[i])
        for k in range(q.size):
            assign(factors.LU[k], near.LU[i, k])
        factors.fresh[0] = True
    else:
        for k in range(q.size):
            q[k] = 2.0 * now.last[k] - now.second[k]
    assign(now.second, now.last)


@part
def drive(now, driving, near, i):
    """What pulls at sample i: tensions, lengths, and the temperatures that springs have been heated to since the sample before."""
    T, held, factor = now.state.T, now.held, now.held.factor[0]
    for t in range(T.size):
        if driving.by_spring[t] and i > 0:
            dt, warm = driving.time[i] - driving.time[i - 1], now.sought.temperature
            current, room = driving.command[i - 1, t], driving.ambient[i - 1]
            warm[t] = heated(driving.spring, t, warm[t], held.elongation[t], current, room, dt)
        elif driving.by_length[t]:
            now.sought.free[t] = driving.straight[t] - driving.command[i, t]
        elif not driving.by_spring[t]:
            T[t] = factor * driving.command[i, t]
            now.T1[t] = factor * driving.command[max(0, i - 1), t]
        if near.q.size and held.which[t]:
            T[t] = factor * near.T[i, t]
            now.factors.held_by[t] = T[t] > 0.0


@part
def settled(now, near, how):
    """The equilibrium of the present sample. Returns its status; the shape stays the last one where there is none.

    Friction wants it in full: slip carries what a single step leaves on to all samples that follow.
    """
    at, state, factors, held = now.at, now.state, now.factors, now.held
    lengths, once = some(held.which), how.once and near.q.size > 0 and not now.at.law.mu > 0.0
    if lengths and once:
        move(held, now.sought, now.sought, 1.0)
        status = hold_once(at, state, factors, held)
    elif lengths:
        status = reach(at, state, factors, held, now.last, now.sought, min(how.tol, FINE))
    elif once:
        status = step_once(at, state, factors.LU)
    else:
        status = onward(at, state, factors, now.T1, now.last, how.tol)
    if status == 0:
        assign(state.q, now.last)
    return status


@part
def keep_tangent(now, LU):
    """The present tangent's factors to LU; where it has none, those last used."""
    if some(now.held.which):
        kept = tangent(now.at, now.state, now.held.which, LU, now.factors.held_by)
    else:
        kept = is_minimum(now.at, now.state, LU)
    if not kept:
        for k in range(now.last.size):
            assign(LU[k], now.factors.LU[k])


@part
def record(now, i, found):
    state, chain = now.state, now.at.chain
    assign(found.q[i], state.q)
    for k in range(chain.marker.size):
        assign(found.markers[i, k], chain.site[chain.marker[k]])
    for t in range(state.T.size):
        found.path[i, t] = state.s[t, 0]
        found.tension[i, t] = state.T[t] / now.held.factor[0]
        found.temperature[i, t] = now.sought.temperature[t]


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
        drive(now, driving, near, i)
        found.status[i] = settled(now, near, how)
        if how.keep:
            keep_tangent(now, found.LU[i])
        remember(now.held, state.s, state.T)
        assign(now.last, state.q)
        record(now, i, found)
    return started
