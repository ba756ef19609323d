"""Every resistance grows or falls in proportion to the time of the day: R (1 + rate t)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class SensorDrift(Effect):
    id: ClassVar[str] = "sensor_drift"

    rate_per_s: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SensorDrift:
        """Up to the 8.3 % seen in 1,000 cycles (KineSoft), here within one day of 800 s; all cords the same way."""
        return cls(tuple(map(float, rng.choice([-1.0, 1.0]) * rng.uniform(3e-5, 1e-4, 4))))

    def read(self, clock: np.ndarray, resistance: np.ndarray, built: Built) -> np.ndarray:
        return resistance * (1 + clock[:, None] * self.rate_per_s)
