"""Each load cell is off by a constant: y_i = T_i + 0.03 N strength share_i."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class LoadCellBias(Effect):
    id: ClassVar[str] = "load_cell_bias"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellBias:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return tension + 0.03 * self.strength * np.array(self.share)
