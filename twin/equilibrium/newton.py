"""The static solve: chord Newton with the exact tangent, and a path to follow where Newton fails.

A factorised tangent is kept from solve to solve and used as long as each step shrinks the residual fourfold (steps in between
are improved by one-deep Anderson mixing); else a fresh tangent is factorised. Convergence is max |r_i / K_i| < tol (rad; of a
slide, shares of the length it stretches).

Where Newton fails (a saddle, a fold, a jump), the overdamped motion K q' = -dE/dq is followed by implicit Euler with growing
steps, the slip states of friction committed at each, until a stable equilibrium is reached.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import assign, dot, jit
from twin.effects.tendon_friction import slip_state
from twin.equilibrium.chain import balance
from twin.equilibrium.engine import mj_com_pos, mj_kinematics
from twin.equilibrium.linear import factorise, substitute

CONTRACTION = 0.25  # a chord step that shrinks the residual less than this asks for a fresh tangent
GROWTH = 3.0  # a Newton step that lets the residual grow more than this is halved
LOST = 1e9  # rad: a residual beyond it is a diverged step
LONGEST_STEP = 0.5  # rad, of any hinge
NEWTON_STEPS = 30
KINKED = 3  # steps with a fresh tangent that do not halve the residual: it goes round a kink of friction or a wall, so shorter ones
SHORTER = 0.6  # of those; of 60 pulls at mu 0.25 three meet a failure, with half steps 23 (they go round too), with full ones 26
CYCLES = 10  # such steps at most
FLOW_STEPS = 200
FLOW_TOLERANCE = 1e-6  # rad, of the steps on the way


@jit
def place(model, data, chain, q):
    """MuJoCo's kinematics at q: all of chain's views move."""
    assign(chain.qpos, q)
    mj_kinematics(model, data)
    mj_com_pos(model, data)


@jit
def newton(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, flow, anchor, tol):
    """Solve r(q) + flow K (q - anchor) = 0 from q. Returns the iterations, negative where it failed.

    On success (z, s) are committed. `fresh[0]` says whether LU holds a usable factorisation.
    """
    nv = q.shape[0]
    K = chain.stiffness
    r, J, none = np.empty(nv), np.empty((nv, nv)), np.empty((0, 0))
    z1, s1 = np.zeros(z.shape), np.zeros(s.shape)
    before, step, slow = 1e300, 1.0, 0
    last, dq, f, f0 = np.empty(nv), np.zeros(nv), np.empty(nv), np.zeros(nv)
    mix = False
    have = fresh[0]
    for it in range(1, NEWTON_STEPS + 1):
        tangent = not have
        place(model, data, chain, q)
        balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, J if tangent else none)
        size, lost = 0.0, False
        for i in range(nv):
            r[i] += flow * K[i] * (q[i] - anchor[i])
            x = abs(r[i] / K[i]) / chain.unit[i]
            size = max(size, x)
            lost = lost or not x < LOST  # also where x is no number, which isfinite may miss under fast-math
        if lost or (tangent and size > GROWTH * before):
            if step < 1e-3 or it == 1:
                return -it
            step *= 0.5
            have = False
            fresh[0] = False
            for i in range(nv):
                q[i] = last[i] + step * dq[i]
            continue
        if size < tol:
            for t in range(z.shape[0]):
                assign(z[t], z1[t])
                assign(s[t], s1[t])
            return it
        if not tangent and size > CONTRACTION * before and it > 1:
            balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, J)
            for i in range(nv):
                r[i] += flow * K[i] * (q[i] - anchor[i])
            tangent = True
        if tangent:
            if it > 1 and size > 0.5 * before:
                slow += 1
                if slow > CYCLES:
                    return -it
            for i in range(nv):
                assign(LU[i], J[i])
                LU[i, i] += flow * K[i]
            fresh[0] = factorise(LU)
            if not fresh[0]:
                return -it
        have = True
        before = size
        for i in range(nv):
            f[i] = -r[i]
        substitute(LU, f)
        ww, fw, longest = 0.0, 0.0, 0.0
        for i in range(nv):
            w = f[i] - f0[i]
            ww += w * w
            fw += f[i] * w
        theta = fw / ww if mix and not tangent and ww > 0.0 else 0.0
        for i in range(nv):
            dq[i] = f[i] - theta * (dq[i] + f[i] - f0[i])
            f0[i] = f[i]
            last[i] = q[i]
            longest = max(longest, abs(dq[i]) / chain.unit[i])
        step = min(1.0, LONGEST_STEP / longest)
        if slow > KINKED:
            step *= SHORTER
        mix = step == 1.0
        for i in range(nv):
            q[i] += step * dq[i]
    return -NEWTON_STEPS


@jit
def is_minimum(model, data, chain, rest, tension, law, load, z, s, q, LU):
    """Whether the tangent at q is positive, so that q is a stable shape. Leaves its factors in LU."""
    r, z1, s1 = np.empty(q.size), np.zeros(z.shape), np.zeros(s.shape)
    place(model, data, chain, q)
    balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, LU)
    return factorise(LU)


@jit
def follow(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, tol):
    """Equilibrium reached by the overdamped motion from q. Returns whether there was one."""
    flow = 1.0
    start, z_before, s_before = np.empty(q.size), np.empty(z.shape), np.empty(s.shape)
    for k in range(FLOW_STEPS):
        assign(start, q)
        for t in range(z.shape[0]):
            assign(z_before[t], z[t])
            assign(s_before[t], s[t])
        fresh[0] = False
        final = flow == 0.0
        n = newton(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, flow, start, tol if final else FLOW_TOLERANCE)
        fresh[0] = False
        if n > 0 and final:
            if is_minimum(model, data, chain, rest, tension, law, load, z, s, q, LU):
                return True
            n = -n
        if n <= 0:
            assign(q, start)
            for t in range(z.shape[0]):
                assign(z[t], z_before[t])
                assign(s[t], s_before[t])
            flow = max(4.0 * flow, 0.05)
            continue
        moved = 0.0
        for i in range(q.size):
            moved = max(moved, abs(q[i] - start[i]) / chain.unit[i])
        flow = 0.0 if moved * flow < 1e-4 else 0.5 * flow
        if k == 0 and moved < 1e-9:  # exactly on a saddle: leave it
            for i in range(q.size):
                q[i] += 1e-3 * (1 + 7 * i % 5) * chain.unit[i]
    return False


@jit
def solve(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, tol):
    """Equilibrium near q. Returns 1: found directly; 2: found by following the motion (q was no stable start); 0: not found."""
    start = q.copy()
    if newton(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, 0.0, start, tol) > 0:
        return 1
    assign(q, start)
    return 2 if follow(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, tol) else 0


@jit
def commit(chain, law, z, s, bowing):
    """Advance slip states and distal lengths to the geometry in MuJoCo's data, `bowing` (m) as before the step: it changes by 1e-3
    of what the path does."""
    for t in range(z.shape[0]):
        distal = 0.0
        for d in range(z.shape[1] - 1, -1, -1):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            distal += np.sqrt(dot(v, v))
            z[t, d] = slip_state(z[t, d], s[t, d] - distal, law.presliding)
            s[t, d] = distal
        s[t, 0] += bowing


@jit
def step_once(model, data, chain, rest, tension, law, load, z, s, q, LU):
    """One Newton step from q with the factors LU of a neighbouring problem's tangent there. Commits (z, s).

    Returns 1, or 0 where lost.
    """
    r, none = np.empty(q.size), np.empty((0, 0))
    z1, s1 = np.empty(z.shape), np.empty(s.shape)
    place(model, data, chain, q)
    bowing = balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, none)
    substitute(LU, r)
    longest = 0.0
    for i in range(q.size):
        q[i] -= r[i]
        longest = max(longest, abs(r[i]) / chain.unit[i])
    place(model, data, chain, q)
    commit(chain, law, z, s, bowing)
    return 1 if longest < LONGEST_STEP else 0
