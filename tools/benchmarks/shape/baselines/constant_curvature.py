"""An arc of one curvature and one stretch, its sections rigid.

    eps_i = axial - r (kx cos a_i + ky sin a_i),      r the cord's mean distance from the axis, a_i its azimuth

(axial, kx, ky) by least squares from the strains that are there; the arc begins at the clamp. It uses no material, gravity or
tendons, and has no parameter to train.
"""

import numpy as np

from twin.prediction.twin import Twin
from twin.shape.estimators.estimator import Estimator, SensorReadings, ShapeEstimates

ERROR_SHARE, LEAST_ERROR = (
    0.094,
    1.4e-3,
)  # of a point's displacement, and m: 1.645 of both hold 90 % of held-out factory fingers' points
UNEXPLAINED_STRAIN = 0.02  # strain that an arc does not explain


class ConstantCurvatureEstimator(Estimator):
    """An arc, without memory."""

    description = "an arc of one curvature"

    def __init__(self, twin: Twin) -> None:
        super().__init__(twin)
        paths = self.body.cord_paths
        middle = paths.mean(axis=1)
        self._rows = np.column_stack([np.ones(len(paths)), -middle[:, 0], -middle[:, 1]])

    def estimate(self, felt: SensorReadings) -> ShapeEstimates:
        there = np.isfinite(felt.strain)
        arcs = np.stack([np.linalg.lstsq(self._rows[t], e[t], rcond=None)[0] for e, t in zip(felt.strain, there, strict=True)])
        left = np.where(there, felt.strain - arcs @ self._rows.T, 0.0)
        moved = np.stack([self._arc(*arc) for arc in arcs])
        size = np.linalg.norm(moved, axis=2)
        return ShapeEstimates(moved, np.hypot(ERROR_SHARE * size, LEAST_ERROR), np.abs(left).max(axis=1) > UNEXPLAINED_STRAIN)

    def _arc(self, axial: float, kx: float, ky: float) -> np.ndarray:
        """Return displacements (P, 3) m of the points."""
        rest, clamp = self.points.rest, self.body.cone.clamp
        s = np.maximum(rest[:, 2] - clamp, 0.0)
        k = np.hypot(kx, ky)
        towards = np.array([kx, ky]) / k if k > 0.0 else np.array([1.0, 0.0])
        angle = k * s
        length = s * (1.0 + axial)
        sag = length * np.where(angle > 1e-6, (1.0 - np.cos(angle)) / np.maximum(angle, 1e-12), 0.5 * angle)
        rise = length * np.sinc(angle / np.pi)
        out = rest[:, :2] @ towards  # distance from the axis in the plane of bending
        across = rest[:, :2] - np.outer(out, towards)
        place = across + np.outer(sag + out * np.cos(angle), towards)
        height = np.minimum(rest[:, 2], clamp) + rise - out * np.sin(angle)
        return np.column_stack([place, height]) - rest
