"""The drive runs into its limit softly: it delivers (c^-p + L^-p)^(-1/p) of c. The logged input is the command.

Of tensions L = 5 N - 0.6 N strength, all drives; of lengths L = 16 mm - 1.6 mm strength, one drive or all of them; they pay out
freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect


@dataclass(frozen=True)
class ActuatorSaturation(Effect):
    id: ClassVar[str] = "actuator_saturation"
    most: ClassVar[float] = 6.0
    logs_command: ClassVar[bool] = True

    sharpness: float  # p
    stops: tuple[bool, ...] = (True, True, True)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ActuatorSaturation:
        sharpness, alone = float(rng.uniform(10, 25)), np.arange(3) == rng.integers(3)
        return cls(1.0, sharpness, tuple(map(bool, alone if rng.random() < 0.5 else np.ones(3, bool))))

    def _within(self, command: np.ndarray, limit: float) -> np.ndarray:
        if self.strength == 0.0:
            return command
        return command / (1 + (np.maximum(command, 0.0) / limit) ** self.sharpness) ** (1 / self.sharpness)

    def deliver(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        return self._within(command, 5.0 - 0.6 * self.strength)

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return np.where(np.array(self.stops), self._within(displacement, 16e-3 - 1.6e-3 * self.strength), displacement)
