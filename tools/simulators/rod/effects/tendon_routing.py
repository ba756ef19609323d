"""One tendon's holes sit elsewhere on every disk: 3 degrees strength further around and 2 % strength further out, in shares."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TendonRouting(Effect):
    id: ClassVar[str] = "tendon_routing"
    most: ClassVar[float] = 10.0

    tendon: int  # from 0
    around: float
    out: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonRouting:
        mix = rng.uniform(-np.pi / 2, np.pi / 2)
        return cls(1.0, int(rng.integers(3)), float(np.cos(mix) * rng.choice([-1, 1])), float(np.sin(mix)))

    def mount(self, situation: Situation) -> None:
        angle, radius = situation.rod.hole_angle.copy(), situation.rod.hole_radius.copy()
        angle[:, self.tendon] += np.radians(3.0) * self.strength * self.around
        radius[:, self.tendon] *= 1 + 0.02 * self.strength * self.out
        situation.rod = replace(situation.rod, hole_angle=angle, hole_radius=radius)
