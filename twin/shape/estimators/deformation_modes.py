"""Deformation modes: the principal components of the training shapes, in which a finger's shape is a few numbers.

    nodes = mean + z @ basis,          z (k,) in m: sum z_i^2 is P times the mean squared displacement of the P named points

The components are those of the named points, so that errors in z are errors of vertices; the nodes that go with them follow by
least squares and give every other point of the body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MODE_COUNT = 24  # the modes left out hold less than 0.02 mm


@dataclass(frozen=True)
class DeformationModes:
    """The modes: `mean` (m,) and `basis` (k, m) of the nodes' displacements, m = 3 n_free; `spread` (k,) m, the std of each z."""

    mean: np.ndarray
    basis: np.ndarray
    spread: np.ndarray

    @staticmethod
    def of(nodes: np.ndarray, weights: np.ndarray, count: int = MODE_COUNT) -> DeformationModes:
        """Compute the modes of shapes (n, m) with the weights (P, m / 3) of the named points."""
        mean = nodes.mean(axis=0)
        away = nodes - mean
        gram = np.kron(weights.T @ weights, np.eye(3))  # of the vertices, in nodes
        covariance = away.T @ away / len(nodes)
        root = np.linalg.cholesky(gram + 1e-9 * np.trace(gram) / len(gram) * np.eye(len(gram)))
        values, vectors = np.linalg.eigh(root.T @ covariance @ root)
        best = np.argsort(values)[::-1][:count]
        basis = np.linalg.solve(root.T, vectors[:, best]).T
        return DeformationModes(mean, basis, np.sqrt(values[best]))

    def coordinates(self, nodes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the coordinates (n, k) m of shapes (n, m)."""
        gram = np.kron(weights.T @ weights, np.eye(3))
        return (nodes - self.mean) @ gram @ self.basis.T

    def nodes(self, z: np.ndarray) -> np.ndarray:
        """Return the nodal displacements (n, n_free, 3) m of coordinates (n, k)."""
        return (self.mean + z @ self.basis).reshape(len(z), -1, 3)


@dataclass(frozen=True)
class ModeCoupling:
    """Coupling of the modes in a family of shapes: z = cubic(z_1, z_2) + e, e normal.

    `coefficient` (10, k) m of the powers of z_1, z_2 in their spreads, zero for z_1 and z_2 themselves; `inverse` (k, k) 1/m^2, the
    inverse covariance of e.
    """

    coefficient: np.ndarray
    inverse: np.ndarray
    spread: np.ndarray

    @staticmethod
    def fit(z: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients and the inverse covariance for shapes z (n, k)."""
        features = _cubic_powers(*(z[:, :2] / spread[:2]).T)[0]
        coefficient = np.linalg.lstsq(features, z, rcond=None)[0]
        coefficient[:, :2] = 0.0
        away = z - features @ coefficient
        return coefficient, np.linalg.inv(away.T @ away / len(z))

    def __call__(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return e (k,) m of z (k,), and de/dz (k, k)."""
        value, slope = _cubic_powers(*(z[:2] / self.spread[:2]))
        D = np.eye(len(z))
        D[:, :2] -= (slope @ self.coefficient).T / self.spread[:2]
        return z - value @ self.coefficient, D


def _cubic_powers(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 1, a, b, .. b^3 (..., 10), and their derivatives by a and b (2, ..., 10)."""
    one, none = np.ones_like(a), np.zeros_like(a)
    value = [one, a, b, a * a, a * b, b * b, a**3, a * a * b, a * b * b, b**3]
    by_a = [none, one, none, 2 * a, b, none, 3 * a * a, 2 * a * b, b * b, none]
    by_b = [none, none, one, none, a, 2 * b, none, a * a, 2 * a * b, 3 * b * b]
    return np.stack(value, axis=-1), np.stack([np.stack(by_a, axis=-1), np.stack(by_b, axis=-1)])
