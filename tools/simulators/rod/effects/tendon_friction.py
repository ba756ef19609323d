"""Capstan friction at the holes of the inner disks with Iwan pre-sliding; the law itself is in `tools/simulators/rod/tendons.py`.

mu = 0.1 strength; `stroke` is the mean slip before a hole slides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TendonFriction(Effect):
    id: ClassVar[str] = "tendon_friction"
    most: ClassVar[float] = 8.0  # mu 0.8; dry metal on metal is at 0.6

    stroke: float  # m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonFriction:
        return cls(1.0, float(np.exp(rng.uniform(np.log(2e-5), np.log(2e-4)))))

    def mount(self, situation: Situation) -> None:
        situation.mu = 0.1 * self.strength
        situation.stroke = self.stroke
