"""Symmetric information matrices J'J + P that may be singular: parameters that move the data alike, or that move nothing.

What such data tell is solved for, what they cannot tell is left where it is (the pseudo-inverse of the matrix scaled to a unit
diagonal) and can be named. Scaled, since units must not decide what is singular.
"""

from collections.abc import Sequence

import numpy as np

SINGULAR_SHARE = 1e-13  # a direction's share of information, of unit diagonals: below it there is rounding alone
SINGLE_PART_SHARE = 1.0 - 1e-6  # a part's share of the information along a direction: beyond it no other part tells anything there
UNTOLD_PARAMETER_SHARE = 1e-3  # a parameter's squared share of a direction that data cannot tell: smaller ones are rounding


def solve(H: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x (p,) or (p, k) with H x = b for a symmetric H (p, p), zero along the directions in which H tells nothing."""
    half = _half(H)
    return half @ (half.T @ b)


def unidentifiable(H: np.ndarray) -> np.ndarray:
    """(p,) which parameters have a part in a direction in which H (p, p) tells nothing."""
    _, values, V = _directions(H)
    return (V[:, values <= SINGULAR_SHARE] ** 2).sum(axis=1) > UNTOLD_PARAMETER_SHARE


def _directions(H: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes (p,) that scale H to a unit diagonal, and eigenvalues (p,) and eigenvectors (p, p) of what that leaves."""
    size = np.sqrt(np.maximum(np.diag(H), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, V = np.linalg.eigh(H / np.outer(size, size))
    return size, values, V


def scatter(parts: Sequence[tuple[np.ndarray, np.ndarray]], H: np.ndarray) -> np.ndarray:
    """Variances (p,) of a least-squares x by how far parts of the data disagree, each given by its own J_k'J_k and J_k'z_k at x:

        V = sum_k d_k d_k',   d_k = R (1 - R' J_k'J_k R)^(-1/2) R' J_k'z_k,   R R' = H^-1, H the information of all

    Errors may go together within a part and differ between parts, as those of a wrong law do; without either V is H^-1 in the mean.
    Bell and McCaffrey (2002), bias-reduced linearization. What one part alone tells cannot disagree, and counts nothing.
    """
    R = _half(H)
    V = np.zeros((len(H), len(H)))
    for information, slope in parts:
        share, U = np.linalg.eigh(R.T @ information @ R)
        left = np.maximum(1.0 - share, SINGULAR_SHARE)
        d = R @ (U @ (np.where(share < SINGLE_PART_SHARE, left**-0.5, 0.0) * (U.T @ (R.T @ slope))))
        V += np.outer(d, d)
    return np.diag(V)


def _half(H: np.ndarray) -> np.ndarray:
    """R (p, told) with R R' the inverse of H along the directions in which it tells something."""
    size, values, V = _directions(H)
    told = values > SINGULAR_SHARE
    return V[:, told] / np.sqrt(values[told]) / size[:, None]
