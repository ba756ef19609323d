"""The unloaded backbone is bent: curvature 0.5 strength (1/m) towards `angle`, varying linearly along the body by `slope`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class BackbonePrecurvature(Effect):
    id: ClassVar[str] = "backbone_precurvature"

    angle: float  # rad
    slope: float  # relative difference tip minus base

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BackbonePrecurvature:
        return cls(1.0, float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(-0.6, 0.6)))

    def mount(self, situation: Situation) -> None:
        x = (np.arange(len(situation.rod.pitch)) + 0.5) / len(situation.rod.pitch)
        size = 0.5 * self.strength * (1 + self.slope * (x - 0.5))
        # A tip towards `angle` is a rotation about the axis 90 degrees further on.
        bend = size[:, None] * np.array([-np.sin(self.angle), np.cos(self.angle), 0.0])
        situation.rod = replace(situation.rod, precurvature=situation.rod.precurvature + bend)
