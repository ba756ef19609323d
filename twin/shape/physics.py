"""The twin itself: the shape in equilibrium with the tendons' known lengths and the smooth push that best explains the strains.

    max over a   -|a|^2 - |(eps(u(a)) - eps_felt) / sigma|^2,       push on the nodes f = B a,  a ~ N(0, 1)

B is the root of the covariance of the factory's hands, so that a is a Gaussian process of smooth loads on the skin; u(a) is the
equilibrium with tendons that hold or are slack. Gauss-Newton steps, each sample from the one before. Where nothing is said to push
u is what the tendons make of it, unless the strains say otherwise: such a frame is marked, and solved for its push.

How wide the error bar is: hands press gently or hard, so that for it a ~ N(0, s^2), and which strength s the strains speak for that
tendons alone leave, delta = eps_felt - eps + J a, is weighed by Bayes. With J / sigma = U diag(d) V' and y = U' delta / sigma,

    p(s | y) ~ p(s) prod_k N(y_k; 0, 1 + s^2 d_k^2),      C = sum_s p(s | y) s^2 G (1 - V' diag(s^2 d^2 / (1 + s^2 d^2)) V) G'

G = dx/da, J = deps/da; the error bar is BAND of the root of C, and the twin's own error. Where the strains show nobody pressing it
is narrow, the harder they show a push the wider. p(s) is the factory's: even up to STRENGTH, falling as s^-FALL beyond.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from twin.factory.draw import PUSHES, draw_pushes
from twin.factory.solve import Surface, hang, march, surface, weight_of
from twin.shape.estimator import Estimator, Felt, Shapes, own_error
from twin.shape.free import far, wrong_by
from twin.soft import Cone, SoftStatics
from twin.soft.solid import Solid
from twin.threads import single_thread
from twin.twin import Twin

HANDS, RANK = 4000, 60  # hands drawn for the prior, components kept: the others push with less than 1 % of it
ROUNDS = 4
SETTLED = 0.02  # of a step in a
LONGEST = 4.0  # of a step in a
OUTSIDE = 4.0  # standard deviations of the residual strain, or of a push, that the twin does not explain
STRENGTH, FALL = 1.3, 10.0  # of the factory's hands: the likeliest for 140 of its training fingers
S = np.geomspace(0.02, 8.0, 40)
PRIOR = np.where(S < STRENGTH, S, S * (STRENGTH / S) ** FALL)  # on this grid, whose cells are as wide as s
BAND = 0.92  # so that 1.645 std holds 90 % of the points of held-out factory fingers: python -m tools.shape_band


Sample = tuple[np.ndarray, np.ndarray, bool, bool]  # displacements (P, 3) m, std (P,) m, whether outside, whether pressed


class Physics(Estimator):
    """Remembers, within one call, the sample before as a place to start from; nothing between calls."""

    about = "the twin's equilibrium under the likeliest push"

    def __init__(self, twin: Twin) -> None:
        super().__init__(twin)
        self.statics = SoftStatics(self.body)
        self.skin = surface(self.body.cone, self.body.cells)
        self.prior = _prior(self.body.cone, self.body.cells)
        self.weights = self.body.lattice.weights(self.points.rest)
        self.weight = weight_of(self.body, twin.robot.gravity)

    def estimate(self, felt: Felt) -> Shapes:
        n, p = len(felt), len(self.points.rest)
        moved, std, (outside, pressed) = np.empty((n, p, 3)), np.empty((n, p)), np.zeros((2, n), bool)
        with single_thread():
            walk = _Walk(self)
            for i in range(n):
                step = walk.pushed if felt.pushed else walk.free
                moved[i], std[i], outside[i], pressed[i] = step(felt.displacement[i], felt.strain[i])
        return Shapes(moved, std, outside, pressed)


@lru_cache(maxsize=4)
def _prior(cone: Cone, cells: int) -> np.ndarray:
    """B (3 n_free, RANK) N."""
    rng = np.random.default_rng(0)
    skin: Surface = surface(cone, cells)
    forces = np.stack([skin.force(draw_pushes(rng, cone, PUSHES)).ravel() for _ in range(HANDS)])
    values, vectors = np.linalg.eigh(forces.T @ forces / HANDS)
    return vectors[:, -RANK:] * np.sqrt(np.maximum(values[-RANK:], 0.0))


def _left_open(G: np.ndarray, J: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Variance (P,) m^2 of the points: G (P, 3, RANK) are their slopes by a, J (m, RANK) those of the strains and y (m,) the
    strains that tendons alone leave, these in standard deviations."""
    U, d, V = np.linalg.svd(J, full_matrices=False)
    told = (S[:, None] * d) ** 2
    fits = -0.5 * (np.log1p(told) + (U.T @ y) ** 2 / (1.0 + told)).sum(axis=1)
    p = PRIOR * np.exp(fits - fits.max())
    p /= p.sum()
    known = (p * S**2) @ (told / (1.0 + told))
    return (p @ S**2) * (G**2).sum(axis=(1, 2)) - ((G @ V.T) ** 2).sum(axis=1) @ known


class _Walk:
    """One way through a trial's samples."""

    def __init__(self, owner: Physics) -> None:
        self.owner, self.solid = owner, Solid(owner.statics.parts)
        self.shape = self.solid.rest()
        self.hanging = hang(self.solid, self.shape, owner.weight)
        self.at, self.burden, self.a = np.zeros(len(self.hanging)), owner.weight, np.zeros(RANK)

    def free(self, displacement: np.ndarray, strain: np.ndarray) -> Sample:
        """The next sample, if nothing pushes; strains that tendons alone do not make say that something does."""
        found = self._march(displacement, np.zeros(RANK))
        if np.isfinite(strain).any() and far(self._strain()[0][None], strain[None])[0] > OUTSIDE:
            moved, std, *_ = self.pushed(displacement, strain)
            return moved, std, True, True
        moved = self.owner.weights @ self.shape.u
        return moved, own_error(moved), not found, False

    def pushed(self, displacement: np.ndarray, strain: np.ndarray) -> Sample:
        """The same, if something may push."""
        there = np.isfinite(strain)
        if not there.any():
            return self.free(displacement, strain)
        felt, wrong, step = strain[there], np.zeros(there.sum()), np.zeros(RANK)
        noise, response, found = wrong_by(felt), np.zeros((self.shape.u.size, RANK)), True
        J = np.zeros((len(felt), RANK))
        for _ in range(ROUNDS):
            if not self._march(displacement, self.a):
                found, step, response = False, np.zeros(RANK), self._again(displacement)
                J, wrong = np.zeros_like(J), np.zeros_like(wrong)
                break
            response = self._response()
            eps, slope = self._strain()
            J, wrong = (slope @ response)[there], felt - eps[there]
            gain = np.linalg.solve(J @ J.T + np.diag(noise**2), J).T
            step = gain @ (wrong + J @ self.a) - self.a
            step *= min(1.0, LONGEST / np.linalg.norm(step))
            self.a = self.a + step
            if np.abs(step).max() < SETTLED:
                break
        moved = self.owner.weights @ (self.shape.u + (response @ step).reshape(-1, 3))
        G = np.einsum("pn,nck->pck", self.owner.weights, response.reshape(-1, 3, RANK))
        by_push = wrong + J @ (self.a - step)  # J and what is wrong are those before the step
        variance = BAND**2 * _left_open(G, J / noise[:, None], by_push / noise) + own_error(moved) ** 2
        outside = not found or np.linalg.norm(self.a) > OUTSIDE or np.abs(wrong / noise).max() > OUTSIDE
        return moved, np.sqrt(variance), bool(outside), bool(np.abs(by_push / noise).max() > OUTSIDE)

    def _again(self, displacement: np.ndarray) -> np.ndarray:
        """Back to rest and to the tendons alone, where a push led nowhere; the response there."""
        self.shape, self.a = self.solid.rest(), np.zeros(RANK)
        hang(self.solid, self.shape, self.owner.weight)
        self.at, self.burden = np.zeros(len(self.hanging)), self.owner.weight
        self._march(displacement, self.a)
        return self._response() if self.shape.inverse is not None else np.zeros((self.shape.u.size, RANK))

    def _march(self, displacement: np.ndarray, a: np.ndarray) -> bool:
        goal = displacement, self.owner.weight + (self.owner.prior @ a).reshape(-1, 3)
        self.shape, found = march(self.solid, self.shape, self.hanging, (self.at, self.burden), goal)
        if found:
            self.at, self.burden = goal
        return found

    def _response(self) -> np.ndarray:
        """du/da (3 n_free, RANK) with taut tendons' lengths kept."""
        solid, shape = self.solid, self.shape
        assert shape.inverse is not None
        taut = shape.tension > 0.0
        g = solid.pulled.gradient[taut]
        solved = shape.inverse @ np.column_stack([self.owner.prior, g.T])
        F, Z = solved[:, :RANK], solved[:, RANK:]
        return F - Z @ np.linalg.solve(g @ Z, g @ F) if taut.any() else F

    def _strain(self) -> tuple[np.ndarray, np.ndarray]:
        """Strains (s,) and their slope by the nodes (s, 3 n_free)."""
        return self.owner.statics.strain_slope(self.shape.u)
