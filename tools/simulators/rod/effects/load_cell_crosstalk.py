"""A load cell also feels its neighbours: y_i = T_i + 0.03 strength sum_j share_ij T_j, j other than i."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class LoadCellCrosstalk(Effect):
    id: ClassVar[str] = "load_cell_crosstalk"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]  # (12, 13, 21, 23, 31, 32)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellCrosstalk:
        return cls(1.0, tuple(unit_vector(rng, 6) * np.sqrt(6)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        mix = np.zeros((3, 3))
        mix[~np.eye(3, dtype=bool)] = self.share
        return tension @ (np.eye(3) + 0.03 * self.strength * mix).T
