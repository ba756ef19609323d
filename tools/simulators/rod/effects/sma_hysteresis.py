"""A wider loop of the springs: A_s and A_f lie 2 K strength higher, M_s and M_f `below` of that lower, the finish a tenth more than
the start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class SmaHysteresis(Effect):
    id: ClassVar[str] = "sma_hysteresis"
    driven_by_current: ClassVar[bool] = True
    most: ClassVar[float] = 10.0

    below: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> SmaHysteresis:
        return cls(1.0, float(rng.uniform(0.4, 1.2)))

    def mount(self, situation: Situation) -> None:
        ms, mf, as_, af = situation.springs.phases
        up, down = 2.0 * self.strength, 2.0 * self.strength * self.below
        situation.springs = replace(situation.springs, phases=(ms - down, mf - 1.1 * down, as_ + up, af + 1.1 * up))
