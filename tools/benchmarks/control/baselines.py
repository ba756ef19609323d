"""Baselines that the controllers of `twin.control` are compared with: a PI loop of tension, two laws of shape control."""

import numpy as np

from twin.control.heating_guard import HeatingGuard
from twin.control.pi_controller import PIController
from twin.control.shape_controller import SensedShape, ShapeController


class PITensionLoop:
    """Tension error to voltage by PI alone, within the guard's limits."""

    def __init__(self, guard: HeatingGuard, proportional: float = 16.0, integral: float = 0.05) -> None:
        """Gains in V/N and V/(N s): the best of 1-40 and 0.05-0.8 on the circle of `tools.benchmarks.control.tracking`,
        unloaded."""
        self.guard = guard
        self.controller = PIController(guard.n, proportional, integral, 0.0, guard.supply)

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray:
        """Return voltages (n,) V to hold for dt seconds. Arguments as of `TensionLoop.step`."""
        self.guard.bound_temperatures(tension, elongation)
        return self.guard.limit_voltages(self.controller.step(target - tension, dt), elongation, dt, temperature)


class TipTracking(ShapeController):
    """Bring the centre of the tip's face to its place in the wanted shape."""

    def control_error(
        self, wanted: np.ndarray, sensed: SensedShape, points: np.ndarray, strains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        height = self.finger.rest[:, 2]
        face = height > height.max() - 1e-6
        error, slope = super().control_error(wanted, sensed, points, strains)
        return error[face].mean(axis=0, keepdims=True), slope[face].mean(axis=0, keepdims=True)


class ConstantDirections(ShapeController):
    """KineSoft's law: errors of the points projected on one constant direction a tendon, averaged over the points.

    The direction is that in which the tendon pulls the hanging finger, from which the gains come too. Antagonists act together.
    """

    def control_error(
        self, wanted: np.ndarray, sensed: SensedShape, points: np.ndarray, strains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        error = (self.finger.to_finger_frame(wanted) - sensed.points).mean(axis=0)
        return error[None, :2], self.hanging_response.points.mean(axis=0)[None, :2]
