"""The tendon beds in: motor-side displacement = path displacement + 0.2 mm strength T / (T + T_b).

Driven by tension, only the displacement shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect, Situation


@dataclass(frozen=True)
class ConstructionalStretch(Effect):
    id: ClassVar[str] = "constructional_stretch"
    most: ClassVar[float] = 10.0
    seen_in: ClassVar[str] = "displacement"

    half: float  # N, T_b

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ConstructionalStretch:
        return cls(1.0, float(rng.uniform(0.3, 1.0)))

    def mount(self, situation: Situation) -> None:
        situation.bedding = (0.2e-3 * self.strength, self.half)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + 0.2e-3 * self.strength * tension / (tension + self.half)
