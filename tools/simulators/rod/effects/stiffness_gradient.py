"""Bending and twisting stiffness changes linearly from base to tip, by 0.2 strength sign of the mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class StiffnessGradient(Effect):
    id: ClassVar[str] = "stiffness_gradient"
    most: ClassVar[float] = 7.0

    sign: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> StiffnessGradient:
        return cls(1.0, float(rng.choice([-1.0, 1.0])))

    def mount(self, situation: Situation) -> None:
        situation.rod = replace(situation.rod, stiffness_gradient=0.2 * self.strength * self.sign)
