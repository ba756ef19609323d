"""Strains that tendons alone make: without contact, tendons of known lengths give the shape, and so its strains.

    eps = MLP(displacements),       deviation = max_i |eps_i - measured_i| / hypot(FLOOR, SHARE measured_i)

The network is trained on free motions beside the estimator of `modal.py`, in whose file it is stored. A slack tendon may be paid
out further and nothing moves, so each sample is also shown with some of its slack tendons longer.
"""

from typing import Any

import numpy as np

from twin.shape.estimators.features import SLACK_DISPLACEMENT, scale_displacements
from twin.shape.estimators.features import STRAIN_SCALE as UNIT
from twin.shape.estimators.weights import perceptron, relu, unpack_layers

# error of a measured strain, the twin's own error included: so much, and this share of it
STRAIN_ERROR_FLOOR, STRAIN_ERROR_SHARE = 5e-4, 0.01
SLACK_VARIED_SHARE = 0.7  # of the samples are shown with slack tendons paid out
HANGING_PER_BATCH = 16  # samples with all tendons slack


class TendonStrainNetwork:
    """The trained network, of weights `free` in `arrays`."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = unpack_layers("free", arrays)

    def __call__(self, displacement: np.ndarray) -> np.ndarray:
        """Return the strains (n, s) under displacements (n, t) m."""
        return UNIT * perceptron(scale_displacements(displacement), self.layers, relu)


def largest_deviation(strain: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return by how many standard deviations (n,) the worst measured strain (n, s), NaN where missing, is off `strain` (n, s)."""
    known = np.where(np.isfinite(measured), measured, strain)
    return (np.abs(strain - known) / strain_error_std(known)).max(axis=1)


def strain_error_std(strain: np.ndarray) -> np.ndarray:
    """Return the standard deviation of measured strains."""
    return np.hypot(STRAIN_ERROR_FLOOR, STRAIN_ERROR_SHARE * strain)


def pay_out_slack_tendons(rng: np.random.Generator, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """Return displacements (n, t) m with slack tendons (tension (n, t) N) paid out further in some samples."""
    further = rng.uniform(size=displacement.shape) * (rng.uniform(size=(len(displacement), 1)) < SLACK_VARIED_SHARE)
    return np.where(tension > 0.0, displacement, displacement + further * np.minimum(SLACK_DISPLACEMENT - displacement, 0.0))
