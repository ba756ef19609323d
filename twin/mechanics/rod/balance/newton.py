"""Equilibria under given tensions: chord Newton with the exact tangent, and an overdamped flow where Newton fails.

A factorised tangent is kept from solve to solve and used as long as each step shrinks the residual fourfold. Steps in between are
improved by one-deep Anderson mixing. Otherwise a new tangent is factorised. Convergence is max |r_i / K_i| < tol (rad; for a slide,
shares of the length it stretches).

Where Newton fails (a saddle, a fold, a jump), the overdamped motion K q' = -dE/dq is followed by implicit Euler with growing steps,
committing the slip states of friction at each, until a stable equilibrium is reached.
"""

from typing import NamedTuple

import numpy as np

from twin.effects.tendon_friction import slip_state
from twin.foundation.by_reference import by_reference, refer_to
from twin.foundation.compiled import assign, dot, jit, jit_inline, jit_internal
from twin.mechanics.mujoco_symbols import mj_com_pos, mj_kinematics
from twin.mechanics.rod.balance.chain import commit_slip, copy_state, force_balance, point_velocity, set_state
from twin.mechanics.rod.balance.linear import factorise, substitute

CHORD_CONTRACTION = 0.25  # of the residual; a chord step that leaves more calls for a new tangent
RESIDUAL_GROWTH = 3.0  # a Newton step after which the residual is larger by more than this factor is halved
DIVERGED_RESIDUAL = 1e9  # rad
LONGEST_HINGE_STEP = 0.5  # rad, of any hinge
POST_STEP_SHARE = 0.25  # of a post's radius, the longest move of a disk in a step: a longer one may land behind the post
NEWTON_STEPS = 30
# Steps with a new tangent that do not halve the residual cycle around a kink of friction or a wall; damped steps leave the cycle.
SLOW_STEPS_BEFORE_DAMPING = 3
DAMPED_STEP = 0.6  # of a step; of 60 pulls at mu 0.25 three fail, with 0.5 23 (they cycle too), with 1.0 26
MOST_SLOW_STEPS = 10
FLOW_STEPS = 200
FLOW_TOLERANCE = 1e-6  # rad, of the intermediate steps


@by_reference
class Factors(NamedTuple):
    """The factorised tangent, kept from solve to solve."""

    LU: np.ndarray  # (nv, nv)
    usable: np.ndarray  # (1,) whether LU holds a valid factorisation
    held_tendons: np.ndarray  # (n_tendon,) tendons whose held lengths are part of LU (lengths.py)
    tension_response: np.ndarray  # (n_tendon, nv) rad/N, response of the joints to the tension of held tendons: LU^-1 dr/dT


@jit
def empty_factors(nv, nt):
    """Return unused factors, marked as not valid."""
    return refer_to(Factors(np.empty((nv, nv)), np.zeros(1, np.bool_), np.zeros(nt, np.bool_), np.empty((nt, nv))))


class Flow(NamedTuple):
    """A step of implicit Euler of the overdamped motion K q' = -dE/dq from `anchor`. Rate 0 is the equilibrium itself."""

    rate: float  # 1/s
    anchor: np.ndarray  # (nv,)


@jit
def update_kinematics(system, q):
    """Run MuJoCo's kinematics at q. All views of the chain change."""
    assign(system.chain.qpos, q)
    mj_kinematics(system.model, system.data)
    mj_com_pos(system.model, system.data)


@jit_internal
def add_flow_drag(chain, flow, q, r):
    """Add the flow's drag to r. Return the largest r_i / K_i (rad), and whether it has diverged."""
    size, lost = 0.0, False
    for i in range(q.size):
        r[i] += flow.rate * chain.stiffness[i] * (q[i] - flow.anchor[i])
        x = abs(r[i] / chain.stiffness[i]) / chain.unit[i]
        size = max(size, x)
        lost = lost or not x < DIVERGED_RESIDUAL  # also true where x is NaN, which isfinite may miss under fast-math
    return size, lost


class StepHistory(NamedTuple):
    """Newton's iteration: the last two right-hand sides, the step and its start, (nv,) each."""

    f: np.ndarray
    f0: np.ndarray
    dq: np.ndarray
    last: np.ndarray


@jit_internal
def next_step(LU, r, q, unit, mix, steps):
    """Compute the next step dq from the residual. Return its largest change (rad).

    With `mix` the step is improved by one-deep Anderson mixing.
    """
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


@jit_internal
def step_fraction(system, dq, longest):
    """Return the fraction of a step dq, of largest change `longest` (rad), that may be taken from the present shape."""
    chain, curvature, share = system.chain, system.law.wall[9], min(1.0, LONGEST_HINGE_STEP / longest)
    if curvature > 0.0:
        for k in range(chain.disk.size):
            x, moved = chain.site[chain.disk[k]], np.zeros(3)
            for i in range(chain.disk_joints[k]):
                v = point_velocity(chain, i, x)
                for a in range(3):
                    moved[a] += v[a] * dq[i]
            share = min(share, POST_STEP_SHARE / (1e-9 + curvature * np.sqrt(dot(moved, moved))))
    return share


@jit_internal
def solve_newton(system, state, factors, flow, tol):
    """Solve r(q) + rate K (q - anchor) = 0 from state.q. Return the iterations, negative on failure.

    On success slip states and distal lengths are committed.
    """
    chain, q, LU, usable = system.chain, state.q, factors.LU, factors.usable
    nv = q.size
    r, J, none = np.empty(nv), np.empty((nv, nv)), np.empty((0, 0))
    z, s = np.zeros(state.z.shape), np.zeros(state.s.shape)
    steps = StepHistory(np.empty(nv), np.zeros(nv), np.zeros(nv), np.empty(nv))
    before, step, slow, mix, have = 1e300, 1.0, 0, False, usable[0]
    for it in range(1, NEWTON_STEPS + 1):
        tangent = not have
        update_kinematics(system, q)
        force_balance(system, state, z, s, r, J if tangent else none)
        size, lost = add_flow_drag(chain, flow, q, r)
        if lost or (tangent and size > RESIDUAL_GROWTH * before):
            if step < 1e-3 or it == 1:
                return -it
            step *= 0.5
            have = usable[0] = False
            for i in range(nv):
                q[i] = steps.last[i] + step * steps.dq[i]
            continue
        if size < tol:
            commit_slip(state, z, s)
            return it
        if not tangent and size > CHORD_CONTRACTION * before and it > 1:
            force_balance(system, state, z, s, r, J)
            add_flow_drag(chain, flow, q, r)
            tangent = True
        if tangent:
            slow += 1 if it > 1 and size > 0.5 * before else 0
            if slow > MOST_SLOW_STEPS:
                return -it
            for i in range(nv):
                assign(LU[i], J[i])
                LU[i, i] += flow.rate * chain.stiffness[i]
            usable[0] = factorise(LU)
            if not usable[0]:
                return -it
        have, before = True, size
        longest = next_step(LU, r, q, chain.unit, mix and not tangent, steps)
        step = step_fraction(system, steps.dq, longest) * (DAMPED_STEP if slow > SLOW_STEPS_BEFORE_DAMPING else 1.0)
        mix = step == 1.0
        for i in range(nv):
            q[i] += step * steps.dq[i]
    return -NEWTON_STEPS


@jit_inline
def is_minimum(system, state, LU):
    """Return whether the tangent is positive definite, so that the shape is stable. Leaves its factors in LU."""
    r, z, s = np.empty(state.q.size), np.zeros(state.z.shape), np.zeros(state.s.shape)
    update_kinematics(system, state.q)
    force_balance(system, state, z, s, r, LU)
    return factorise(LU)


@jit_internal
def follow_flow(system, state, factors, tol):
    """Follow the overdamped motion from the present state to an equilibrium. Return whether one was found."""
    rate, q, unit = 1.0, state.q, system.chain.unit
    start = copy_state(state)
    for k in range(FLOW_STEPS):
        set_state(start, state)
        factors.usable[0] = False
        final = rate == 0.0
        n = solve_newton(system, state, factors, Flow(rate, start.q), tol if final else FLOW_TOLERANCE)
        factors.usable[0] = False
        if n > 0 and final:
            if is_minimum(system, state, factors.LU):
                return True
            n = -n
        if n <= 0:
            set_state(state, start)
            rate = max(4.0 * rate, 0.05)
            continue
        moved = 0.0
        for i in range(q.size):
            moved = max(moved, abs(q[i] - start.q[i]) / unit[i])
        rate = 0.0 if moved * rate < 1e-4 else 0.5 * rate
        if k == 0 and moved < 1e-9:  # exactly on a saddle: perturb
            for i in range(q.size):
                q[i] += 1e-3 * (1 + 7 * i % 5) * unit[i]
    return False


@jit_inline
def no_flow(q):
    """Return the flow of rate 0: the equilibrium itself."""
    return Flow(0.0, q)


@jit_inline
def solve_near(system, state, factors, tol):
    """Find an equilibrium near state.q.

    Returns 1: found directly; 2: by following the flow (q was no stable start); 0: not found.
    """
    start = state.q.copy()
    if solve_newton(system, state, factors, no_flow(start), tol) > 0:
        return 1
    assign(state.q, start)
    return 2 if follow_flow(system, state, factors, tol) else 0


@jit_internal
def advance_slip(system, state, bowing):
    """Advance slip states and distal lengths to the geometry in MuJoCo's data.

    `bowing` (n_tendon,) m is taken from before the step: it changes by 1e-3 of the path's change.
    """
    chain, z, s = system.chain, state.z, state.s
    for t in range(z.shape[0]):
        distal = 0.0
        for d in range(chain.n_piece[t] - 1, -1, -1):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            distal += np.sqrt(dot(v, v))
            z[t, d] = slip_state(z[t, d], s[t, d] - distal, system.law.presliding)
            s[t, d] = distal
        s[t, 0] += bowing[t]


@jit_internal
def single_newton_step(system, state, LU):
    """Take one Newton step with the factors LU of a neighbouring problem's tangent at state.q, and commit the slip.

    Returns 1, or 0 where the step is too long.
    """
    q = state.q
    r, none = np.empty(q.size), np.empty((0, 0))
    z, s = np.empty(state.z.shape), np.empty(state.s.shape)
    update_kinematics(system, q)
    bowing = force_balance(system, state, z, s, r, none)
    substitute(LU, r)
    longest = 0.0
    for i in range(q.size):
        q[i] -= r[i]
        longest = max(longest, abs(r[i]) / system.chain.unit[i])
    update_kinematics(system, q)
    advance_slip(system, state, bowing)
    return 1 if longest < LONGEST_HINGE_STEP else 0
