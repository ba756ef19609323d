"""Inputs of learned estimators: strains, which of them are there, tendon displacements, and whether something may press."""

import numpy as np

STRAIN_SCALE, DISPLACEMENT_SCALE = 0.04, 5e-3  # strain, and m, that count as one
SLACK_DISPLACEMENT = -12e-3  # m: a tendon paid out further is slack


def network_features(strain: np.ndarray, displacement: np.ndarray, pushed: np.ndarray | bool) -> np.ndarray:
    """Return features (n, 2 s + t + 1) of strains (n, s), NaN where missing, displacements (n, t) m and `pushed` (n,)."""
    present, pressed = np.isfinite(strain), np.broadcast_to(pushed, len(strain))[:, None]
    parts = [np.where(present, strain, 0.0) / STRAIN_SCALE, present, scale_displacements(displacement), pressed]
    return np.concatenate(parts, axis=1, dtype=np.float64)


def scale_displacements(displacement: np.ndarray) -> np.ndarray:
    """Return features (n, t) of tendon displacements (n, t) m."""
    return np.maximum(displacement, SLACK_DISPLACEMENT) / DISPLACEMENT_SCALE
