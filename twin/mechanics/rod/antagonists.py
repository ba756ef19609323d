"""A jaw between two antagonist tendons, sample by sample.

Let y = pulley (a - rest) be the length of tendon 1 that the jaw's rotation takes up (m), and u_i the length that the drum winds in.
The tendons are longer than at rest by u_1 - y and u_2 + y, which gives their tensions T_i >= 0 at the drum through

    e(T) = stretch (T - T_0) + S (1 - exp(-(T - T_0) / T_b)),    S, T_b: bedding and the tension over which it happens

The jaw rests where its hinge is in balance under the external torque tau, with friction over the wrap angle w, and a bearing
friction up to F_b = torque / |pulley|, which may change from sample to sample with the rate:

    G(y) = T_1(u_1 - y) exp(-mu w z) - T_2(u_2 + y) exp(mu w z) - f + tau / pulley = 0
    z = clip(z_0 + (y - y_0) / presliding, -1, 1)
    f = clip(f_0 + F_b (y - y_0) / presliding, -F_b, F_b)

A limit F_b that grows as the jaw comes to rest does not push it: f changes by motion alone.

G falls with y, so the solution is unique. It is found by Newton's method within a bracket that shrinks.
"""

import math
from typing import NamedTuple

import numpy as np

from twin.body import DIRECT, NOT_FOUND
from twin.effects.tendon_friction import slip_state
from twin.foundation.compiled import jit
from twin.mechanics.rod.balance.tendon_actuation import LEAST_STRETCH

JAW_TOLERANCE = 1e-13  # m of tendon, 1e-11 rad of a pulley of a centimetre
MOST_JAW_ITERATIONS = 200  # enough to close a bracket by halving
FIRST_BRACKET = 1e-3  # m, its first width


class TendonPair(NamedTuple):
    """Two antagonist tendons."""

    rest: float  # N, the tension of both at rest
    stretch: float  # m/N
    bedding: float  # m, S
    bedding_tension: float  # N, T_b
    loss: float  # mu w
    presliding: float  # m
    bearing_presliding: float  # m


@jit
def tendon_extension(T, pair):
    """Return by how much a tendon under T (N) is longer than at rest (m), and the derivative (m/N)."""
    rest, stretch = pair.rest, pair.stretch + LEAST_STRETCH
    if pair.bedding == 0.0:
        return stretch * (T - rest), stretch
    loose = math.exp(-(T - rest) / pair.bedding_tension)
    return pair.bedding * (1.0 - loose) + stretch * (T - rest), pair.bedding / pair.bedding_tension * loose + stretch


@jit
def bedding_tension_at(e, pair):
    """Return the tension (N) of a tendon with bedding alone, e < 0 (m) shorter than at rest."""
    return pair.rest - pair.bedding_tension * math.log(1.0 - e / pair.bedding)


@jit
def tendon_tension(e, pair):
    """Return the tension (N) of a tendon e (m) longer than at rest, and its derivative (N/m). A slack tendon has none.

    This is the inverse of `tendon_extension`, which is concave: from a tension below the solution Newton's steps rise to it and
    never pass it.
    """
    if e < 0.0 and pair.bedding > 0.0:
        # Start below the solution: bedding and stretch share the shortening, so either alone gives a lower bound.
        T = max(0.0, bedding_tension_at(e, pair), pair.rest + e / (pair.stretch + LEAST_STRETCH))
    elif pair.bedding > 0.0:
        T = pair.rest
    else:
        T = max(0.0, pair.rest + e / (pair.stretch + LEAST_STRETCH))
    for _ in range(MOST_JAW_ITERATIONS):
        now, slope = tendon_extension(T, pair)
        step = (e - now) / slope
        if T == 0.0 and step <= 0.0:
            return 0.0, 0.0
        T = max(0.0, T + step)
        if abs(step) <= 1e-14 * (1.0 + T):
            break
    return T, 1.0 / tendon_extension(T, pair)[1]


class JawSample(NamedTuple):
    """A sample, and the state at the last one.

    Lengths that the drum winds in (m), load tau / pulley (N), bearing limit F_b (N); y0 (m), z0, f0 (N).
    """

    u1: float
    u2: float
    load: float
    most: float
    y0: float
    z0: float
    f0: float


@jit
def force_imbalance(y, at, pair):
    """Return G and dG/dy at y, with the tensions, the slip state and the bearing's force there."""
    T1, k1 = tendon_tension(at.u1 - y, pair)
    T2, k2 = tendon_tension(at.u2 + y, pair)
    z = slip_state(at.z0, y - at.y0, pair.presliding)
    stiffness = at.most / pair.bearing_presliding
    f = min(max(at.f0 + stiffness * (y - at.y0), -at.most), at.most)
    down, up = math.exp(-pair.loss * z), math.exp(pair.loss * z)
    slope = -k1 * down - k2 * up
    if abs(z) < 1.0:
        slope -= pair.loss / pair.presliding * (T1 * down + T2 * up)
    if abs(f) < at.most:
        slope -= stiffness
    return T1 * down - T2 * up - f + at.load, slope, T1, T2, z, f


@jit
def bracket_root(at, pair):
    """Return low, high with G(low) >= 0 >= G(high), around the last y."""
    low, high, width = at.y0, at.y0, FIRST_BRACKET
    while force_imbalance(low, at, pair)[0] < 0.0:
        low, width = low - width, 2.0 * width
    width = FIRST_BRACKET
    while force_imbalance(high, at, pair)[0] > 0.0:
        high, width = high + width, 2.0 * width
    return low, high


@jit
def run_jaw(u, load, most, pair, smooth, y_out, T_out):
    """Fill y (n,) m and base tensions (n, 2) N for displacements u (n, 2) m, loads and bearing limits (n,) N.

    The start is without friction, of the `smooth` pair, since the history before a trial is unknown.
    """
    y, z, f = 0.5 * (u[0, 0] - u[0, 1]), 0.0, 0.0
    for i in range(u.shape[0]):
        at = JawSample(u[i, 0], u[i, 1], load[i], most[i] if i > 0 else 0.0, y, z, f)
        now = pair if i > 0 else smooth
        low, high = bracket_root(at, now)
        for _ in range(MOST_JAW_ITERATIONS):
            G, slope, T1, T2, z, f = force_imbalance(y, at, now)
            if G > 0.0:
                low = max(low, y)
            elif G < 0.0:
                high = min(high, y)
            else:
                break
            new = y - G / slope if slope < 0.0 else 0.5 * (low + high)
            if not low < new < high:
                new = 0.5 * (low + high)
            if abs(new - y) < JAW_TOLERANCE:
                break
            y = new
        if i == 0:
            z, f = 0.0, 0.0
        y_out[i], T_out[i, 0], T_out[i, 1] = y, T1, T2


def solve_jaw(u: np.ndarray, load: np.ndarray, most: np.ndarray, pair: TendonPair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return tendon travel y (n,) m, base tensions (n, 2) N and status (n,) of a trial.

    Inputs are displacements u (n, 2) m, loads tau / pulley (n,) N and bearing limits F_b (n,) N.
    """
    y, tension = np.empty(len(u)), np.empty((len(u), 2))
    pair = TendonPair(*(float(x) for x in pair))
    rows = (np.ascontiguousarray(x, float) for x in (u, load, most))
    run_jaw(*rows, pair, pair._replace(loss=0.0), y, tension)
    return y, tension, np.where(np.isfinite(y), DIRECT, NOT_FOUND)
