"""Out of catalogue: one interval between two disks is damaged, its stiffness is divided by 1 + 0.5 strength."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class SoftSpot(Effect):
    id: ClassVar[str] = "soft_spot"
    in_catalogue: ClassVar[bool] = False

    interval: int  # from 0

    @classmethod
    def draw(cls, rng: np.random.Generator) -> SoftSpot:
        return cls(1.0, int(rng.integers(1, 6)))

    def mount(self, situation: Situation) -> None:
        profile = situation.rod.stiffness_profile.copy()
        profile[self.interval] /= 1 + 0.5 * self.strength
        situation.rod = replace(situation.rod, stiffness_profile=profile)
