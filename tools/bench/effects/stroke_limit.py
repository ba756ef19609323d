"""One drive, or all of them, creeps up to its end stop: it draws in (u^-p + L^-p)^(-1/p) of u, L = 16 mm - 0.8 mm strength.

The logged displacement is the command. A drive pays out freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect


@dataclass(frozen=True)
class StrokeLimit(Effect):
    id: ClassVar[str] = "stroke_limit"
    most: ClassVar[float] = 12.0
    by_length: ClassVar[bool] = True

    sharpness: float  # p
    stops: tuple[bool, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> StrokeLimit:
        alone = np.arange(3) == rng.integers(3)
        return cls(1.0, float(rng.uniform(12, 30)), tuple(map(bool, alone if rng.random() < 0.5 else np.ones(3, bool))))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        if self.strength == 0.0:
            return displacement
        limit = 16e-3 - 8e-4 * self.strength
        drawn = np.maximum(displacement, 0.0)
        stopped = drawn / (1.0 + (drawn / limit) ** self.sharpness) ** (1.0 / self.sharpness)
        return np.where(np.array(self.stops) & (displacement > 0.0), stopped, displacement)
