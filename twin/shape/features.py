"""What learned estimators are given of what is felt: strains, which of them are there, tendon displacements, and whether something
may press."""

from __future__ import annotations

import numpy as np

STRAIN, LENGTH = 0.04, 5e-3  # sizes that count as one
SLACK = -12e-3  # m: a tendon paid out further holds nothing


def features(strain: np.ndarray, displacement: np.ndarray, pushed: np.ndarray | bool) -> np.ndarray:
    """(n, 2 s + t + 1) of strains (n, s), NaN where missing, displacements (n, t) m and `pushed` (n,)."""
    there, pressed = np.isfinite(strain), np.broadcast_to(pushed, len(strain))[:, None]
    parts = [np.where(there, strain, 0.0) / STRAIN, there, lengths(displacement), pressed]
    return np.concatenate(parts, axis=1, dtype=np.float64)


def recalled(strain: np.ndarray, follows: np.ndarray | None, back: int) -> np.ndarray:
    """(back, n, s): the strains of the 1 to `back` rows before each of (n, s); where nothing is before, those of the first."""
    row = np.arange(len(strain))
    started = np.ones(len(strain), bool) if follows is None else ~np.asarray(follows, bool)
    found = []
    for _ in range(back):
        row = np.where(started[row] | (row == 0), row, row - 1)
        found.append(strain[row])
    return np.stack(found)


def lengths(displacement: np.ndarray) -> np.ndarray:
    """(n, t) of displacements (n, t) m."""
    return np.maximum(displacement, SLACK) / LENGTH
