"""What a twin leaves on held shapes, as a smooth function of the pulls: Gaussian-process regression, one output a channel.

    r(u) ~ N(0, s^2 exp(-|u - u'|^2 / (2 l^2)) + s^2 g [u = u']),   u the pulls over their largest

Length l and noise share g, common to all channels, are chosen by leave-one-out over the observations, in closed form: with K the
kernel matrix, the residual of observation i predicted from the others is [K^-1 r]_i / [K^-1]_ii (Rasmussen and Williams 2006, eq
5.10-5.12). Channels are in their noises there, so that neither their units nor the worst of them decides. The prior mean is zero:
far from all data the twin stands alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LENGTHS = (0.3, 0.6, 1.2, 2.4)  # of the largest pull
NOISE_SHARES = (0.1, 0.3, 1.0, 3.0, 10.0)  # variance over that of the smooth part; ours: from clear structure to almost none


@dataclass(frozen=True)
class Remainder:
    """A fitted remainder. `pull` (k, n_tendon) in units of `span`, `weights` (k, n_output), `error` its leave-one-out RMS, in
    noises."""

    pull: np.ndarray
    span: np.ndarray
    weights: np.ndarray
    length: float
    error: float

    @staticmethod
    def fit(pull: np.ndarray, residual: np.ndarray, noise: np.ndarray) -> Remainder:
        """From residuals (k, n_output) at pulls (k, n_tendon), any units, and each channel's noise (n_output,) in its own."""
        span = np.maximum(np.abs(pull).max(axis=0), 1e-12)
        u, best = pull / span, None
        for length in LENGTHS:
            for share in NOISE_SHARES:
                inverse = np.linalg.inv(kernel(u, u, length) + share * np.eye(len(u)))
                left = inverse @ (residual / noise) / np.diag(inverse)[:, None]
                error = float(np.sqrt(np.mean(left**2)))
                if best is None or error < best.error:
                    best = Remainder(u, span, inverse @ residual, length, error)
        assert best is not None
        return best

    def predict(self, pull: np.ndarray) -> np.ndarray:
        """What the twin is expected to leave, (n, n_output), at pulls (n, n_tendon)."""
        return kernel(pull / self.span, self.pull, self.length) @ self.weights


def kernel(a: np.ndarray, b: np.ndarray, length: float) -> np.ndarray:
    """exp(-|a - b|^2 / (2 l^2)), (len(a), len(b))."""
    return np.exp(-0.5 * ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2) / length**2)
