"""A soft finger to a wanted shape: tendon shortenings from the distances of all its named points, a step at a time.

At every step the shape is estimated from what the strain sensors read, and tensions are sought that would bring it nearer,

    min over dT   mean |x* - x - dx/dT dT|^2 + EASY^2 |T + dT|^2,      least <= T + dT <= most,

dx/dT each tendon's own shape change, by the twin's tangent at the present tendon lengths. All tendons pull by `least` or more, so
that antagonists hold the finger between them; of what bends it alike the least pull is taken. Tendons are shortened by the share
1 - exp(-dt/SETTLE) of what would give these tensions, no faster than `rate`. Only the change of shape is the model's: what it is
wrong about is made up for from step to step, as by an integral. What dT leaves of the distances is what tendons cannot reach.

Tensions are the twin's own; nobody measures them. With all tendons taut their lengths are nearly redundant: pulling one pair and
letting the other go takes 5 um/N, so that on a finger that is not quite the twin some pair may be slack, or pull tenths of a newton
more than told.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078) projects vertex errors onto constant directions (`shape_baselines.py`); the
tangent, the limits and the residual are ours. Bounded least squares: Stark and Parker 1995, as in scipy.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from twin.control.held import HeldFinger
from twin.errors import DataError, SolveError
from twin.sensors import strain
from twin.shape.estimator import Estimator, Felt, estimator
from twin.twin import Twin

SETTLE = 0.05  # s, in which all but a third is done: noise of one reading moves the tendons by a fifth of it at 100 Hz
EASY = 5e-5  # m/N: pulling 1 N harder has to bring the points nearer by that; they move by 1 mm/N and more where they are pulled
WITHIN = 1e-3  # m, mean distance: less is what a shape is estimated to
CLOSE = 1e-5  # m, of Newton's last step: the next control step goes on with what it leaves, and a tangent serves longer
OVER = 0.01  # N above the most pull, from which on it is paid out again: what CLOSE leaves is up to 6 mN
STILL = 1e-4  # m: tendons asked for less than this have arrived


class Limits(NamedTuple):
    """Pull of every tendon, N, by the twin: nobody measures it; and how fast it is shortened or paid out, m/s."""

    least: float = 0.05
    most: float = 4.0
    rate: float = 0.03


@dataclass(frozen=True)
class Step:
    """Shortenings (t,) m from the hanging rest to hold now. `error`: mean distance (m) of the sensed points from the wanted ones;
    `residual`: what of it no tensions within the limits take away, by the present tangent. `reason`: why the finger stays away
    from what is wanted, once it has arrived; None while it moves and where less than WITHIN is left."""

    shortening: np.ndarray
    error: float
    residual: float
    reason: str | None


class Seen(NamedTuple):
    """Points (P, 3) m in the finger's own frame, and strains (s,) of its cords, NaN where a sensor says nothing."""

    points: np.ndarray
    strain: np.ndarray


class ShapeController:
    """Start it with the finger hanging and its tendons just taut. One instance serves one thread."""

    def __init__(self, twin: Twin, *, eye: Estimator | None = None, limits: Limits = Limits(), pushed: bool = True) -> None:  # noqa: B008
        """`eye`: how the shape is estimated, `modal` by default; `pushed`: something may press on the finger. Raises DataError for
        a robot that is no soft finger with sensors, limits in the wrong order, and effects that change what sensors report."""
        if any(e.acts_in("sense") for e in twin.effects):
            raise DataError("effects of sensors are not undone in a control loop; give a twin aligned anew, without them")
        if not (0.0 <= limits.least < limits.most and limits.rate > 0.0):
            raise DataError(f"limits {tuple(limits)}: 0 <= least < most and rate > 0 are needed")
        self.eye = eye or estimator("modal")(twin)
        self.finger, self.limits, self.pushed = HeldFinger(twin), limits, pushed
        self.cords, self.hanging = self.finger.body.cords, self.finger.response()

    def step(self, wanted: np.ndarray, resistance: np.ndarray, dt: float, *, truth: np.ndarray | None = None) -> Step:
        """Towards points `wanted` (P, 3) m in the base frame, from resistances (s,) ohm read now, for `dt` seconds. `truth` (P, 3)
        m stands for the estimated shape where a simulator tells it. Raises SolveError where the twin finds no equilibrium; the
        shortenings then stay."""
        finger, limits = self.finger, self.limits
        response, T, loose = finger.response(), finger.tension, finger.loose
        apart, slope = self.aim(wanted, self.seen(resistance, truth), response.points, response.strain)
        dT = _pulls(apart, slope, T, limits)
        share = 1.0 - np.exp(-dt / SETTLE)
        change = loose - share * (response.length @ dT)
        full, before = float(np.abs(change).max()), finger.shortening
        finger.hold(before + change * min(1.0, limits.rate * dt / max(full, 1e-12)), CLOSE)
        self._ease(before, limits.rate * dt)
        left = apart - slope @ dT
        error, residual = (float(np.linalg.norm(a, axis=-1).mean()) for a in (apart, left))
        reason = self._reason(T + dT, residual) if full < STILL and residual > WITHIN else None
        return Step(finger.shortening.copy(), error, residual, reason)

    def _ease(self, before: np.ndarray, far: float) -> None:
        """What the tangent missed the most pull by is paid out again, tendons then no further than `far` (m) from `before` (t,)."""
        finger = self.finger
        over = np.maximum(finger.tension - self.limits.most, 0.0)
        if over.max() > OVER:
            way = finger.response().length @ over
            room = far - np.sign(way) * (finger.shortening - before)
            # All by one share: a micrometre of one tendon alone is some tenths of a newton of its antagonist.
            share = min(1.0, float((room / np.maximum(np.abs(way), 1e-12)).min()))
            with suppress(SolveError):  # what was found before stands
                finger.hold(finger.shortening + max(0.0, share) * way, CLOSE)

    def seen(self, resistance: np.ndarray, truth: np.ndarray | None) -> Seen:
        eps = strain(np.asarray(resistance, float), self.cords)
        if truth is not None:
            return Seen(self.finger.own(truth), eps)
        moved = self.eye.displaced(Felt(eps[None], self.finger.shortening[None], self.pushed))
        return Seen(self.finger.rest + moved[0], eps)

    def aim(self, wanted: np.ndarray, seen: Seen, points: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is to be made small, (k, 3) m, and how it answers tensions, (k, 3, t) m/N, from the response of the points (P, 3, t)
        m/N and of the strains (s, t) 1/N."""
        return self.finger.own(wanted) - seen.points, points

    def _reason(self, tension: np.ndarray, residual: float) -> str:
        full = [f"tendon {i + 1}" for i in np.flatnonzero(tension > 0.999 * self.limits.most)]
        left = f"{1e3 * residual:.2f} mm are left (mean distance)"
        if full:
            return f"{' and '.join(full)} would need more than the {self.limits.most:g} N allowed; {left}"
        return f"tendons do not make this shape; {left}"


def _pulls(apart: np.ndarray, slope: np.ndarray, tension: np.ndarray, limits: Limits) -> np.ndarray:
    """dT (t,) N: the bounded least squares above, of as many rows as there are tendons."""
    n, nt = apart.size // apart.shape[-1], len(tension)
    S = slope.reshape(-1, nt)
    R = cholesky(S.T @ S / n + EASY**2 * np.eye(nt))
    b = solve_triangular(R, S.T @ apart.ravel() / n - EASY**2 * tension, trans=1)
    return lsq_linear(R, b, (limits.least - tension, limits.most - tension), method="bvls").x
