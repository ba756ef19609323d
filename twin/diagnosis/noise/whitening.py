"""Measured - predicted, in sensor sigmas, made white: the noise of its sensors, and that of the readings that drive the twin.

A sensor's own noise remembers the row before: the share s of its variance is AR(1) of correlation f, the rest is white. A reading
wrong by du moves the predicted shape by G du, the same way in all channels and in that row alone; so does a row whose inputs and
markers were not taken at quite the same moment, by a small share of the input's change from row to row. With
A_i = sigma_u G_i / sigma the residual of row i in sigmas is x_i = c_i + v_i + A_i w_i, c_i AR(1), v_i white, w_i ~ N(0, I).
What its past does not tell of it is white (Kalman, J. Basic Eng. 82, 1960). With w^ and S what row i tells of w_i, mean and
covariance, a channel's own noise is filtered from x_i - A_i w^_i, and foretold as p:

    P' = f^2 P + (1 - f^2) s,  K = P' / (P' + 1 - s),  P = (1 - K) P',  p' = f (p + K (x - A w^ - p)),
    e_i = x_i - p_i,  cov e_i = diag(P' + 1 - s) + M_i A_(i-1) S A_(i-1)' M_i + A_i A_i',  z_i = (cov e_i)^(-1/2) e_i.

M_i^2 is f^2 K^2 and what is left of it in later rows, f^2 (1 - K)^2 a row: exact where all noise remembers (s = 1, K = 1), else as
if A S A' were the same in the rows before. A channel that was not seen in the row before has M_i as its own alone.

A tendon that a law makes slack does not feel its reading's noise, and |z|^2 falls by it though the law need not be true: the robot
has never felt it. `Whitener.heard` is what that noise adds where the tendon is taut, so that laws can be compared without it
(the corrected score of errors in variables, Nakamura, Biometrika 77, 1990). A tendon that a law leaves x noises above slack feels
max(0, x + e): of the noise's square 1 - Var max(0, x + e) is lost, which is the share of readings under `SLACK_READING`, to 0.03.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from scipy.special import ndtr

from twin.diagnosis.noise.model import Noise
from twin.foundation.compiled import jit

ROW_SYNCHRONY = 0.05  # of a sample interval: how well inputs and markers of one row are known to belong to the same moment
SLACK_READING = 0.4  # noises of a reading above slack: as many are below as noise's square is cut off there
SLACK_BLUR = 0.25  # noises, over which that is blurred where a fit is to feel it: derivatives then reach the readings beside it
FILTER_MEMORY_ROWS = 12  # rows, after which what a filter kept of one reading's noise is forgotten
SETTLED_COVARIANCE = 1e-12  # of the covariance S, which is at most I


class Filter:
    """What makes the rows of one trial white: A (n, m, t) as above, `present` (n, m) what was measured, and of a sensor's
    noise the `share` (m,) that remembers the row before by `fade` (m,).

    `gain` (n, m) is f K, `scale` 1 / the spread of what is new in a channel; F (n, m, q) what channels share, in those spreads,
    z = e + F core F' e and w^ = told F' e.
    """

    def __init__(self, A: np.ndarray, present: np.ndarray, share: np.ndarray, fade: np.ndarray) -> None:
        n, _, t = A.shape
        self.A, self.fade = np.ascontiguousarray(A), fade
        self.gain, spread, held = _alone(present, share, fade)
        # rows that a channel was last seen in: what was told of the inputs' noise there comes back by the shares `held`
        before = np.maximum.accumulate(np.where(present, np.arange(n)[:, None], 0), axis=0)
        before = np.vstack([before[:1] * 0, before[:-1]])
        last = present & (before == np.arange(n)[:, None] - 1)
        back = A[before, np.arange(A.shape[1])] * np.sqrt(held)[:, :, None]
        gap = present & ~last
        covariance, own, settled = np.zeros((n, t, t)), spread.copy(), False
        while not settled:
            own[gap] = spread[gap] + np.einsum("kt,kts,ks->k", back[gap], covariance[before[gap]], back[gap])
            self.scale = present / np.sqrt(own)
            self.F = A * self.scale[:, :, None]
            if covariance.any():
                root = np.linalg.cholesky(np.concatenate([np.eye(t)[None], covariance[:-1]]))
                self.F = np.concatenate([self.F, np.where(last[:, :, None], back, 0.0) @ root * self.scale[:, :, None]], axis=2)
            gram = self.F.transpose(0, 2, 1) @ self.F
            self.told = np.ascontiguousarray(np.linalg.inv(np.eye(gram.shape[1]) + gram)[:, :t])
            settled = not back.any() or np.abs(self.told[:, :, :t] - covariance).max() < SETTLED_COVARIANCE
            covariance = self.told[:, :, :t]
        eigen, V = np.linalg.eigh(gram)
        eigen = np.maximum(eigen, 1e-12)
        self.core = V * ((1.0 / np.sqrt(1.0 + eigen) - 1.0) / eigen)[:, None, :] @ V.transpose(0, 2, 1)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """z (n, m) of x (n, m), in sigmas, zero where nothing was measured."""
        own, shared = (self.fade, self.gain, self.scale), (self.A, self.F, self.core, self.told)
        return _whitened(np.ascontiguousarray(x), own, shared)


@jit
def _alone(present, share, fade):
    """f K, P' + 1 - s and M^2 of each sample (n, m), before any input's noise."""
    n, m = present.shape
    gain, spread, memory = np.empty((n, m)), np.empty((n, m)), np.empty((n, m))
    for j in range(m):
        ahead, held, square = share[j], 0.0, fade[j] ** 2
        for i in range(n):
            spread[i, j], memory[i, j] = ahead + 1.0 - share[j], held
            K = ahead / spread[i, j] if present[i, j] else 0.0
            gain[i, j], held = fade[j] * K, square * ((1.0 - K) ** 2 * held + K**2)
            ahead = square * (1.0 - K) * ahead + (1.0 - square) * share[j]
    return gain, spread, memory


@jit
def _whitened(x, own, shared):
    """z of x by each channel's own noise and by what channels share, as named in `Filter`."""
    (fade, gain, scale), (A, F, core, told) = own, shared
    n, m = x.shape
    t, q = A.shape[2], F.shape[2]
    z, ahead, w, f = np.empty_like(x), np.zeros(m), np.empty(t), np.empty(q)
    for i in range(n):
        f[:] = 0.0
        for j in range(m):
            z[i, j] = (x[i, j] - ahead[j]) * scale[i, j]
            for k in range(q):
                f[k] += F[i, j, k] * z[i, j]
        for p in range(q):
            common = 0.0
            for k in range(q):
                common += core[i, p, k] * f[k]
            for j in range(m):
                z[i, j] += F[i, j, p] * common
        for k in range(t):
            w[k] = 0.0
            for p in range(q):
                w[k] += told[i, k, p] * f[p]
        for j in range(m):
            left = x[i, j] - ahead[j]
            for k in range(t):
                left -= A[i, j, k] * w[k]
            ahead[j] = fade[j] * ahead[j] + gain[i, j] * left
    return z


class Whitener:
    """Makes residuals and their derivatives white, given a Noise and sensitivities G (n_k, n_output, n_tendon) to the commands;
    `taut` are those of tendons held taut, where some are slack.

    `heard` (n_k, n_tendon): what a reading's noise in a row adds to |z|^2, in the mean, of a tendon that is taut.
    """

    def __init__(
        self, noise: Noise, measured: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], command: Sequence[np.ndarray],
        taut: Sequence[np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        self.noise = noise
        self.present = [np.isfinite(y) for y in measured]
        shared = [self._shared(p, g, u) for p, g, u in zip(self.present, sensitivity, command, strict=True)]
        self.filters = [Filter(A, p, *noise.lasting) for A, p in zip(shared, self.present, strict=True)]
        self.input_noise_energy = [self._heard(k, G) for k, G in enumerate(taut or sensitivity)]

    def _shared(self, present: np.ndarray, G: np.ndarray, command: np.ndarray) -> np.ndarray:
        change = np.abs(np.diff(command, axis=0, prepend=command[:1], append=command[-1:]))  # (n + 1, t)
        spread = np.hypot(self.noise.drive, ROW_SYNCHRONY * np.maximum(change[1:], change[:-1]))  # (n, t)
        return spread[:, None, :] * G / self.noise.sigma[:, None] * present[:, :, None]

    def _heard(self, k: int, G: np.ndarray) -> np.ndarray:
        """Each row's noise by itself, of all rows that are so far apart that none is felt in another's."""
        n, _, n_tendon = G.shape
        heard, steps = np.zeros((n, n_tendon)), min(FILTER_MEMORY_ROWS, n) if self.filters[k].gain.any() else 1
        for t in np.flatnonzero(self.noise.drive):
            noise = self.noise.drive[t] * G[:, :, t]
            for first in range(steps):
                apart = np.arange(first, n, steps)
                row = np.zeros_like(noise)
                row[apart] = noise[apart]
                heard[apart, t] = np.add.reduceat((self.trial(k, row) ** 2).sum(axis=1), apart)
        return heard

    def clipped_input_noise(self, k: int, tension: np.ndarray) -> np.ndarray:
        """Of `heard`, what is cut off near slack where a law has a tendon under tension (n_k, n_tendon) N, slack below zero."""
        above = np.divide(tension, self.noise.drive, out=np.full_like(tension, np.inf), where=self.noise.drive > 0.0)
        return self.input_noise_energy[k] * ndtr((SLACK_READING - above) / SLACK_BLUR)

    def of(self, which: Sequence[int]) -> Whitener:
        """The same of some of its trials alone, by their positions."""
        part = copy(self)
        for name in ("present", "input_noise_energy", "filters"):
            setattr(part, name, [getattr(self, name)[k] for k in which])
        return part

    def trial(self, k: int, r: np.ndarray) -> np.ndarray:
        """Whitened residual (n, m) of trial k; zero where nothing was measured. Works for columns of a Jacobian alike."""
        return self.filters[k](np.where(self.present[k], r, 0.0) / self.noise.sigma)
