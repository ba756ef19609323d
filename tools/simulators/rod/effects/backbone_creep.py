"""Delayed strain of the backbone in bending and twist, with two retardation times, integrated in `march.py`.

J(t) = C (1 + 0.08 strength sum_n split_n (1 - exp(-t / time_n))). The state lives on the common clock and relaxes in the gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class BackboneCreep(Effect):
    id: ClassVar[str] = "backbone_creep"

    split: tuple[float, float]
    time: tuple[float, float]  # s

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BackboneCreep:
        fast = rng.uniform(0.3, 0.7)
        return cls(
            1.0,
            (float(fast), 1.0 - float(fast)),
            (float(rng.uniform(3, 12)), float(np.exp(rng.uniform(np.log(30), np.log(200))))),
        )

    def mount(self, situation: Situation) -> None:
        situation.creep = (0.08 * self.strength * np.array(self.split), np.array(self.time))
