"""Gravity points elsewhere than declared: turned by 1 degree strength about an axis fixed in the base frame. Markers stay there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation, rotation, unit_vector


@dataclass(frozen=True)
class BaseTilt(Effect):
    id: ClassVar[str] = "base_tilt"
    most: ClassVar[float] = 12.0

    axis: tuple[float, float, float]  # unit vector in the base frame, the same whichever way the robot is mounted

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BaseTilt:
        return cls(1.0, tuple(float(v) for v in unit_vector(rng)))

    def mount(self, situation: Situation) -> None:
        situation.gravity = rotation(np.radians(self.strength) * np.array(self.axis)) @ situation.gravity
