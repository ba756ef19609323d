"""Control of strains instead of shape, with the steps and limits of `ShapeController`."""

import numpy as np

from twin.control.shape_controller import SensedShape, ShapeController
from twin.foundation.errors import DataError

STRAIN_LENGTH = 0.1  # m, by which strains count as distances: full strain 0.074 moves the points by some 8 mm on average


class StrainTracking(ShapeController):
    """Track strains: `wanted` are strains (s,) of the cords; `error` and `residual` are STRAIN_LENGTH times strains."""

    def sense_shape(self, resistance: np.ndarray, truth: np.ndarray | None) -> SensedShape:
        """Return the strains, without an estimated shape. Raises DataError where a sensor is dead."""
        sensed = super().sense_shape(resistance, self.finger.rest)
        if not np.isfinite(sensed.strain).all():
            raise DataError(f"strains are {sensed.strain.round(4).tolist()}; to track them every sensor is needed")
        return sensed

    def control_error(
        self, wanted: np.ndarray, sensed: SensedShape, points: np.ndarray, strains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return STRAIN_LENGTH * (wanted - sensed.strain)[:, None], STRAIN_LENGTH * strains[:, None]


class BendTracking(StrainTracking):
    """Track differences of opposite cords, the first half against the second: the finger's bend without its compression."""

    def control_error(
        self, wanted: np.ndarray, sensed: SensedShape, points: np.ndarray, strains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        error, slope = super().control_error(wanted, sensed, points, strains)
        half = len(error) // 2
        return error[:half] - error[half:], slope[:half] - slope[half:]
