"""From lengths and temperatures to the next: at once, in parts, or with a snap past an obstacle.

A robot whose lengths are held and that an obstacle has caught may find no shape near its last one: the branch ends in a fold. Then
it moves, the lengths held, until it rests again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, inner, jit
from twin.equilibrium.chain import become, copied
from twin.equilibrium.lengths import hold, tangent
from twin.equilibrium.newton import FLOW_STEPS, Flow, still

SMALLEST = 1e-3  # of a jump
WARY = 2e-4  # m: a part of it by a post, before which the robot may be caught; its tip moves by some 3 mm
SNAPS = 3  # in one jump; a robot that snaps more often is not followed


class Sought(NamedTuple):
    """What holds the tendons is to become: free lengths (n_tendon,) m of motors, temperatures (n_tendon,) K of springs."""

    free: np.ndarray
    temperature: np.ndarray


@jit
def reach(at, state, factors, held, last, sought, tol, wary):
    """Equilibrium with the tendons that motors and springs hold as `sought`, and all tensions.

    Where the guess state.q does not lead there the jump is made from the shape `last`, which was at held.free and held.temperature,
    in ever smaller parts if need be, or at once in such as `WARY` says. Where an obstacle leaves no shape near the last one the
    robot snaps past it. held.free and held.temperature follow.

    Returns 1, 2 where parts were needed, 0 where no tensions were found. Commits the slip; with parts, after each. The springs'
    memory is left to `remember`.
    """
    T, fresh = state.T, factors.fresh
    q0, T0, T1, was = last.copy(), T.copy(), T.copy(), Sought(held.free.copy(), held.temperature.copy())
    move(held, was, sought, 1.0)
    if not wary and hold(at, state, factors, held, still(q0), tol) == 1:
        return 1
    longest = 0.0
    for t in range(T.size):
        longest = max(longest, abs(held.free[t] - was.free[t]) if held.which[t] and not held.by_spring[t] else 0.0)
    whole = min(1.0, WARY / longest) if wary and longest > 0.0 else 1.0
    done, part = 0.0, whole
    snaps = 0
    while done < 1.0:
        move(held, was, sought, done + part)
        assign(T, T0)
        assign(state.q, q0)
        fresh[0] = False
        found = hold(at, state, factors, held, still(q0), tol) == 1
        if not found and part < 2.0 * SMALLEST:
            snaps += 1
            assign(T, T0)
            assign(state.q, q0)
            found = at.law.wall[4] > 0.0 and snaps <= SNAPS and snap(at, state, factors, held, tol)
            if not found:
                move(held, was, sought, 1.0)
                assign(T, T1)
                return 0
        if found:
            done += part
            part = min(2.0 * part, whole, 1.0 - done)
            assign(q0, state.q)
            assign(T0, T)
        else:
            part *= 0.5
    return 1 if wary else 2


@inner
def snap(at, state, factors, held, tol):
    """The overdamped motion K q' = -dE/dq at the lengths sought, as `newton.follow` at given tensions: a robot that an obstacle no
    longer holds goes past it. Returns whether it comes to rest in a stable shape."""
    rate, longest, start, unit = 1.0, 1.0, copied(state), at.chain.unit
    for _ in range(FLOW_STEPS):
        become(start, state)
        factors.fresh[0] = False
        found = hold(at, state, factors, held, Flow(rate, start.q), tol) == 1
        if found and rate == 0.0:
            found = tangent(at, state, held, 0.0, factors.LU, factors.held_by)
            if found:
                return True
        if not found:  # too long a step; or no rest near here, where it may be slow: then a longer one than before
            become(state, start)
            rate = 4.0 * rate if rate > 0.0 else 0.25 * longest
            continue
        moved = 0.0
        for i in range(unit.size):
            moved = max(moved, abs(state.q[i] - start.q[i]) / unit[i])
        longest, rate = rate, 0.0 if moved * rate < 1e-4 else 0.5 * rate
    factors.fresh[0] = False
    return False


@inner
def move(held, was, sought, share):
    """Sets held.free and held.temperature on the way from one to the other."""
    for t in range(sought.free.size):
        if not held.by_spring[t]:
            held.free[t] = was.free[t] + share * (sought.free[t] - was.free[t])
        held.temperature[t] = was.temperature[t] + share * (sought.temperature[t] - was.temperature[t])
