"""Strains that tendons alone make: where nothing pushes, tendons of known lengths give the shape, and so its strains.

    eps = MLP(displacements),       far = max_i |eps_i - felt_i| / hypot(STRAIN, GAIN felt_i)

trained on the factory's free motions beside the estimator of `modal.py`, in whose file it is kept. A tendon without tension may be
paid out further and nothing moves, so that each sample is shown with some of its slack tendons longer.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.shape.features import SLACK, lengths
from twin.shape.features import STRAIN as UNIT
from twin.shape.weights import perceptron, relu, unpack

STRAIN, GAIN = 5e-4, 0.01  # what a felt strain is wrong by, the twin's own error with it: so much, and this share of it
OFTEN = 0.7  # of the samples are shown with slack tendons paid out
HANGING = 16  # in every batch: all tendons slack


class Free:
    """The trained network, of weights `free` in `arrays`."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = unpack("free", arrays)

    def __call__(self, displacement: np.ndarray) -> np.ndarray:
        """Strains (n, s) under displacements (n, t) m."""
        return UNIT * perceptron(lengths(displacement), self.layers, relu)


def far(strain: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """(n,): by how many standard deviations the worst of the strains felt (n, s), NaN where missing, is off `strain` (n, s)."""
    there = np.where(np.isfinite(felt), felt, strain)
    return (np.abs(strain - there) / wrong_by(there)).max(axis=1)


def wrong_by(strain: np.ndarray) -> np.ndarray:
    """Standard deviation of felt strains."""
    return np.hypot(STRAIN, GAIN * strain)


def paid_out(rng: np.random.Generator, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """Displacements (n, t) m with tendons that hold nothing (tension (n, t) N) longer in some samples."""
    further = rng.uniform(size=displacement.shape) * (rng.uniform(size=(len(displacement), 1)) < OFTEN)
    return np.where(tension > 0.0, displacement, displacement + further * np.minimum(SLACK - displacement, 0.0))
