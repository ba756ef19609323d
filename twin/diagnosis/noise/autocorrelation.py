"""Whether sensors' noise remembers the row before, where no trial repeats another.

Smooth noise and a smooth error of the model look alike in one channel. In many they do not: an error of the body is shared by its
markers, in the few ways in which a body moves, and noise is each channel's own.
"""

from collections.abc import Sequence

import numpy as np

FEWEST_DIRECTIONS = 4  # directions without anything shared, that a correlation is read from
LEAST_ROWS_SEEN = 0.7  # of the rows: a channel seen in fewer is left out
CLEAR_AUTOCORRELATION = 3.0  # standard errors


def autocorrelation(residual: Sequence[np.ndarray], member: np.ndarray) -> np.ndarray:
    """Lag-1 correlation (n_output,) of AR(1) noise, one a group of channels (`member` (n_output,)), from residuals (n_k, n_output)
    of one unit in a group; zero where it is not clearly there, or too few channels tell.

    With V_k = mean (r_i - r_(i-k))^2 of what no two channels share, 2 sigma^2 (1 - rho^k) of such noise, rho = V_2 / V_1 - 1:
    what is slow takes no part in it. Shared is what stands out of the covariance of r_i - r_(i-4), beyond the lags that rho is read
    from (from the same ones it would come out larger by one standard error): its largest eigenvalues down to the edge
    (1 + sqrt(m / n))^2 that independent channels have (Marchenko and Pastur 1967), n rows told as half since they may be
    correlated. The standard error of rho is sqrt(2 / (n m)), that of white noise.
    """
    rho = np.zeros(member.size)
    seen = np.isfinite(np.concatenate(residual)).mean(axis=0)
    for g in range(member.max() + 1):
        columns = np.flatnonzero((member == g) & (seen > LEAST_ROWS_SEEN))
        if columns.size < FEWEST_DIRECTIONS:
            continue
        one, two, four = (_differences([r[:, columns] for r in residual], lag) for lag in (1, 2, 4))
        if len(four) <= columns.size:
            continue
        own = _own(four)
        if own.shape[1] < FEWEST_DIRECTIONS:
            continue
        V_1, V_2 = (float(np.mean((d @ own) ** 2)) for d in (one, two))
        found = V_2 / V_1 - 1.0 if V_1 > 0.0 else 0.0
        if found > CLEAR_AUTOCORRELATION * np.sqrt(2.0 / (len(two) * own.shape[1])):
            rho[member == g] = min(found, 0.9)
    return rho


def _differences(residual: Sequence[np.ndarray], lag: int) -> np.ndarray:
    d = np.concatenate([r[lag:] - r[:-lag] for r in residual])
    return d[np.isfinite(d).all(axis=1)]


def _own(d: np.ndarray) -> np.ndarray:
    """Directions (n_channel, k) of differences d (n, n_channel) that nothing shared moves."""
    values, vectors = np.linalg.eigh(d.T @ d / len(d))
    edge, k = (1.0 + np.sqrt(2.0 * values.size / len(d))) ** 2, values.size
    while values[k - 1] > edge * np.mean(values[:k]):
        k -= 1
    return vectors[:, :k]
