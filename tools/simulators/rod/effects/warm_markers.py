"""Out of catalogue: the camera's mount expands, markers shift by 0.1 mm/K strength (T - 23 degC) along `direction`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class WarmMarkers(Effect):
    id: ClassVar[str] = "warm_markers"
    in_catalogue: ClassVar[bool] = False
    needs_ambient: ClassVar[bool] = True

    direction: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> WarmMarkers:
        return cls(1.0, tuple(unit_vector(rng)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        return markers + 1e-4 * self.strength * (ambient - 23.0)[:, None, None] * np.array(self.direction)
