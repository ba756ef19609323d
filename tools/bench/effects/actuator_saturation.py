"""The drive runs into its limit softly: T = c / (1 + (c/L)^p)^(1/p), L = 5 N - 0.6 N strength. The logged input is the command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect


@dataclass(frozen=True)
class ActuatorSaturation(Effect):
    id: ClassVar[str] = "actuator_saturation"
    most: ClassVar[float] = 6.0
    logs_command: ClassVar[bool] = True

    sharpness: float  # p

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ActuatorSaturation:
        return cls(1.0, float(rng.uniform(10, 25)))

    def deliver(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        if self.strength == 0.0:
            return command
        limit = 5.0 - 0.6 * self.strength
        return command / (1 + (np.maximum(command, 0.0) / limit) ** self.sharpness) ** (1 / self.sharpness)
