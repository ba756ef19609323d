"""Young's modulus falls with the room's temperature: E(T) = E(23 degC) (1 - 0.005 strength (T - 23))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect


@dataclass(frozen=True)
class TemperatureSoftening(Effect):
    id: ClassVar[str] = "temperature_softening"
    needs_ambient: ClassVar[bool] = True
    most: ClassVar[float] = 10.0

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray:
        return 1 / (1 - 0.005 * self.strength * (ambient - 23.0))
