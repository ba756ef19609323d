"""A jaw between two antagonist tendons, sample by sample.

With y = pulley (a - rest) the tendon that the jaw's turn takes of tendon 1 (m), u_i what the drum pulls in, the tendons are longer
than at rest by u_1 - y and u_2 + y, which gives their tensions T_i at the drum, T_i >= 0, through

    e(T) = stretch (1 - exp(-k (T - T_0))) / k + least (T - T_0),    k = stiffening (k = 0: Hooke's law)

and the jaw stands where its hinge is in balance under the outer torque tau, friction taking its share over the wrap angle w:

    G(y) = T_1(u_1 - y) exp(-mu w z) - T_2(u_2 + y) exp(mu w z) + tau / pulley = 0,    z = clip(z_0 + (y - y_0) / presliding, -1, 1)

G falls with y, so that there is one answer: Newton's method within a bracket that shrinks.
"""

from __future__ import annotations

import math

import numpy as np

from twin.compiled import jit
from twin.effects import Creep, Loads, Route
from twin.effects.tendon_friction import slip_state
from twin.equilibrium.lengths import STIFFEST
from twin.equilibrium.path import DIRECT, NOT_FOUND, Path
from twin.robots import Jaw

CLOSE = 1e-13  # m of tendon: 1e-11 rad of a pulley of a centimetre
ROUNDS = 200  # a bracket halved so often is closed
REACH = 1e-3  # m, first width of the bracket


@jit
def longer(T, rest, stretch, stiffening):
    """What a tendon under T (N) is longer than at rest (m), and its derivative (m/N)."""
    if stiffening == 0.0:
        return (stretch + STIFFEST) * (T - rest), stretch + STIFFEST
    bent = math.exp(-stiffening * (T - rest))
    return stretch / stiffening * (1.0 - bent) + STIFFEST * (T - rest), stretch * bent + STIFFEST


@jit
def pull(e, rest, stretch, stiffening):
    """Tension (N) of a tendon that is e (m) longer than at rest, and its derivative (N/m): the inverse of `longer`, slack below it.

    `longer` is concave: from a tension below the answer Newton's steps rise to it and never pass it.
    """
    if e < 0.0 and stretch > 0.0 and stiffening > 0.0:
        T = max(0.0, rest - math.log(1.0 - stiffening * e / stretch) / stiffening)
    else:
        T = max(0.0, rest + e / (stretch + STIFFEST))
    for _ in range(ROUNDS):
        now, slope = longer(T, rest, stretch, stiffening)
        step = (e - now) / slope
        if T == 0.0 and step <= 0.0:
            return 0.0, 0.0
        T = max(0.0, T + step)
        if abs(step) <= 1e-14 * (1.0 + T):
            break
    return T, 1.0 / longer(T, rest, stretch, stiffening)[1]


@jit
def unbalance(y, u1, u2, load, y0, z0, loss, presliding, rest, stretch, stiffening):
    """G and dG/dy at y, with the tensions and the slip state there; load = tau / pulley (N), loss = mu w."""
    T1, k1 = pull(u1 - y, rest, stretch, stiffening)
    T2, k2 = pull(u2 + y, rest, stretch, stiffening)
    z = slip_state(z0, y - y0, presliding)
    down, up = math.exp(-loss * z), math.exp(loss * z)
    slope = -k1 * down - k2 * up
    if abs(z) < 1.0:
        slope -= loss / presliding * (T1 * down + T2 * up)
    return T1 * down - T2 * up + load, slope, T1, T2, z


@jit
def run(u, load, loss, presliding, rest, stretch, stiffening, y_out, T_out):
    """Follow displacements u (n, 2) m and loads (n,) N: y (n,) m and base tensions (n, 2) N out; returns the last slip state.

    The start is without friction: where a trial comes from is not known.
    """
    y, z = 0.5 * (u[0, 0] - u[0, 1]), 0.0
    for i in range(u.shape[0]):
        lost = loss if i > 0 else 0.0
        y0, z0 = y, z
        low, high, width = y, y, REACH
        while unbalance(low, u[i, 0], u[i, 1], load[i], y0, z0, lost, presliding, rest, stretch, stiffening)[0] < 0.0:
            low, width = low - width, 2.0 * width
        width = REACH
        while unbalance(high, u[i, 0], u[i, 1], load[i], y0, z0, lost, presliding, rest, stretch, stiffening)[0] > 0.0:
            high, width = high + width, 2.0 * width
        for _ in range(ROUNDS):
            G, slope, T1, T2, z = unbalance(y, u[i, 0], u[i, 1], load[i], y0, z0, lost, presliding, rest, stretch, stiffening)
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
            z = 0.0
        y_out[i], T_out[i, 0], T_out[i, 1] = y, T1, T2
    return z


class Antagonists:
    """A compiled jaw ready to be solved, with the calling convention of `Dynamics`."""

    def __init__(self, body: Jaw) -> None:
        self.model, self.body = body.spec.compile(), body
        self.straight_path = np.zeros(2)

    def solve(
        self, time: np.ndarray, displacement: np.ndarray, loads: Loads, route: Route, creep: Creep, delayed: np.ndarray,
        stiffness: np.ndarray | None = None,
    ) -> Path:  # fmt: skip
        """Equilibria under displacements (n, 2) m and the loads' torque. A rigid jaw has no `creep` and no `stiffness`."""
        n, body = len(time), self.body
        y, tension = np.empty(n), np.empty((n, 2))
        load = np.broadcast_to(np.asarray(loads.torque, float), n) / body.pulley
        z = run(
            np.ascontiguousarray(displacement, float), np.ascontiguousarray(load), float(route.mu * body.wrap),
            float(route.presliding), float(body.pretension), float(body.stretch + route.stretch), float(route.stiffening), y,
            tension,
        )  # fmt: skip
        path = np.stack([-y, y], axis=1)
        return Path(
            tension=tension,
            markers=np.empty((n, 0, 3)),
            path=path,
            q=(body.rest + y / body.pulley)[:, None],
            temperature=np.full((n, 2), np.nan),
            status=np.where(np.isfinite(y), DIRECT, NOT_FOUND),
            started=DIRECT,
            slip=np.array([[z], [-z]]),
            distal=path[-1:].T.copy(),
            LU=np.empty((0, 1, 1)),
        )

    def drum(self, displacement: np.ndarray) -> np.ndarray:
        """Angle (n, 1) rad of the drum under displacements (n, 2) m: what both tendons have lost is slack."""
        return 0.5 * (displacement[:, :1] - displacement[:, 1:]) / self.body.drum

    def joints(self, displacement: np.ndarray, path: Path, loads: Loads) -> tuple[np.ndarray, np.ndarray]:
        """Angles (n, 2) rad of drum and jaw, and torques (n, 2) N m that act on them from outside."""
        n = len(path.q)
        angle = np.column_stack([self.drum(displacement), path.q])
        turning = self.body.drum * (path.tension[:, 0] - path.tension[:, 1])
        return angle, np.column_stack([turning, np.broadcast_to(loads.torque, n)])
