"""Base of the baselines whose network gives every point's displacement and no error of its own."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path

import numpy as np

from twin.robots import Robot
from twin.shape.estimators.estimator import SensorReadings
from twin.shape.estimators.learned import LearnedEstimator

PLACE_SCALE, DISPLACEMENT_SCALE = 0.05, 0.01  # m: sizes that count as one


class PointwiseEstimator(LearnedEstimator):
    """An estimator without an error of its own: (share (n, 1) |moved|)^2 + rest^2 of `error`, fitted to held-out fingers."""

    @classmethod
    def weights_path(cls, robot: Robot) -> Path:
        """Return the weights' file in this package."""
        return Path(__file__).parent / "weights" / f"{cls.name()}.npz"

    @abstractmethod
    def moved(self, felt: SensorReadings) -> np.ndarray:
        """Return displacements (n, P, 3) m of the points."""

    def decode(self, felt: SensorReadings) -> tuple[np.ndarray, np.ndarray]:
        moved = self.moved(felt)
        moved[:, self.points.rest[:, 2] <= self.body.cone.clamp] = 0.0
        share, rest = self.arrays["error"]
        return moved, np.hypot(share * np.linalg.norm(moved, axis=2), rest)
