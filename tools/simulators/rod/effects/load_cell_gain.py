"""Each load cell reads its tension with its own factor: y_i = (1 + 0.03 strength share_i) T_i."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class LoadCellGain(Effect):
    id: ClassVar[str] = "load_cell_gain"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellGain:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return tension * (1 + 0.03 * self.strength * np.array(self.share))
