"""The static solve: chord Newton with the exact tangent, and a path to follow where Newton fails.

A factorised tangent is kept from solve to solve and used as long as each step shrinks the residual fourfold (steps in between
are improved by one-deep Anderson mixing); else a fresh tangent is factorised. Convergence is max |r_i / K_i| < tol (rad).

Where Newton fails (a saddle, a fold, a jump), the overdamped motion K q' = -dE/dq is followed by implicit Euler with growing
steps, the slip states of friction committed at each, until a stable equilibrium is reached.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.equilibrium.chain import balance
from twin.equilibrium.engine import mj_com_pos, mj_kinematics
from twin.equilibrium.linear import factorise, substitute

CONTRACTION = 0.25  # a chord step that shrinks the residual less than this asks for a fresh tangent
GROWTH = 3.0  # a Newton step that lets the residual grow more than this is halved
LONGEST_STEP = 0.5  # rad, of any hinge
NEWTON_STEPS = 30
FLOW_STEPS = 200
FLOW_TOLERANCE = 1e-6  # rad, of the steps on the way


@jit
def place(model, data, chain, q):
    """MuJoCo's kinematics at q: all of chain's views move."""
    chain.qpos[:] = q
    mj_kinematics(model, data)
    mj_com_pos(model, data)


@jit
def newton(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, flow, anchor, tol, limit, certify):
    """Solve r(q) + flow K (q - anchor) = 0 from q. Returns the iterations, negative where it failed.

    On success (z, s) are committed. `fresh[0]` says whether LU holds a usable factorisation. With `certify` a solution with a
    non-positive pivot (not a minimum of the energy) counts as failed.
    """
    nv = q.shape[0]
    K = chain.stiffness
    r, J = np.empty(nv), np.empty((nv, nv))
    z1, s1 = np.zeros_like(z), np.zeros_like(s)
    before, step, last, dq = 1e300, 1.0, q.copy(), np.zeros(nv)
    mix, f0 = False, np.zeros(nv)
    have = fresh[0]
    for it in range(1, limit + 1):
        tangent = not have
        place(model, data, chain, q)
        balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, J, tangent)
        r += flow * K * (q - anchor)
        size = np.abs(r / K).max()
        if not size < 1e9 or (tangent and size > GROWTH * before):
            if step < 1e-3:
                return -it
            step *= 0.5
            fresh[0] = have = False
            q[:] = last + step * dq
            continue
        if size < tol:
            if certify:
                balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, J, True)
                LU[:] = J
                fresh[0] = factorise(LU)
                if not fresh[0]:
                    return -it
            z[:] = z1
            s[:] = s1
            return it
        if not tangent and size > CONTRACTION * before and it > 1:
            balance(q, rest, chain, tension, law, load, z, s, z1, s1, r, J, True)
            r += flow * K * (q - anchor)
            tangent = True
        if tangent:
            LU[:] = J
            for i in range(nv):
                LU[i, i] += flow * K[i]
            fresh[0] = factorise(LU)
            if not fresh[0]:
                return -it
        have = True
        before = size
        f = -r
        substitute(LU, f)
        w = f - f0
        ww = (w * w).sum()
        theta = (f * w).sum() / ww if mix and not tangent and ww > 0.0 else 0.0
        f0[:] = f
        dq[:] = f - theta * (dq + w)
        last[:] = q
        step = min(1.0, LONGEST_STEP / np.abs(dq).max())
        mix = step == 1.0
        q += step * dq
    return -limit


@jit
def solve(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, tol, certify):
    """Equilibrium near q. Returns 1: found directly; 2: found by following the motion (q was no stable start); 0: not found."""
    start = q.copy()
    if newton(model, data, chain, rest, tension, law, load, z, s, q, LU, fresh, 0.0, start, tol, NEWTON_STEPS, certify) > 0:
        return 1
    q[:] = start
    flow = 1.0
    z_before, s_before = z.copy(), s.copy()
    for k in range(FLOW_STEPS):
        start[:] = q
        z_before[:] = z
        s_before[:] = s
        fresh[0] = False
        final = flow == 0.0
        n = newton(
            model,
            data,
            chain,
            rest,
            tension,
            law,
            load,
            z,
            s,
            q,
            LU,
            fresh,
            flow,
            start,
            tol if final else FLOW_TOLERANCE,
            15,
            final,
        )
        fresh[0] = False
        if n <= 0:
            q[:] = start
            z[:] = z_before
            s[:] = s_before
            flow = max(4.0 * flow, 0.05)
            continue
        if final:
            return 2
        moved = np.abs(q - start).max()
        flow = 0.0 if moved * flow < 1e-4 else 0.5 * flow
        if k == 0 and moved < 1e-9:  # exactly on a saddle: leave it
            for i in range(q.size):
                q[i] += 1e-3 * (1 + 7 * i % 5)
    return 0
