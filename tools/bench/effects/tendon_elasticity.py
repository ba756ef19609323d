"""The tendon stretches: motor-side displacement = path displacement + 0.05 mm/N strength T.

Driven by tension, only the displacement shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TendonElasticity(Effect):
    id: ClassVar[str] = "tendon_elasticity"
    seen_in: ClassVar[str] = "displacement"

    def mount(self, situation: Situation) -> None:
        situation.stretch = 0.05e-3 * self.strength

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + 0.05e-3 * self.strength * tension
