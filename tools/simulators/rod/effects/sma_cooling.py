"""A draught on the springs: each loses more heat, 1 + 0.15 strength gust_i times as much, the gusts differing by some tenth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class SmaCooling(Effect):
    id: ClassVar[str] = "sma_cooling"
    driven_by_current: ClassVar[bool] = True

    gust: tuple[float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> SmaCooling:
        return cls(1.0, tuple(float(g) for g in rng.uniform(0.9, 1.1, 3)))  # type: ignore[arg-type]

    def mount(self, situation: Situation) -> None:
        more = 1.0 + 0.15 * self.strength * np.array(self.gust)
        situation.springs = replace(situation.springs, draught=situation.springs.draught * more)
