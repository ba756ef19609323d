"""Symmetric information matrices J'J + P that may be singular.

Singular directions belong to parameters that move the data alike, or not at all. The pseudo-inverse of the matrix, scaled to a unit
diagonal so that units do not decide what is singular, solves for what the data determine and leaves the rest unchanged; the
parameters in singular directions can be named.
"""

from collections.abc import Sequence

import numpy as np

SINGULAR_SHARE = 1e-13  # a direction's share of information, of unit diagonals: below it there is rounding alone
SINGLE_PART_SHARE = 1.0 - 1e-6  # a part's share of the information along a direction: beyond it no other part has any there
UNTOLD_PARAMETER_SHARE = 1e-3  # a parameter's squared share of a singular direction: smaller ones are rounding


def solve(H: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return x (p,) or (p, k) with H x = b for a symmetric H (p, p), zero along the singular directions of H."""
    half = _half(H)
    return half @ (half.T @ b)


def unidentifiable(H: np.ndarray) -> np.ndarray:
    """Return which parameters (p,) have a part in a singular direction of H (p, p)."""
    _, values, V = _directions(H)
    return (V[:, values <= SINGULAR_SHARE] ** 2).sum(axis=1) > UNTOLD_PARAMETER_SHARE


def _directions(H: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sizes (p,) that scale H to a unit diagonal, and the scaled matrix's eigenvalues (p,) and eigenvectors (p, p)."""
    size = np.sqrt(np.maximum(np.diag(H), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, V = np.linalg.eigh(H / np.outer(size, size))
    return size, values, V


def scatter(parts: Sequence[tuple[np.ndarray, np.ndarray]], H: np.ndarray) -> np.ndarray:
    """Return the variances (p,) of a least-squares x, estimated from the disagreement of parts of the data.

    Part k is given by its own J_k'J_k and J_k'z_k at x:

        V = sum_k d_k d_k',   d_k = R (1 - R' J_k'J_k R)^(-1/2) R' J_k'z_k,   R R' = H^-1, H the information of all

    Errors may be correlated within a part and differ between parts, as those of a wrong equation do; without either, the mean of V
    is H^-1. Bell and McCaffrey (2002), bias-reduced linearization. A direction that one part alone determines cannot disagree, and
    counts zero.
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
    """Return R (p, identified) with R R' the inverse of H along the directions that H determines."""
    size, values, V = _directions(H)
    identified = values > SINGULAR_SHARE
    return V[:, identified] / np.sqrt(values[identified]) / size[:, None]
