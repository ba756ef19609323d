"""The change of resistance is read too large or too small: R0 + gain (R - R0).

A gain that leaves kappa within its tolerance would be no effect, so every worn sensor's leaves the range 0.7 .. 1.3 of kappa.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built

OUTSIDE = 0.2  # by which the larger or the smaller effective kappa lies outside its tolerance


@dataclass(frozen=True)
class SensorGain(Effect):
    id: ClassVar[str] = "sensor_gain"

    gain: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SensorGain:
        worn = rng.permutation(4) < rng.integers(1, 5)
        high = (1.3 + OUTSIDE + rng.uniform(0.0, 0.5)) / np.maximum(built.kappa_stretch, built.kappa_compression)
        low = (0.7 - OUTSIDE - rng.uniform(0.0, 0.2)) / np.minimum(built.kappa_stretch, built.kappa_compression)
        return cls(tuple(map(float, np.where(worn, high if rng.random() < 0.5 else low, 1.0))))

    def read(self, clock: np.ndarray, resistance: np.ndarray, built: Built) -> np.ndarray:
        return built.R0_ohm + np.array(self.gain) * (resistance - built.R0_ohm)
