"""The backbone's two bending stiffnesses differ: ratio exp(0.1 strength), the soft direction at `angle`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class StiffnessAsymmetry(Effect):
    id: ClassVar[str] = "stiffness_asymmetry"
    most: ClassVar[float] = 6.0

    angle: float  # rad

    @classmethod
    def draw(cls, rng: np.random.Generator) -> StiffnessAsymmetry:
        return cls(1.0, float(rng.uniform(0, np.pi)))

    def mount(self, situation: Situation) -> None:
        situation.rod = replace(situation.rod, stiffness_asymmetry=float(np.exp(0.1 * self.strength)), asymmetry_angle=self.angle)
