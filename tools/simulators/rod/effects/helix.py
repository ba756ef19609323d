"""Out of catalogue: the disks are glued on ever further turned, hole angles grow by 5 degrees strength sign from base to tip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class Helix(Effect):
    id: ClassVar[str] = "helix"
    in_catalogue: ClassVar[bool] = False
    most: ClassVar[float] = 12.0

    sign: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Helix:
        return cls(1.0, float(rng.choice([-1.0, 1.0])))

    def mount(self, situation: Situation) -> None:
        x = np.linspace(0.0, 1.0, len(situation.rod.pitch) + 1)[:, None]
        angle = situation.rod.hole_angle + np.radians(5.0) * self.strength * self.sign * x
        situation.rod = replace(situation.rod, hole_angle=angle)
