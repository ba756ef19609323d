"""A jaw between two antagonist tendons, sample by sample.

With y = pulley (a - rest) the tendon that the jaw's turn takes of tendon 1 (m), u_i what the drum pulls in, the tendons are longer
than at rest by u_1 - y and u_2 + y, which gives their tensions T_i at the drum, T_i >= 0, through

    e(T) = stretch (T - T_0) + S (1 - exp(-(T - T_0) / T_b)),    S, T_b: by how much and over which tension they bed in

and the jaw stands where its hinge is in balance under the outer torque tau, friction taking its share over the wrap angle w, and
the bearing up to F_b = torque / |pulley| of its own, which may change from sample to sample with the rate:

    G(y) = T_1(u_1 - y) exp(-mu w z) - T_2(u_2 + y) exp(mu w z) - f + tau / pulley = 0
    z = clip(z_0 + (y - y_0) / presliding, -1, 1)
    f = clip(f_0 + F_b (y - y_0) / presliding, -F_b, F_b)

A limit that grows as the jaw comes to rest does not push it: f follows by motion alone.

G falls with y, so that there is one answer: Newton's method within a bracket that shrinks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from twin.body import DIRECT, NOT_FOUND
from twin.compiled import jit
from twin.effects.tendon_friction import slip_state
from twin.equilibrium.holder import STIFFEST

CLOSE = 1e-13  # m of tendon: 1e-11 rad of a pulley of a centimetre
ROUNDS = 200  # a bracket halved so often is closed
REACH = 1e-3  # m, first width of the bracket


class Pair(NamedTuple):
    """Two antagonist tendons."""

    rest: float  # N, the tension of both at rest
    stretch: float  # m/N
    bedding: float  # m, S
    bedding_tension: float  # N, T_b
    loss: float  # mu w
    presliding: float  # m
    bearing_presliding: float  # m


@jit
def longer(T, pair):
    """What a tendon under T (N) is longer than at rest (m), and its derivative (m/N)."""
    rest, stretch = pair.rest, pair.stretch + STIFFEST
    if pair.bedding == 0.0:
        return stretch * (T - rest), stretch
    loose = math.exp(-(T - rest) / pair.bedding_tension)
    return pair.bedding * (1.0 - loose) + stretch * (T - rest), pair.bedding / pair.bedding_tension * loose + stretch


@jit
def rest_of_bedding(e, pair):
    """Tension (N) of a tendon that only beds in, e < 0 (m) shorter than at rest."""
    return pair.rest - pair.bedding_tension * math.log(1.0 - e / pair.bedding)


@jit
def pull(e, pair):
    """Tension (N) of a tendon that is e (m) longer than at rest, and its derivative (N/m): the inverse of `longer`, slack below it.

    `longer` is concave: from a tension below the answer Newton's steps rise to it and never pass it.
    """
    if e < 0.0 and pair.bedding > 0.0:
        # Below the answer: what the tendon is shorter by is shared, so that either part alone is a bound from below.
        T = max(0.0, rest_of_bedding(e, pair), pair.rest + e / (pair.stretch + STIFFEST))
    elif pair.bedding > 0.0:
        T = pair.rest
    else:
        T = max(0.0, pair.rest + e / (pair.stretch + STIFFEST))
    for _ in range(ROUNDS):
        now, slope = longer(T, pair)
        step = (e - now) / slope
        if T == 0.0 and step <= 0.0:
            return 0.0, 0.0
        T = max(0.0, T + step)
        if abs(step) <= 1e-14 * (1.0 + T):
            break
    return T, 1.0 / longer(T, pair)[1]


class At(NamedTuple):
    """A sample: what the drum pulls in (m), the load tau / pulley (N), the most that the bearing holds F_b (N), and where the jaw
    last stood: y (m), slip state z, the bearing's f (N)."""

    u1: float
    u2: float
    load: float
    most: float
    y0: float
    z0: float
    f0: float


@jit
def unbalance(y, at, pair):
    """G and dG/dy at y, with the tensions, the slip state and the bearing's force there."""
    T1, k1 = pull(at.u1 - y, pair)
    T2, k2 = pull(at.u2 + y, pair)
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
def bracket(at, pair):
    """low, high: G(low) >= 0 >= G(high), around where the jaw last stood."""
    low, high, width = at.y0, at.y0, REACH
    while unbalance(low, at, pair)[0] < 0.0:
        low, width = low - width, 2.0 * width
    width = REACH
    while unbalance(high, at, pair)[0] > 0.0:
        high, width = high + width, 2.0 * width
    return low, high


@jit
def run(u, load, most, pair, smooth, y_out, T_out):
    """Follow displacements u (n, 2) m and loads and `most` (n,) N: y (n,) m and base tensions (n, 2) N out.

    The start is without friction, of the `smooth` pair: where a trial comes from is not known.
    """
    y, z, f = 0.5 * (u[0, 0] - u[0, 1]), 0.0, 0.0
    for i in range(u.shape[0]):
        at = At(u[i, 0], u[i, 1], load[i], most[i] if i > 0 else 0.0, y, z, f)
        now = pair if i > 0 else smooth
        low, high = bracket(at, now)
        for _ in range(ROUNDS):
            G, slope, T1, T2, z, f = unbalance(y, at, now)
            if G > 0.0:
                low = max(low, y)
            elif G < 0.0:
                high = min(high, y)
            else:
                break
            new = y - G / slope if slope < 0.0 else 0.5 * (low + high)
            if not low < new < high:
                new = 0.5 * (low + high)
            if abs(new - y) < CLOSE:
                break
            y = new
        if i == 0:
            z, f = 0.0, 0.0
        y_out[i], T_out[i, 0], T_out[i, 1] = y, T1, T2


def follow(u: np.ndarray, load: np.ndarray, most: np.ndarray, pair: Pair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tendon y (n,) m that the jaw has taken of tendon 1, base tensions (n, 2) N and status (n,), under displacements u (n, 2) m,
    loads tau / pulley (n,) N and the most F_b (n,) N that the bearing holds."""
    y, tension = np.empty(len(u)), np.empty((len(u), 2))
    pair = Pair(*(float(x) for x in pair))
    rows = (np.ascontiguousarray(x, float) for x in (u, load, most))
    run(*rows, pair, pair._replace(loss=0.0), y, tension)
    return y, tension, np.where(np.isfinite(y), DIRECT, NOT_FOUND)
