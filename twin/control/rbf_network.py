"""A network of Gaussian neurons with one linear layer that learns online (Peng et al. 2025, Eqs 11-12).

    u = W' H(X),   h_k = exp(-|X - c_k|^2 / (2 b^2)),   dW/dt = rate (e H) / (H' H) - leak W

e is the error that u should remove. Published are the form and the Gaussian; centres, widths, rate and the leak that keeps weights
bounded (the sigma modification of Ioannou and Kokotovic, 1984) are ours.
"""

import itertools

import numpy as np


class RBFNetwork:
    """One network for each of n signals, on inputs scaled to [-1, 1]; centres lie on a grid."""

    def __init__(self, n: int, n_input: int, rate: float, limit: float, leak: float = 0.005, each: int = 4) -> None:
        """`rate` (output units per error unit and second), weights within +-`limit`, `each` centres along every input."""
        line = np.linspace(-1.0, 1.0, each)
        self.centre = np.array(list(itertools.product(line, repeat=n_input)))  # (n_neuron, n_input)
        self.width = 2.0 / (each - 1)
        self.rate, self.limit, self.leak = rate, limit, leak
        self.weight = np.zeros((n, len(self.centre)))

    def activations(self, X: np.ndarray) -> np.ndarray:
        """Return H (n, n_neuron) of inputs X (n, n_input)."""
        square = ((np.clip(X, -1.2, 1.2)[:, None] - self.centre) ** 2).sum(axis=2)
        return np.exp(-square / (2.0 * self.width**2))

    def step(self, X: np.ndarray, error: np.ndarray, dt: float) -> np.ndarray:
        """Learn from errors (n,) that hold for dt seconds at X (n, n_input), and return the output (n,) there."""
        H = self.activations(X)
        grown = self.weight + dt * (self.rate * (error / (H**2).sum(axis=1))[:, None] * H - self.leak * self.weight)
        self.weight = np.clip(grown, -self.limit, self.limit)
        return (self.weight * H).sum(axis=1)
