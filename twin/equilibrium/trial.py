"""What all trials share: what drives them, what creeps, what is found, and the steps of each sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, inner, jit, part
from twin.effects.backbone_creep import retard
from twin.equilibrium.chain import Law, Load, State, Statics, balance, settle
from twin.equilibrium.elastic import bendings
from twin.equilibrium.holder import Held
from twin.equilibrium.lengths import Sought
from twin.equilibrium.newton import Factors, follow, is_minimum, no_factors, place, solve

RAMP = 8  # steps from slack to the first tensions; 8 against 512 moved the tip by at most 0.015 mm in 180 random poses, mu 0.2


class Driving(NamedTuple):
    """What a trial is driven by, sample by sample."""

    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) base tension in N, displacement in m, or current in A
    by_length: np.ndarray  # (n_tendon,) whether it is a displacement
    by_spring: np.ndarray  # (n_tendon,) whether it is the current of an SMA spring
    straight: np.ndarray  # (n_tendon,) m, path lengths on the straight robot
    stretch: float  # m/N, of a tendon
    bedding: float  # m, by which it beds in
    bedding_tension: float  # N, over which it does
    play: np.ndarray  # (n_tendon,) m, of those that springs pull
    swap: np.ndarray  # (n_tendon,) m
    stall: float  # N, at which a motor that holds a length gives way
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
    yielding: np.ndarray  # (n, n_tendon, nv) rad/N, where tendons are held


class How(NamedTuple):
    """To which tolerance (rad); whether a tangent factorised at each solution is kept; whether a single Newton step is taken from a
    neighbour, exact to first order in the difference, where no tendon rubs."""

    tol: float
    keep: bool
    once: bool


class Found(NamedTuple):
    """The equilibria, one a sample."""

    LU: np.ndarray  # (n, nv, nv), or empty
    yielding: np.ndarray  # (n, n_tendon, nv), or empty
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
        warm.copy(), elongation, tension, driving.bedding, driving.bedding_tension, np.zeros(nt), driving.stall,
        driving.play, driving.swap, np.zeros(nt), straight.copy(),
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
def weigh(now, tol):
    """Gravity, payload and force come on with slack tendons. Returns the status of the start: 1, or 2 where the loaded robot has no
    stable equilibrium near straight, 0 where none was found."""
    started = solve(now.at, now.state, now.factors, tol)
    if started == 1 and not is_minimum(now.at, now.state, now.factors.LU):
        started = 2 if follow(now.at, now.state, now.factors, tol) else 0
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
def wary(now, near):
    """Whether a post may lie between the last shape and the next, and no neighbour tells on which side of it that is."""
    return now.at.law.wall[9] > 0.0 and near.q.size == 0


@part
def guess(now, near, i):
    """A first shape for sample i: a neighbour's, else extrapolated from the two before."""
    q, further = now.state.q, 0.0 if wary(now, near) else 1.0
    if near.q.size:
        assign(q, near.q[i])
    else:
        for k in range(q.size):
            q[k] = now.last[k] + further * (now.last[k] - now.second[k])
    assign(now.second, now.last)


@part
def borrow(now, near, i):
    """A neighbour's tangent at sample i, to solve with, if there is one."""
    if near.q.size:
        for k in range(now.last.size):
            assign(now.factors.LU[k], near.LU[i, k])
        now.factors.fresh[0] = True


@inner
def look(chain, markers):
    """The markers (n_marker, 3) m where the chain is placed."""
    for k in range(chain.marker.size):
        assign(markers[k], chain.site[chain.marker[k]])


@jit
def seen(at, q, markers):
    """The markers (n, n_marker, 3) m of shapes q (n, nv)."""
    for i in range(q.shape[0]):
        place(at, q[i])
        look(at.chain, markers[i])


@part
def record(now, i, found):
    state = now.state
    assign(found.q[i], state.q)
    look(now.at.chain, found.markers[i])
    for t in range(state.T.size):
        found.path[i, t] = state.s[t, 0]
        found.tension[i, t] = state.T[t] / now.held.factor[0]
        found.temperature[i, t] = now.sought.temperature[t]
