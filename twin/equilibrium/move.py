"""From one equilibrium to another, with the friction met on the way; and how the tip answers to tensions.

Tensions change together along a straight line from those of now to those wanted. A robot's state is (T, q, z, s): base tensions,
hinge angles, slip states and distal tendon lengths.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import assign, jit
from twin.equilibrium.chain import lever
from twin.equilibrium.lengths import pulls
from twin.equilibrium.linear import substitute
from twin.equilibrium.newton import is_minimum, newton, place, solve

STRIDE = 0.75  # N: the largest part; 0.75 against 0.02 moves the tip by some 0.1 mm at most (tests/test_kinematics.py)
SHORTEST = 1.0 / 16.0  # of a part: below it the robot is let go where it wants
TRIALS = 25  # Gauss-Newton steps of `seek`
CORRECTIONS = 12  # of its answer, the way there considered
DAMPING = 1e-3  # m/N: of a step, against directions in which all tendons pull against each other and the tip hardly moves
STALLED = 0.9  # of the error: a step that leaves more has found the nearest point, if the one before did too


@jit
def pull(model, data, chain, rest, law, load, goal, stride, tol, T, q, z, s, LU, fresh):
    """Advance the state (T, q, z, s) to tensions `goal` (n_tendon,) N in parts of at most `stride` N; 0 where lost."""
    nt, longest = T.size, 0.0
    start, before, last = T.copy(), q.copy(), q.copy()
    for t in range(nt):
        longest = max(longest, abs(goal[t] - T[t]))
    whole = min(1.0, stride / longest) if longest > 0.0 else 1.0
    done, part, parted = 0.0, whole, 0.0
    while True:
        for t in range(nt):
            T[t] = start[t] + (goal[t] - start[t]) * (done + part)
        for i in range(q.size):
            last[i] = q[i]
            q[i] += parted * (q[i] - before[i])  # `parted`: this part over the one before
        if newton(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, 0.0, last, tol) <= 0:
            # Short pre-sliding makes friction kinked, and Newton lose its way: a shorter part passes fewer kinks.
            assign(q, last)
            fresh[0] = False
            if part > SHORTEST * whole:
                part, parted = 0.5 * part, 0.5 * parted
                continue
            if solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol) == 0:
                return 0
        assign(before, last)
        done += part
        if done > 1.0 - 1e-12:
            return 1
        longer = min(whole, 2.0 * part, 1.0 - done)
        part, parted = longer, longer / part


@jit
def onward(model, data, chain, rest, law, load, T0, q0, tol, T, q, z, s, LU, fresh):
    """Equilibrium at tensions T from the guess q; where Newton does not lead there, from the state (T0, q0) before by `pull`.

    Short pre-sliding and large steps from sample to sample leave Newton no way, and what a robot let go of does on its own is not
    what a pulled one does. Returns 1, 2 where it was pulled, 0 where lost.
    """
    if newton(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, 0.0, q0, tol) > 0:
        return 1
    goal, z0, s0 = T.copy(), z.copy(), s.copy()
    assign(T, T0)
    assign(q, q0)
    fresh[0] = False
    if pull(model, data, chain, rest, law, load, goal, STRIDE, tol, T, q, z, s, LU, fresh) == 1:
        return 2
    for t in range(T.size):  # it snaps over on the way
        assign(z[t], z0[t])
        assign(s[t], s0[t])
    assign(T, goal)
    assign(q, q0)
    fresh[0] = False
    return solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol)


@jit
def answer(model, data, chain, rest, law, load, T, q, z, s, LU, site, below, gradient):
    """dx/dT (n_tendon, n_site, 3) m/N of the sites, each moved by the `below` (n_site,) first hinges, at an equilibrium.

        LU (nv, nv) then holds the factors of its tangent.
    dq/dT_t = -J^-1 dr/dT_t. False where the shape is unstable.
    """
    nt, nv = T.size, q.size
    A, B = np.empty((nt, nv)), np.empty((nt, nv))
    if not is_minimum(model, data, chain, rest, T, law, load, z, s, q, LU):
        return False
    pulls(chain, law, z, A, B)
    for t in range(nt):
        substitute(LU, B[t])
        for k in range(site.size):
            x = chain.site[site[k]]
            for a in range(3):
                gradient[t, k, a] = 0.0
            for i in range(below[k]):
                v = lever(chain, i, x)
                for a in range(3):
                    gradient[t, k, a] -= v[a] * B[t, i]
    return True


@jit
def seek(model, data, chain, rest, law, load, target, used, least, limit, tol, near, T0, q0, z0, s0, T, q, z, s, LU):
    """Tensions T of the tendons in `used` (n_tendon,), between `least` (n_tendon,) and `limit` N, whose tip comes nearest to
    `target` (3,) m when pulled at once from the state (T0, q0, z0, s0); T and q hold a first guess. Returns the distance (m),
    negative where lost.

    Bounded, damped Gauss-Newton, its steps halved while they lead away.
    """
    nt = T.size
    gradient, error, fresh = np.empty((nt, 1, 3)), np.empty(3), np.zeros(1, np.bool_)
    site, below = chain.disk[-1:], np.full(1, q.size)
    best_T, best_q, dT = T.copy(), q.copy(), np.zeros(nt)
    best, share, slow = 1e300, 1.0, 0
    free = np.empty(nt, np.bool_)
    for _ in range(TRIALS):
        for t in range(nt):
            assign(z[t], z0[t])
            assign(s[t], s0[t])
        found = solve(model, data, chain, rest, T, law, load, z, s, q, LU, fresh, tol)
        place(model, data, chain, q)
        tip = chain.site[chain.disk[-1]]
        size = 0.0
        for a in range(3):
            error[a] = target[a] - tip[a]
            size += error[a] * error[a]
        size = np.sqrt(size)
        if found == 0 or size > best:
            share *= 0.5
            if share < 1e-3:
                break
            for t in range(nt):
                T[t] = min(limit, max(least[t], best_T[t] + share * dT[t]))
            assign(q, best_q)
            fresh[0] = False
            continue
        slow = slow + 1 if size > STALLED * best else 0
        best, share = size, 1.0
        assign(best_T, T)
        assign(best_q, q)
        if size < near or slow > 1 or not answer(model, data, chain, rest, law, load, T, q, z, s, LU, site, below, gradient):
            break
        fresh[0] = True
        for t in range(nt):
            free[t] = used[t]
        step(gradient[:, 0], error, T, least, limit, free, dT)
        moved = 0.0
        for t in range(nt):
            new = min(limit, max(least[t], T[t] + dT[t]))
            moved = max(moved, abs(new - T[t]))
            T[t] = new
        if moved < 1e-7:
            break
    assign(T, best_T)
    assign(q, best_q)
    return best if best < 1e299 else -1.0


@jit
def step(gradient, error, T, least, limit, free, dT):
    """The Gauss-Newton step dT of the free tendons; one that would leave [least, limit] from its end of it is held there."""
    nt = T.size
    for _ in range(nt + 1):
        A = np.zeros((nt, nt))
        for i in range(nt):
            dT[i] = 0.0
            if not free[i]:
                A[i, i] = 1.0
                continue
            for a in range(3):
                dT[i] += gradient[i, a] * error[a]
            A[i, i] = DAMPING**2
            for j in range(nt):
                if free[j]:
                    for a in range(3):
                        A[i, j] += gradient[i, a] * gradient[j, a]
        dT[:] = np.linalg.solve(A, dT)
        held = False
        for i in range(nt):
            if free[i] and ((T[i] <= least[i] and dT[i] < 0.0) or (T[i] >= limit and dT[i] > 0.0)):
                free[i] = False
                held = True
        if not held:
            return


@jit
def refine(model, data, chain, rest, law, load, target, used, least, limit, tol, near, stride, T0, q0, z0, s0, T, q, z, s, LU):
    """As `seek`, from its answer T, but moving as `pull` does, in parts of `stride` N, whose friction is the one that counts.

    (T, q, z, s) become the state nearest to the target. Returns the distance (m), negative where lost.
    """
    nt = T.size
    gradient, error, fresh = np.empty((nt, 1, 3)), np.empty(3), np.zeros(1, np.bool_)
    site, below = chain.disk[-1:], np.full(1, q.size)
    goal, dT, best, share = T.copy(), np.zeros(nt), 1e300, 1.0
    best_T, best_q, best_z, best_s = T.copy(), q.copy(), z.copy(), s.copy()
    free = np.empty(nt, np.bool_)
    for _ in range(CORRECTIONS):
        assign(T, T0)
        assign(q, q0)
        for t in range(nt):
            assign(z[t], z0[t])
            assign(s[t], s0[t])
        fresh[0] = False
        if pull(model, data, chain, rest, law, load, goal, stride, tol, T, q, z, s, LU, fresh) == 0:
            break
        place(model, data, chain, q)
        tip = chain.site[chain.disk[-1]]
        size = 0.0
        for a in range(3):
            error[a] = target[a] - tip[a]
            size += error[a] * error[a]
        size = np.sqrt(size)
        if size >= best:
            share *= 0.5
            for t in range(nt):
                goal[t] = min(limit, max(least[t], best_T[t] + share * dT[t]))
            continue
        best, share = size, 1.0
        assign(best_T, T)
        assign(best_q, q)
        for t in range(nt):
            assign(best_z[t], z[t])
            assign(best_s[t], s[t])
        if size < near or not answer(model, data, chain, rest, law, load, T, q, z, s, LU, site, below, gradient):
            break
        for t in range(nt):
            free[t] = used[t]
        step(gradient[:, 0], error, T, least, limit, free, dT)
        for t in range(nt):
            goal[t] = min(limit, max(least[t], T[t] + dT[t]))
    assign(T, best_T)
    assign(q, best_q)
    for t in range(nt):
        assign(z[t], best_z[t])
        assign(s[t], best_s[t])
    return best if best < 1e299 else -1.0
