"""The twin itself: the equilibrium under the tendons' known lengths and the smooth push that best explains the strains.

    max over a   -|a|^2 - |(eps(u(a)) - eps_measured) / sigma|^2,       push on the nodes f = B a,  a ~ N(0, 1)

B is the root of the covariance of the training pushes, so that a is a Gaussian process of smooth loads on the skin; u(a) is the
equilibrium with tendons that hold or are slack. Gauss-Newton steps, each sample from the one before. Where no contact is declared,
u is the shape under the tendons alone, unless the strains contradict it: such a frame is marked, and solved for its push.

Width of the error bar: pushes are gentle or hard, so here a ~ N(0, s^2), and the strength s is inferred by Bayes from the strains
that tendons alone do not explain, delta = eps_measured - eps + J a. With J / sigma = U diag(d) V' and y = U' delta / sigma,

    p(s | y) ~ p(s) prod_k N(y_k; 0, 1 + s^2 d_k^2),      C = sum_s p(s | y) s^2 G (1 - V' diag(s^2 d^2 / (1 + s^2 d^2)) V) G'

G = dx/da, J = deps/da; the error bar is BAND_FACTOR times the root of C, and the twin's own error. It is narrow where the strains
show no push, and widens with the push. p(s) is that of the training pushes: flat up to TYPICAL_STRENGTH, falling as
s^-STRENGTH_DECAY beyond.
"""

from functools import lru_cache

import numpy as np

from twin.foundation.parallel import single_thread
from twin.mechanics.silicone import Cone, SoftStatics
from twin.mechanics.silicone.single_equilibrium import SoftEquilibrium, hang_at_rest, move_equilibrium, nodal_weight
from twin.mechanics.silicone.skin_loads import PushSurface, push_surface
from twin.prediction.twin import Twin
from twin.shape.estimators.estimator import Estimator, SensorReadings, ShapeEstimates, twin_error
from twin.shape.estimators.tendon_strains import largest_deviation, strain_error_std
from twin.shape.training_data.draw import MOST_PUSHES, draw_pushes

PRIOR_SAMPLES, PRIOR_RANK = 4000, 60  # pushes drawn for the prior, components kept: the others hold less than 1 % of it
GAUSS_NEWTON_STEPS = 4
PUSH_STEP_TOLERANCE = 0.02  # of a step in a
LONGEST_PUSH_STEP = 4.0  # of a step in a
UNEXPLAINED_DEVIATION = 4.0  # standard deviations of the residual strain, or of a push, that the twin does not explain
TYPICAL_STRENGTH, STRENGTH_DECAY = 1.3, 10.0  # of the training pushes: the likeliest for 140 of the training fingers
STRENGTHS = np.geomspace(0.02, 8.0, 40)
# on this grid, whose cells are as wide as s
STRENGTH_PRIOR = np.where(STRENGTHS < TYPICAL_STRENGTH, STRENGTHS, STRENGTHS * (TYPICAL_STRENGTH / STRENGTHS) ** STRENGTH_DECAY)
BAND_FACTOR = 0.92  # 1.645 std holds 90 % of the points of held-out fingers: python -m tools.benchmarks.shape.band


SampleEstimate = tuple[np.ndarray, np.ndarray, bool, bool]  # displacements (P, 3) m, std (P,) m, whether outside, whether pressed


class PhysicsEstimator(Estimator):
    """The twin's equilibrium under the likeliest push. Within one call each sample starts from the one before."""

    description = "the twin's equilibrium under the likeliest push"

    def __init__(self, twin: Twin) -> None:
        super().__init__(twin)
        self.statics = SoftStatics(self.body)
        self.skin = push_surface(self.body.cone, self.body.cells)
        self.prior = _push_prior(self.body.cone, self.body.cells)
        self.weights = self.body.lattice.weights(self.points.rest)
        self.weight = nodal_weight(self.body, twin.robot.gravity)

    def estimate(self, readings: SensorReadings) -> ShapeEstimates:
        """Estimate the shapes in the order of the rows."""
        n, p = len(readings), len(self.points.rest)
        displacements, std, (outside, pressed) = np.empty((n, p, 3)), np.empty((n, p)), np.zeros((2, n), bool)
        with single_thread():
            tracker = _EquilibriumTracker(self)
            for i in range(n):
                estimate_sample = tracker.estimate_pushed if readings.pushed else tracker.estimate_free
                displacements[i], std[i], outside[i], pressed[i] = estimate_sample(readings.displacement[i], readings.strain[i])
        return ShapeEstimates(displacements, std, outside, pressed)


@lru_cache(maxsize=4)
def _push_prior(cone: Cone, cells: int) -> np.ndarray:
    """Return B (3 n_free, PRIOR_RANK) N."""
    rng = np.random.default_rng(0)
    skin: PushSurface = push_surface(cone, cells)
    forces = np.stack([skin.nodal_force(draw_pushes(rng, cone, MOST_PUSHES)).ravel() for _ in range(PRIOR_SAMPLES)])
    values, vectors = np.linalg.eigh(forces.T @ forces / PRIOR_SAMPLES)
    return vectors[:, -PRIOR_RANK:] * np.sqrt(np.maximum(values[-PRIOR_RANK:], 0.0))


def _posterior_variance(G: np.ndarray, J: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the variance (P,) m^2 of the points.

    G (P, 3, PRIOR_RANK) are the slopes of the points by a, J (m, PRIOR_RANK) those of the strains, and y (m,) the strains that
    tendons alone do not explain, J and y in standard deviations.
    """
    U, d, V = np.linalg.svd(J, full_matrices=False)
    information = (STRENGTHS[:, None] * d) ** 2
    log_likelihood = -0.5 * (np.log1p(information) + (U.T @ y) ** 2 / (1.0 + information)).sum(axis=1)
    p = STRENGTH_PRIOR * np.exp(log_likelihood - log_likelihood.max())
    p /= p.sum()
    known = (p * STRENGTHS**2) @ (information / (1.0 + information))
    return (p @ STRENGTHS**2) * (G**2).sum(axis=(1, 2)) - ((G @ V.T) ** 2).sum(axis=1) @ known


class _EquilibriumTracker:
    """Follow the samples of one call, keeping the equilibrium from sample to sample."""

    def __init__(self, estimator: PhysicsEstimator) -> None:
        self.estimator, self.solid = estimator, SoftEquilibrium(estimator.statics.arrays)
        self.shape = self.solid.undeformed()
        self.hanging = hang_at_rest(self.solid, self.shape, estimator.weight)
        self.displacement, self.burden, self.a = np.zeros(len(self.hanging)), estimator.weight, np.zeros(PRIOR_RANK)

    def estimate_free(self, displacement: np.ndarray, strain: np.ndarray) -> SampleEstimate:
        """Estimate the next sample without contact; strains that tendons alone do not make switch to `estimate_pushed`."""
        found = self._move_to(displacement, np.zeros(PRIOR_RANK))
        if (
            np.isfinite(strain).any()
            and largest_deviation(self._strain_and_slope()[0][None], strain[None])[0] > UNEXPLAINED_DEVIATION
        ):
            displacements, std, *_ = self.estimate_pushed(displacement, strain)
            return displacements, std, True, True
        displacements = self.estimator.weights @ self.shape.u
        return displacements, twin_error(displacements), not found, False

    def estimate_pushed(self, displacement: np.ndarray, strain: np.ndarray) -> SampleEstimate:
        """Estimate the next sample with contact."""
        finite = np.isfinite(strain)
        if not finite.any():
            return self.estimate_free(displacement, strain)
        measured, residual, step = strain[finite], np.zeros(finite.sum()), np.zeros(PRIOR_RANK)
        noise, response, found = strain_error_std(measured), np.zeros((self.shape.u.size, PRIOR_RANK)), True
        J = np.zeros((len(measured), PRIOR_RANK))
        for _ in range(GAUSS_NEWTON_STEPS):
            if not self._move_to(displacement, self.a):
                found, step, response = False, np.zeros(PRIOR_RANK), self._restart(displacement)
                J, residual = np.zeros_like(J), np.zeros_like(residual)
                break
            response = self._push_response()
            eps, slope = self._strain_and_slope()
            J, residual = (slope @ response)[finite], measured - eps[finite]
            gain = np.linalg.solve(J @ J.T + np.diag(noise**2), J).T
            step = gain @ (residual + J @ self.a) - self.a
            step *= min(1.0, LONGEST_PUSH_STEP / np.linalg.norm(step))
            self.a = self.a + step
            if np.abs(step).max() < PUSH_STEP_TOLERANCE:
                break
        displacements = self.estimator.weights @ (self.shape.u + (response @ step).reshape(-1, 3))
        G = np.einsum("pn,nck->pck", self.estimator.weights, response.reshape(-1, 3, PRIOR_RANK))
        unexplained = residual + J @ (self.a - step)  # J and the residual are those before the step
        variance = BAND_FACTOR**2 * _posterior_variance(G, J / noise[:, None], unexplained / noise) + twin_error(displacements) ** 2
        outside = (
            not found or np.linalg.norm(self.a) > UNEXPLAINED_DEVIATION or np.abs(residual / noise).max() > UNEXPLAINED_DEVIATION
        )
        return displacements, np.sqrt(variance), bool(outside), bool(np.abs(unexplained / noise).max() > UNEXPLAINED_DEVIATION)

    def _restart(self, displacement: np.ndarray) -> np.ndarray:
        """Return to rest and to the tendons alone after a push without equilibrium; the response there."""
        self.shape, self.a = self.solid.undeformed(), np.zeros(PRIOR_RANK)
        hang_at_rest(self.solid, self.shape, self.estimator.weight)
        self.displacement, self.burden = np.zeros(len(self.hanging)), self.estimator.weight
        self._move_to(displacement, self.a)
        return self._push_response() if self.shape.inverse is not None else np.zeros((self.shape.u.size, PRIOR_RANK))

    def _move_to(self, displacement: np.ndarray, a: np.ndarray) -> bool:
        """Move to these tendon displacements and this push; whether the equilibrium was found."""
        goal = displacement, self.estimator.weight + (self.estimator.prior @ a).reshape(-1, 3)
        self.shape, found = move_equilibrium(self.solid, self.shape, self.hanging, (self.displacement, self.burden), goal)
        if found:
            self.displacement, self.burden = goal
        return found

    def _push_response(self) -> np.ndarray:
        """Return du/da (3 n_free, PRIOR_RANK) with taut tendons' lengths fixed."""
        solid, shape = self.solid, self.shape
        assert shape.inverse is not None
        taut = shape.tension > 0.0
        g = solid.tendons.gradient[taut]
        solved = shape.inverse @ np.column_stack([self.estimator.prior, g.T])
        F, Z = solved[:, :PRIOR_RANK], solved[:, PRIOR_RANK:]
        return F - Z @ np.linalg.solve(g @ Z, g @ F) if taut.any() else F

    def _strain_and_slope(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the strains (s,) and their slopes by the nodes (s, 3 n_free)."""
        return self.estimator.statics.strain_slope(self.shape.u)
