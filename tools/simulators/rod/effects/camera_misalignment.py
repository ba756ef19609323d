"""The marker frame is turned by 0.7 degree strength and shifted by 0.5 mm strength against the base: y = Q x + b."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, rotation, unit_vector


@dataclass(frozen=True)
class CameraMisalignment(Effect):
    id: ClassVar[str] = "camera_misalignment"
    most: ClassVar[float] = 5.0

    axis: tuple[float, ...]
    shift: tuple[float, ...]  # direction and share of the shift

    @classmethod
    def draw(cls, rng: np.random.Generator) -> CameraMisalignment:
        return cls(1.0, tuple(unit_vector(rng)), tuple(rng.uniform(0.3, 1.0) * unit_vector(rng)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        turned = markers @ rotation(np.radians(0.7 * self.strength) * np.array(self.axis)).T
        return turned + 0.5e-3 * self.strength * np.array(self.shift)
