"""Stiffer in one bending plane or on one side: the modulus varies over the section.

plane: E (1 + s (r/R)^2 cos 2 (azimuth - a)); side: E (1 + s r/R cos (azimuth - a)); azimuths in the finger's own frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.mesh import radius
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class StiffnessAsymmetry(Effect):
    id: ClassVar[str] = "stiffness_asymmetry"

    kind: str
    strength: float
    azimuth_deg: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> StiffnessAsymmetry:
        kind = str(rng.choice(["plane", "side"]))
        azimuth = rng.uniform(0.0, 180.0 if kind == "plane" else 360.0)
        return cls(kind, float(rng.uniform(0.25, 0.5)), float(azimuth))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        x, y, z = np.moveaxis(finger.body.points, -1, 0)
        waves = {"plane": 2, "side": 1}[self.kind]
        turned = waves * (np.arctan2(y, x) - np.deg2rad(self.azimuth_deg))
        finger.body.scale(1 + self.strength * (np.hypot(x, y) / radius(z)) ** waves * np.cos(turned))
