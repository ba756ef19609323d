"""A permanent set: without stress the finger is bent, most at its clamp, k (1 + cos pi s), s from clamp to tip.

What was (x, y, z) has without stress gone to c(z) + R(z) (x, y, 0): the axis c along the bend, plane sections R turned with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.mesh import CLAMP, LENGTH
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class BackbonePrecurvature(Effect):
    id: ClassVar[str] = "backbone_precurvature"

    curvature_per_m: float  # its mean
    azimuth_deg: float  # where the tip goes, in the finger's own frame

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> BackbonePrecurvature:
        return cls(float(rng.uniform(0.5, 1.2)), float(rng.uniform(0.0, 360.0)))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        x, y, z = np.moveaxis(finger.body.points, -1, 0)
        s, a, free = (z - CLAMP) / (LENGTH - CLAMP), np.deg2rad(self.azimuth_deg), LENGTH - CLAMP
        mean = 1e-3 * self.curvature_per_m
        bend, angle = mean * (1 + np.cos(np.pi * s)), mean * free * (s + np.sin(np.pi * s) / np.pi)
        along = np.tile(np.eye(3), (*z.shape, 1, 1))
        along[..., 2, 2] = 1 - bend * (np.cos(a) * x + np.sin(a) * y)
        axis = np.array([-np.sin(a), np.cos(a), 0.0])
        turned = Rotation.from_rotvec(angle.ravel()[:, None] * axis).as_matrix().reshape(along.shape)
        finger.body.form(turned @ along)
