"""A soft pad stands upright beside the finger and presses back on skin that enters it, in proportion to the depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.skin import Pad
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class Contact(Effect):
    id: ClassVar[str] = "contact"

    azimuth_deg: float  # in the base frame
    distance_mm: float  # of the pad's face from the base's centre
    stiffness_N_mm3: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> Contact:
        stiffness = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2)))
        return cls(float(rng.uniform(0.0, 360.0)), float(rng.uniform(16.0, 21.0)), float(stiffness))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        a = np.deg2rad(self.azimuth_deg)
        normal = turn.T @ [np.cos(a), np.sin(a), 0.0]
        finger.pads = (*finger.pads, Pad(tuple(map(float, normal)), self.distance_mm, self.stiffness_N_mm3))
