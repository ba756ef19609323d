"""Out of catalogue: the silicone takes up solvent and swells all day, alike everywhere.

The unstressed volume goes with 1 + most (1 - exp(-t / time)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class Swelling(Effect):
    id: ClassVar[str] = "swelling"
    in_catalogue: ClassVar[bool] = False

    most: float
    time_s: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> Swelling:
        return cls(float(rng.uniform(0.03, 0.06)), float(rng.uniform(200.0, 600.0)))

    def swell(self, clock: float) -> float:
        return 1 - self.most * float(np.expm1(-clock / self.time_s))
