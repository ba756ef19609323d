"""The zero of each load cell wanders with the common clock: y_i = T_i + 0.05 N strength share_i (x + bend x^2), x = clock / 1 h."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class LoadCellDrift(Effect):
    id: ClassVar[str] = "load_cell_drift"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]
    bend: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellDrift:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)), float(rng.uniform(-0.25, 0.25)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        hours = clock[:, None] / 3600.0
        return tension + 0.05 * self.strength * np.array(self.share) * (hours + self.bend * hours**2)
