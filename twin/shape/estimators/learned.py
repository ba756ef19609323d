"""Base of estimators with trained weights: their band width and the domain they were trained on.

    std^2 = (widen spread)^2 + own^2,      `widen` (2, k, P): of each point, where something may press and where nothing does,
                                            at k mean displacements `levels` (2, k) m of the points, between these by straight lines

1.645 widen spread holds 90 % of the points of held-out fingers, little and far deformed ones alike; own is the error of the twin
that made these. A strain pattern is outside the training domain where its Mahalanobis distance from the training patterns is beyond
all but one in a thousand of those.
"""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.prediction.twin import Twin
from twin.robots import Robot
from twin.shape.estimators.estimator import Estimator, SensorReadings, ShapeEstimates, twin_error
from twin.shape.estimators.weights import read_weights

if TYPE_CHECKING:
    from twin.shape.training.samples import TrainingSamples
    from twin.shape.training.training_spec import TrainingSpec


def mean_displacement(displacements: np.ndarray) -> np.ndarray:
    """Return the mean displacement (n,) m of points displaced by (n, P, 3) m."""
    return np.linalg.norm(displacements, axis=2).mean(axis=1)


def interpolate_levels(level: np.ndarray, levels: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate `values` (k, P), given at rising `levels` (k,), to levels (n,): (n, P), constant beyond the last."""
    i = np.clip(np.searchsorted(levels, level) - 1, 0, len(levels) - 2)
    t = np.clip((level - levels[i]) / (levels[i + 1] - levels[i]), 0.0, 1.0)[:, None]
    return (1.0 - t) * values[i] + t * values[i + 1]


class LearnedEstimator(Estimator):
    """Base of all estimators with weights. It has no memory."""

    def __init__(self, twin: Twin, arrays: dict[str, Any] | None = None) -> None:
        """`arrays`: weights other than those beside the robot. Raises DataError for a robot or weights that do not go together."""
        super().__init__(twin)
        self.arrays = read_weights(self.weights_path(twin.robot), self.weights_format()) if arrays is None else arrays

    @classmethod
    def weights_path(cls, robot: Robot) -> Path:
        """Return the weights' file, which lies beside robot.toml."""
        return robot.folder / f"{cls.name()}.npz"

    @classmethod
    def weights_format(cls) -> str:
        """Return the format name that its weights' file states."""
        return f"twin-{cls.name()}/3"

    @classmethod
    @abstractmethod
    def training_spec(cls, samples: TrainingSamples) -> TrainingSpec:
        """Return how its network is trained."""

    @abstractmethod
    def decode(self, readings: SensorReadings) -> tuple[np.ndarray, np.ndarray]:
        """Return displacements (n, P, 3) m of the points and their spread (n, P) m before it is widened."""

    def held_out_quantiles(self, readings: SensorReadings) -> dict[str, float]:
        """Return limits to store with the weights, from readings of held-out samples, by name."""
        return {}

    def estimate(self, readings: SensorReadings) -> ShapeEstimates:
        """Estimate the shapes, their band widened to the level of deformation."""
        displacements, spread = self.decode(readings)
        row = 0 if readings.pushed else 1
        widen = interpolate_levels(mean_displacement(displacements), self.arrays["levels"][row], self.arrays["widen"][row])
        std = np.hypot(spread * widen, twin_error(displacements))
        return ShapeEstimates(displacements, std, self._is_outside(readings))

    def _is_outside(self, readings: SensorReadings) -> np.ndarray:
        """Return whether the strains that are there (n,) lie outside the training domain, whatever the missing ones are."""
        x, covariance = readings.strain - self.arrays["known_mean"], np.linalg.inv(self.arrays["known_inverse"])
        present, distance = np.isfinite(x), np.zeros(len(x))
        for some in np.unique(present, axis=0):
            rows = (present == some).all(axis=1)
            inverse, known = np.linalg.inv(covariance[np.ix_(some, some)]), x[rows][:, some]
            distance[rows] = np.einsum("ni,ij,nj->n", known, inverse, known)
        return distance > float(self.arrays["known_far"])
