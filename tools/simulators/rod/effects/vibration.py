"""Out of catalogue: the building shakes the robot; markers swing by 0.5 mm strength (s/L)^2 at the tip with `frequency`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect


@dataclass(frozen=True)
class Vibration(Effect):
    id: ClassVar[str] = "vibration"
    in_catalogue: ClassVar[bool] = False

    frequency: float  # Hz
    azimuth: float  # rad
    phase: float  # rad

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Vibration:
        return cls(1.0, float(rng.uniform(0.05, 0.6)), float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 2 * np.pi)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        x = np.arange(1, markers.shape[1] + 1) / markers.shape[1]
        out = np.array([np.cos(self.azimuth), np.sin(self.azimuth), 0.0])
        swing = 0.5e-3 * self.strength * np.sin(2 * np.pi * self.frequency * clock + self.phase)
        return markers + swing[:, None, None] * (x**2)[:, None] * out
