"""Gravity points elsewhere than declared: turned by 1 degree strength about a horizontal axis. Markers stay in the base frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect, Situation, rotation


@dataclass(frozen=True)
class BaseTilt(Effect):
    id: ClassVar[str] = "base_tilt"
    most: ClassVar[float] = 12.0

    azimuth: float  # rad, where around the vertical the axis points

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BaseTilt:
        return cls(1.0, float(rng.uniform(0, 2 * np.pi)))

    def mount(self, situation: Situation) -> None:
        down = situation.gravity / np.linalg.norm(situation.gravity)
        aside = np.cross(down, np.eye(3)[np.argmin(np.abs(down))])
        aside /= np.linalg.norm(aside)
        axis = np.cos(self.azimuth) * aside + np.sin(self.azimuth) * np.cross(down, aside)
        situation.gravity = rotation(np.radians(self.strength) * axis) @ situation.gravity
