"""What `ShapeController` is held against: the same steps and limits, with something else to be made small."""

from __future__ import annotations

import numpy as np

from twin.control.shape import Seen, ShapeController
from twin.errors import DataError

LENGTH = 0.1  # m, by which strains count as distances: full strain 0.074 moves the points by some 8 mm on average


class StrainTracking(ShapeController):
    """Matches strains: `wanted` are strains (s,) of the cords, and `error` and `residual` are LENGTH times strains."""

    def seen(self, resistance: np.ndarray, truth: np.ndarray | None) -> Seen:
        """No shape is estimated. Raises DataError where a sensor says nothing."""
        felt = super().seen(resistance, self.finger.rest)
        if not np.isfinite(felt.strain).all():
            raise DataError(f"strains are {felt.strain.round(4).tolist()}; to track them every sensor is needed")
        return felt

    def aim(self, wanted: np.ndarray, seen: Seen, points: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return LENGTH * (wanted - seen.strain)[:, None], LENGTH * strains[:, None]


class BendTracking(StrainTracking):
    """Matches what opposite cords, the first half against the second, differ by: how the finger bends, not how it is compressed."""

    def aim(self, wanted: np.ndarray, seen: Seen, points: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart, slope = super().aim(wanted, seen, points, strains)
        half = len(apart) // 2
        return apart[:half] - apart[half:], slope[:half] - slope[half:]


class TipTracking(ShapeController):
    """Brings the centre of the tip's face to where the wanted shape has it."""

    def aim(self, wanted: np.ndarray, seen: Seen, points: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        height = self.finger.rest[:, 2]
        face = height > height.max() - 1e-6
        apart, slope = super().aim(wanted, seen, points, strains)
        return apart[face].mean(axis=0, keepdims=True), slope[face].mean(axis=0, keepdims=True)


class ConstantDirections(ShapeController):
    """The source's law: errors of the points projected on one constant direction a tendon, that in which it pulls the hanging
    finger, averaged over the points; gains from the hanging finger too. Antagonists answer together."""

    def aim(self, wanted: np.ndarray, seen: Seen, points: np.ndarray, strains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart = (self.finger.own(wanted) - seen.points).mean(axis=0)
        return apart[None, :2], self.hanging.points.mean(axis=0)[None, :2]
