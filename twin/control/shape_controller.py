"""Control a soft finger to a wanted shape: tendon shortenings from the distances of all its named points, step by step.

At every step the shape is estimated from the strain sensors, and tensions are found that bring it nearer,

    min over dT   mean |x* - x - dx/dT dT|^2 + p^2 |T + dT|^2,      least <= T + dT <= most,      p TENSION_PENALTY,

dx/dT each tendon's own shape change, by the twin's tangent at the present tendon lengths. All tendons pull by `least` or more, so
that antagonists hold the finger between them; among equal bends the one with the least pull is taken. Tendons are shortened by the
fraction 1 - exp(-dt/tau), tau SHORTENING_TIME_CONSTANT, of what would give these tensions, no faster than `rate`. Only the change
of shape comes from the model: feedback corrects its errors from step to step, as an integral would. The distances that dT leaves
are those that tendons cannot reach.

Tensions are the twin's own, not measured. With all tendons taut their lengths are nearly redundant: tightening one pair and
releasing the other takes 5 um/N, so that on a finger that differs from the twin a pair may be slack, or pull tenths of a newton
more than planned.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078) projects vertex errors onto constant directions (a baseline in
tools.benchmarks.control.baselines); the tangent, the limits and the residual are ours. Bounded least squares: Stark and Parker
1995, as in scipy.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from twin.body.strain_cords import strain
from twin.control.held_finger import HeldFinger
from twin.foundation.errors import DataError, SolveError
from twin.prediction.twin import Twin
from twin.shape.estimators.estimator import Estimator, SensorReadings, estimator_class

SHORTENING_TIME_CONSTANT = 0.05  # s: noise of one reading moves the tendons by a fifth of it at 100 Hz
TENSION_PENALTY = 5e-5  # m/N, of the distance that 1 N more must gain; tendons move the points by 1 mm/N and more
REACHED_DISTANCE = 1e-3  # m, mean distance: the accuracy of the estimated shape
CONTROL_TOLERANCE = 1e-5  # m, of Newton's last step: the next control step continues from there, and a tangent serves longer
EXCESS_TENSION = 0.01  # N above the most pull, from which on it is released: CONTROL_TOLERANCE leaves up to 6 mN
ARRIVED_CHANGE = 1e-4  # m: tendons with smaller changes have arrived


class TensionLimits(NamedTuple):
    """Limits of every tendon: its pull by the twin, N, and its speed, m/s."""

    least: float = 0.05
    most: float = 4.0
    rate: float = 0.03


DEFAULT_LIMITS = TensionLimits()


@dataclass(frozen=True)
class ControlStep:
    """One step of control.

    `shortening` (t,) m from the hanging rest to hold now. `error`: mean distance (m) of the sensed points from the wanted ones;
    `residual`: the part of it that no tensions within the limits remove, by the present tangent. `reason`: why the finger stays
    away from the wanted shape, once it has arrived; None while it moves and where less than REACHED_DISTANCE is left.
    """

    shortening: np.ndarray
    error: float
    residual: float
    reason: str | None


class SensedShape(NamedTuple):
    """Points (P, 3) m in the finger's own frame, and strains (s,) of its cords, NaN where a sensor is dead."""

    points: np.ndarray
    strain: np.ndarray


class ShapeController:
    """Controller of one finger, which starts hanging with its tendons just taut. One instance serves one thread."""

    def __init__(
        self, twin: Twin, *, estimator: Estimator | None = None, limits: TensionLimits = DEFAULT_LIMITS, pushed: bool = True
    ) -> None:
        """`estimator` of the shape, `modal` by default; `pushed`: something may press on the finger.

        Raises DataError for a robot that is no soft finger with sensors, limits in the wrong order, and effects on the sensors.
        """
        if any(e.acts_in("sense") for e in twin.effects):
            raise DataError("sensor effects are not corrected in a control loop; give a newly aligned twin without them")
        if not (0.0 <= limits.least < limits.most and limits.rate > 0.0):
            raise DataError(f"limits {tuple(limits)}: 0 <= least < most and rate > 0 are needed")
        self.estimator = estimator or estimator_class("modal")(twin)
        self.finger, self.limits, self.pushed = HeldFinger(twin), limits, pushed
        self.cords, self.hanging_response = self.finger.body.cords, self.finger.tendon_response()

    def step(self, wanted: np.ndarray, resistance: np.ndarray, dt: float, *, truth: np.ndarray | None = None) -> ControlStep:
        """Step towards points `wanted` (P, 3) m in the base frame, from resistances (s,) ohm read now, for `dt` seconds.

        `truth` (P, 3) m replaces the estimated shape where a simulator has it. Raises SolveError where the twin finds no
        equilibrium; the shortenings then stay.
        """
        finger, limits = self.finger, self.limits
        response, T, slack = finger.tendon_response(), finger.tension, finger.slack
        offset, slope = self.control_error(wanted, self.sense_shape(resistance, truth), response.points, response.strain)
        dT = _solve_tensions(offset, slope, T, limits)
        share = 1.0 - np.exp(-dt / SHORTENING_TIME_CONSTANT)
        change = slack - share * (response.length @ dT)
        largest_change, before = float(np.abs(change).max()), finger.shortening
        finger.hold_at(before + change * min(1.0, limits.rate * dt / max(largest_change, 1e-12)), CONTROL_TOLERANCE)
        self._release_excess(before, limits.rate * dt)
        left = offset - slope @ dT
        error, residual = (float(np.linalg.norm(a, axis=-1).mean()) for a in (offset, left))
        reason = self._reason(T + dT, residual) if largest_change < ARRIVED_CHANGE and residual > REACHED_DISTANCE else None
        return ControlStep(finger.shortening.copy(), error, residual, reason)

    def _release_excess(self, before: np.ndarray, far: float) -> None:
        """Release tension above the limit that the tangent missed, tendons within `far` (m) of their lengths `before` (t,)."""
        finger = self.finger
        excess = np.maximum(finger.tension - self.limits.most, 0.0)
        if excess.max() > EXCESS_TENSION:
            release = finger.tendon_response().length @ excess
            room = far - np.sign(release) * (finger.shortening - before)
            # One fraction for all: a micrometre of one tendon alone is some tenths of a newton of its antagonist.
            share = min(1.0, float((room / np.maximum(np.abs(release), 1e-12)).min()))
            with suppress(SolveError):  # keeps the equilibrium before
                finger.hold_at(finger.shortening + max(0.0, share) * release, CONTROL_TOLERANCE)

    def sense_shape(self, resistance: np.ndarray, truth: np.ndarray | None) -> SensedShape:
        """Return the shape by the estimator, or by `truth`, and the strains."""
        eps = strain(np.asarray(resistance, float), self.cords)
        if truth is not None:
            return SensedShape(self.finger.to_finger_frame(truth), eps)
        displacements = self.estimator.estimate_displacements(SensorReadings(eps[None], self.finger.shortening[None], self.pushed))
        return SensedShape(self.finger.rest + displacements[0], eps)

    def control_error(
        self, wanted: np.ndarray, sensed: SensedShape, points: np.ndarray, strains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the error to reduce, (k, 3) m, and its response to tensions, (k, 3, t) m/N.

        They follow from the response of the points (P, 3, t) m/N and of the strains (s, t) 1/N.
        """
        return self.finger.to_finger_frame(wanted) - sensed.points, points

    def _reason(self, tension: np.ndarray, residual: float) -> str:
        """Return why the remaining distance cannot be removed."""
        full = [f"tendon {i + 1}" for i in np.flatnonzero(tension > 0.999 * self.limits.most)]
        left = f"{1e3 * residual:.2f} mm are left (mean distance)"
        if full:
            return f"{' and '.join(full)} would need more than the {self.limits.most:g} N allowed; {left}"
        return f"tendons do not make this shape; {left}"


def _solve_tensions(error: np.ndarray, slope: np.ndarray, tension: np.ndarray, limits: TensionLimits) -> np.ndarray:
    """Return dT (t,) N of the bounded least squares above, reduced to as many rows as there are tendons."""
    n, nt = error.size // error.shape[-1], len(tension)
    S = slope.reshape(-1, nt)
    R = cholesky(S.T @ S / n + TENSION_PENALTY**2 * np.eye(nt))
    b = solve_triangular(R, S.T @ error.ravel() / n - TENSION_PENALTY**2 * tension, trans=1)
    return lsq_linear(R, b, (limits.least - tension, limits.most - tension), method="bvls").x
