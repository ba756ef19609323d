"""Symmetric information matrices J'J + P that may be singular: parameters that move the data alike, or that move nothing.

What such data tell is solved for, what they cannot tell is left where it is (the pseudo-inverse of the matrix scaled to a unit
diagonal) and can be named. Scaled, since units must not decide what is singular.
"""

from __future__ import annotations

import numpy as np

SINGULAR = 1e-13  # a direction's share of information, of unit diagonals: below it there is rounding alone
PART = 1e-3  # a parameter's squared share of a direction that data cannot tell: smaller ones are rounding


def solve(H: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x (p,) or (p, k) with H x = b for a symmetric H (p, p), zero along the directions in which H tells nothing."""
    size, values, V = _directions(H)
    told = values > SINGULAR
    half = V[:, told] / np.sqrt(values[told]) / size[:, None]
    return half @ (half.T @ b)


def untold(H: np.ndarray) -> np.ndarray:
    """(p,) which parameters have a part in a direction in which H (p, p) tells nothing."""
    _, values, V = _directions(H)
    return (V[:, values <= SINGULAR] ** 2).sum(axis=1) > PART


def _directions(H: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes (p,) that scale H to a unit diagonal, and eigenvalues (p,) and eigenvectors (p, p) of what that leaves."""
    size = np.sqrt(np.maximum(np.diag(H), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, V = np.linalg.eigh(H / np.outer(size, size))
    return size, values, V
