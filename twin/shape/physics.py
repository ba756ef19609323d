"""The twin itself: the shape in equilibrium with the tendons' known lengths and the smooth push that best explains the strains.

    max over a   -|a|^2 - |(eps(u(a)) - eps_felt) / sigma|^2,       push on the nodes f = B a,  a ~ N(0, 1)

B is the root of the covariance of the factory's hands, so that a is a Gaussian process of smooth loads on the skin; u(a) is the
equilibrium with tendons that hold or are slack. Gauss-Newton steps, each sample from the one before. Without a push u is what the
tendons make of it.

Hands press gently or hard, so that (a, strain error) are normal given a strength of which little is known: together a t
distribution of FREEDOM degrees. What m strains leave open is then wider the harder the likeliest push,

    C = (FREEDOM + q) / (FREEDOM + m)  G (1 - J' (J J' + sigma^2)^-1 J) G',      G = dx/da,  J = deps/da,

q = |a|^2 + |(eps - eps_felt) / sigma|^2 (Kotz and Nadarajah 2004, sec. 1.11), and the error bar is BAND of its root and the twin's
own error.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from twin.factory.draw import PUSHES, draw_pushes
from twin.factory.solve import Surface, hang, march, surface, weight_of
from twin.shape.estimator import Estimator, Felt, Shapes, own_error
from twin.soft import Cone, SoftStatics
from twin.soft.solid import Solid
from twin.soft.statics import single_thread
from twin.twin import Twin

HANDS, RANK = 4000, 60  # hands drawn for the prior, components kept: the others push with less than 1 % of it
STRAIN, GAIN = 5e-4, 0.01  # what a felt strain is wrong by, the twin's own error with it: so much, and this share of it
ROUNDS = 4
SETTLED = 0.02  # of a step in a
LONGEST = 4.0  # of a step in a
OUTSIDE = 4.0  # standard deviations of the residual strain, or of a push, that the twin does not explain
FREEDOM = 1.0  # as widely as the factory's hands differ in strength: with it gentle and hard pushes are covered alike
BAND = 0.96  # so that 1.645 std holds 90 % of the points of held-out factory fingers: python -m tools.shape_band


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
        moved, std, outside = np.empty((n, p, 3)), np.empty((n, p)), np.zeros(n, bool)
        with single_thread():
            walk = _Walk(self)
            for i in range(n):
                moved[i], std[i], outside[i] = walk.to(felt.displacement[i], felt.strain[i] if felt.pushed else None)
        return Shapes(moved, std, outside)


@lru_cache(maxsize=4)
def _prior(cone: Cone, cells: int) -> np.ndarray:
    """B (3 n_free, RANK) N."""
    rng = np.random.default_rng(0)
    skin: Surface = surface(cone, cells)
    forces = np.stack([skin.force(draw_pushes(rng, cone, PUSHES)).ravel() for _ in range(HANDS)])
    values, vectors = np.linalg.eigh(forces.T @ forces / HANDS)
    return vectors[:, -RANK:] * np.sqrt(np.maximum(values[-RANK:], 0.0))


class _Walk:
    """One way through a trial's samples."""

    def __init__(self, owner: Physics) -> None:
        self.owner, self.solid = owner, Solid(owner.statics.parts)
        self.shape = self.solid.rest()
        self.hanging = hang(self.solid, self.shape, owner.weight)
        self.at, self.burden, self.a = np.zeros(len(self.hanging)), owner.weight, np.zeros(RANK)

    def to(self, displacement: np.ndarray, strain: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Displacements (P, 3), std (P,) and whether this is outside, of the next sample; strain None where nothing pushes."""
        there = np.isfinite(strain) if strain is not None else np.zeros(0, bool)
        if strain is None or not there.any():
            found = self._march(displacement, np.zeros(RANK))
            moved = self.owner.weights @ self.shape.u
            return moved, own_error(moved), not found
        felt, covariance, wrong, step = strain[there], np.eye(RANK), np.zeros(1), np.zeros(RANK)
        noise, response, found = np.hypot(STRAIN, GAIN * felt), np.zeros((self.shape.u.size, RANK)), True
        for _ in range(ROUNDS):
            if not self._march(displacement, self.a):
                found, step, covariance, response = False, np.zeros(RANK), np.eye(RANK), self._again(displacement)
                break
            response = self._response()
            eps, slope = self._strain()
            J, wrong = (slope @ response)[there], felt - eps[there]
            gain = np.linalg.solve(J @ J.T + np.diag(noise**2), J).T
            step = gain @ (wrong + J @ self.a) - self.a
            step *= min(1.0, LONGEST / np.linalg.norm(step))
            covariance = np.eye(RANK) - gain @ J
            self.a = self.a + step
            if np.abs(step).max() < SETTLED:
                break
        moved = self.owner.weights @ (self.shape.u + (response @ step).reshape(-1, 3))
        G = np.einsum("pn,nck->pck", self.owner.weights, response.reshape(-1, 3, RANK))
        strength = (FREEDOM + self.a @ self.a + ((wrong / noise) ** 2).sum()) / (FREEDOM + len(felt)) if found else 1.0
        variance = np.einsum("pck,kl,pcl->p", G, covariance, G, optimize=True) * strength * BAND**2 + own_error(moved) ** 2
        far = not found or np.abs(self.a).max() > OUTSIDE or np.abs(wrong / noise).max() > OUTSIDE
        return moved, np.sqrt(variance), bool(far)

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
