"""The tendon stretches: motor-side displacement = path displacement + strength (0.05 mm/N T + toe T / (T + T_b)).

Half of them have a toe, of 0.2 mm. Driven by tension, only the displacement shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TendonElasticity(Effect):
    id: ClassVar[str] = "tendon_elasticity"
    seen_in: ClassVar[str] = "displacement"

    toe: float  # m
    half: float  # N, T_b

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonElasticity:
        return cls(1.0, float(rng.choice([0.0, 0.2e-3])), float(rng.uniform(0.3, 1.0)))

    def mount(self, situation: Situation) -> None:
        situation.stretch = 0.05e-3 * self.strength
        situation.bedding = (self.toe * self.strength, self.half)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + self.strength * (0.05e-3 * tension + self.toe * tension / (tension + self.half))
