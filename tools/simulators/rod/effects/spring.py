"""Effects of springs of shape-memory alloy, which pull where a day is driven by currents."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class SmaCooling(Effect):
    """A draught on the springs: each loses more heat, 1 + 0.15 strength gust_i times as much, the gusts differing by some tenth."""

    id: ClassVar[str] = "sma_cooling"
    driven_by_current: ClassVar[bool] = True

    gust: tuple[float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> SmaCooling:
        return cls(1.0, tuple(float(g) for g in rng.uniform(0.9, 1.1, 3)))  # type: ignore[arg-type]

    def mount(self, situation: Situation) -> None:
        more = 1.0 + 0.15 * self.strength * np.array(self.gust)
        situation.springs = replace(situation.springs, draught=situation.springs.draught * more)


@dataclass(frozen=True)
class SmaHysteresis(Effect):
    """A wider loop of the springs: A_s and A_f lie 2 K strength higher, M_s and M_f `below` of that lower, the finish a tenth more
    than the start."""

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
