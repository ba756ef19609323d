"""What learned estimators are given of what is felt: strains, which of them are there, and tendon displacements."""

from __future__ import annotations

import numpy as np

STRAIN, LENGTH = 0.04, 5e-3  # sizes that count as one
SLACK = -12e-3  # m: a tendon paid out further holds nothing


def features(strain: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """(n, 2 s + t) of strains (n, s), NaN where missing, and displacements (n, t) m."""
    there = np.isfinite(strain)
    return np.concatenate(
        [np.where(there, strain, 0.0) / STRAIN, there, np.maximum(displacement, SLACK) / LENGTH], axis=1, dtype=np.float64
    )
