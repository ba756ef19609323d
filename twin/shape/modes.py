"""Deformation modes: the principal components of the factory's shapes, in which a finger's shape is a handful of numbers.

    nodes = mean + z @ basis,          z (k,) in m: sum z_i^2 is P times the mean squared displacement of the P named points

The components are those of the named points, so that errors in z are errors of vertices; the nodes that go with them follow by least
squares and give every other point of the body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

COUNT = 24  # modes: what the others hold is below 0.02 mm


@dataclass(frozen=True)
class Modes:
    """mean (m,), basis (k, m) of the nodes' displacements, m = 3 n_free; spread (k,) m, the standard deviation of each z."""

    mean: np.ndarray
    basis: np.ndarray
    spread: np.ndarray

    @staticmethod
    def of(nodes: np.ndarray, weights: np.ndarray, count: int = COUNT) -> Modes:
        """From shapes (n, m) and the weights (P, m / 3) of the named points."""
        mean = nodes.mean(axis=0)
        away = nodes - mean
        gram = np.kron(weights.T @ weights, np.eye(3))  # of the vertices, in nodes
        covariance = away.T @ away / len(nodes)
        root = np.linalg.cholesky(gram + 1e-9 * np.trace(gram) / len(gram) * np.eye(len(gram)))
        values, vectors = np.linalg.eigh(root.T @ covariance @ root)
        best = np.argsort(values)[::-1][:count]
        basis = np.linalg.solve(root.T, vectors[:, best]).T
        return Modes(mean, basis, np.sqrt(values[best]))

    def coordinates(self, nodes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(n, k) m of shapes (n, m)."""
        gram = np.kron(weights.T @ weights, np.eye(3))
        return (nodes - self.mean) @ gram @ self.basis.T

    def nodes(self, z: np.ndarray) -> np.ndarray:
        """(n, n_free, 3) m of coordinates (n, k)."""
        return (self.mean + z @ self.basis).reshape(len(z), -1, 3)
