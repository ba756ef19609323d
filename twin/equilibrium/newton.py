"""The static solve: chord Newton with the exact tangent, and a path to follow where Newton fails.

A factorised tangent is kept from solve to solve and used as long as each step shrinks the residual fourfold (steps in between
are improved by one-deep Anderson mixing); else a fresh tangent is factorised. Convergence is max |r_i / K_i| < tol (rad; of a
slide, shares of the length it stretches).

Where Newton fails (a saddle, a fold, a jump), the overdamped motion K q' = -dE/dq is followed by implicit Euler with growing
steps, the slip states of friction committed at each, until a stable equilibrium is reached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, dot, inner, jit, part
from twin.effects.tendon_friction import slip_state
from twin.engine import mj_com_pos, mj_kinematics
from twin.equilibrium.chain import balance, become, copied, lever, settle
from twin.equilibrium.linear import factorise, substitute

CONTRACTION = 0.25  # a chord step that shrinks the residual less than this asks for a fresh tangent
GROWTH = 3.0  # a Newton step that lets the residual grow more than this is halved
LOST = 1e9  # rad: a residual beyond it is a diverged step
LONGEST_STEP = 0.5  # rad, of any hinge
CLOSE = 0.25  # of a post's radius, the furthest that a step takes a disk: a longer one may land behind the post
NEWTON_STEPS = 30
KINKED = 3  # steps with a fresh tangent that do not halve the residual: it goes round a kink of friction or a wall, so shorter ones
SHORTER = 0.6  # of those; of 60 pulls at mu 0.25 three meet a failure, with half steps 23 (they go round too), with full ones 26
CYCLES = 10  # such steps at most
FLOW_STEPS = 200
FLOW_TOLERANCE = 1e-6  # rad, of the steps on the way


class Factors(NamedTuple):
    """The tangent kept from solve to solve."""

    LU: np.ndarray  # (nv, nv)
    fresh: np.ndarray  # (1,) whether LU holds a usable factorisation
    held_by: np.ndarray  # (n_tendon,) tendons whose lengths are in LU (lengths.py)
    yielding: np.ndarray  # (n_tendon, nv) rad/N, what tendons held at lengths turn the joints by against LU


@jit
def no_factors(nv, nt):
    """Room for them; none is fresh."""
    return Factors(np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt, np.bool_), np.empty((nt, nv)))


class Flow(NamedTuple):
    """The overdamped motion K q' = -dE/dq from `anchor`, a step of implicit Euler long: rate 0 is the equilibrium itself."""

    rate: float  # 1/s
    anchor: np.ndarray  # (nv,)


@jit
def place(at, q):
    """MuJoCo's kinematics at q: all of the chain's views move."""
    assign(at.chain.qpos, q)
    mj_kinematics(at.model, at.data)
    mj_com_pos(at.model, at.data)


@inner
def pushed(chain, flow, q, r):
    """Adds the flow's drag to r; returns the longest r_i / K_i (rad), and whether it is beyond all measure."""
    size, lost = 0.0, False
    for i in range(q.size):
        r[i] += flow.rate * chain.stiffness[i] * (q[i] - flow.anchor[i])
        x = abs(r[i] / chain.stiffness[i]) / chain.unit[i]
        size = max(size, x)
        lost = lost or not x < LOST  # also where x is no number, which isfinite may miss under fast-math
    return size, lost


class Steps(NamedTuple):
    """Newton's steps as they go: the last two right-hand sides, the step and where it began, (nv,) each."""

    f: np.ndarray
    f0: np.ndarray
    dq: np.ndarray
    last: np.ndarray


@inner
def stride(LU, r, q, unit, mix, steps):
    """The next step dq from the residual; with `mix`, improved by one-deep Anderson mixing. Returns its longest change (rad)."""
    f, f0, dq, last = steps.f, steps.f0, steps.dq, steps.last
    for i in range(q.size):
        f[i] = -r[i]
    substitute(LU, f)
    ww, fw, longest = 0.0, 0.0, 0.0
    for i in range(q.size):
        w = f[i] - f0[i]
        ww += w * w
        fw += f[i] * w
    theta = fw / ww if mix and ww > 0.0 else 0.0
    for i in range(q.size):
        dq[i] = f[i] - theta * (dq[i] + f[i] - f0[i])
        f0[i] = f[i]
        last[i] = q[i]
        longest = max(longest, abs(dq[i]) / unit[i])
    return longest


@inner
def allowed(at, dq, longest):
    """How much of a step dq from where the chain is placed may be taken; its longest change is `longest` (rad)."""
    chain, curvature, share = at.chain, at.law.wall[9], min(1.0, LONGEST_STEP / longest)
    if curvature > 0.0:
        for k in range(chain.disk.size):
            x, moved = chain.site[chain.disk[k]], np.zeros(3)
            for i in range(chain.below[k]):
                v = lever(chain, i, x)
                for a in range(3):
                    moved[a] += v[a] * dq[i]
            share = min(share, CLOSE / (1e-9 + curvature * np.sqrt(dot(moved, moved))))
    return share


@inner
def newton(at, state, factors, flow, tol):
    """Solve r(q) + rate K (q - anchor) = 0 from state.q. Returns the iterations, negative where it failed.

    On success slip states and distal lengths are committed.
    """
    chain, q, LU, fresh = at.chain, state.q, factors.LU, factors.fresh
    nv = q.size
    r, J, none = np.empty(nv), np.empty((nv, nv)), np.empty((0, 0))
    z, s = np.zeros(state.z.shape), np.zeros(state.s.shape)
    steps = Steps(np.empty(nv), np.zeros(nv), np.zeros(nv), np.empty(nv))
    before, step, slow, mix, have = 1e300, 1.0, 0, False, fresh[0]
    for it in range(1, NEWTON_STEPS + 1):
        tangent = not have
        place(at, q)
        balance(at, state, z, s, r, J if tangent else none)
        size, lost = pushed(chain, flow, q, r)
        if lost or (tangent and size > GROWTH * before):
            if step < 1e-3 or it == 1:
                return -it
            step *= 0.5
            have = fresh[0] = False
            for i in range(nv):
                q[i] = steps.last[i] + step * steps.dq[i]
            continue
        if size < tol:
            settle(state, z, s)
            return it
        if not tangent and size > CONTRACTION * before and it > 1:
            balance(at, state, z, s, r, J)
            pushed(chain, flow, q, r)
            tangent = True
        if tangent:
            slow += 1 if it > 1 and size > 0.5 * before else 0
            if slow > CYCLES:
                return -it
            for i in range(nv):
                assign(LU[i], J[i])
                LU[i, i] += flow.rate * chain.stiffness[i]
            fresh[0] = factorise(LU)
            if not fresh[0]:
                return -it
        have, before = True, size
        longest = stride(LU, r, q, chain.unit, mix and not tangent, steps)
        step = allowed(at, steps.dq, longest) * (SHORTER if slow > KINKED else 1.0)
        mix = step == 1.0
        for i in range(nv):
            q[i] += step * steps.dq[i]
    return -NEWTON_STEPS


@part
def is_minimum(at, state, LU):
    """Whether the tangent is positive, so that the state is a stable shape. Leaves its factors in LU."""
    r, z, s = np.empty(state.q.size), np.zeros(state.z.shape), np.zeros(state.s.shape)
    place(at, state.q)
    balance(at, state, z, s, r, LU)
    return factorise(LU)


@inner
def follow(at, state, factors, tol):
    """Equilibrium reached by the overdamped motion from where the state is. Returns whether there was one."""
    rate, q, unit = 1.0, state.q, at.chain.unit
    start = copied(state)
    for k in range(FLOW_STEPS):
        become(start, state)
        factors.fresh[0] = False
        final = rate == 0.0
        n = newton(at, state, factors, Flow(rate, start.q), tol if final else FLOW_TOLERANCE)
        factors.fresh[0] = False
        if n > 0 and final:
            if is_minimum(at, state, factors.LU):
                return True
            n = -n
        if n <= 0:
            become(state, start)
            rate = max(4.0 * rate, 0.05)
            continue
        moved = 0.0
        for i in range(q.size):
            moved = max(moved, abs(q[i] - start.q[i]) / unit[i])
        rate = 0.0 if moved * rate < 1e-4 else 0.5 * rate
        if k == 0 and moved < 1e-9:  # exactly on a saddle: leave it
            for i in range(q.size):
                q[i] += 1e-3 * (1 + 7 * i % 5) * unit[i]
    return False


@part
def still(q):
    """No motion to follow: the equilibrium itself is sought."""
    return Flow(0.0, q)


@part
def solve(at, state, factors, tol):
    """Equilibrium near state.q. Returns 1: found directly; 2: by following the motion (q was no stable start); 0: not found."""
    start = state.q.copy()
    if newton(at, state, factors, still(start), tol) > 0:
        return 1
    assign(state.q, start)
    return 2 if follow(at, state, factors, tol) else 0


@inner
def commit(at, state, bowing):
    """Advance slip states and distal lengths to the geometry in MuJoCo's data, `bowing` (n_tendon,) m as before the step: it
    changes by 1e-3 of what the path does."""
    chain, z, s = at.chain, state.z, state.s
    for t in range(z.shape[0]):
        distal = 0.0
        for d in range(chain.pieces[t] - 1, -1, -1):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            distal += np.sqrt(dot(v, v))
            z[t, d] = slip_state(z[t, d], s[t, d] - distal, at.law.presliding)
            s[t, d] = distal
        s[t, 0] += bowing[t]


@inner
def step_once(at, state, LU):
    """One Newton step with the factors LU of a neighbouring problem's tangent at state.q. Commits the slip.

    Returns 1, or 0 where lost.
    """
    q = state.q
    r, none = np.empty(q.size), np.empty((0, 0))
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    place(at, q)
    bowing = balance(at, state, z, s, r, none)
    substitute(LU, r)
    longest = 0.0
    for i in range(q.size):
        q[i] -= r[i]
        longest = max(longest, abs(r[i]) / at.chain.unit[i])
    place(at, q)
    commit(at, state, bowing)
    return 1 if longest < LONGEST_STEP else 0
