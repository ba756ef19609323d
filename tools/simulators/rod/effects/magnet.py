"""Out of catalogue: a magnet beside the robot attracts the tip disk, F = 1e-6 N m^3 strength d / (d^2 + (20 mm)^2)^2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation
from tools.simulators.rod.fields import MAGNET


@dataclass(frozen=True)
class Magnet(Effect):
    id: ClassVar[str] = "magnet"
    in_catalogue: ClassVar[bool] = False

    point: tuple[float, ...]  # m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Magnet:
        a = rng.uniform(0, 2 * np.pi)
        return cls(1.0, (float(0.09 * np.cos(a)), float(0.09 * np.sin(a)), float(rng.uniform(0.06, 0.12))))

    def mount(self, situation: Situation) -> None:
        tip = len(situation.rod.pitch)
        row = [MAGNET, tip, *self.point, 0.0, 0.0, 1.0, 1e-6 * self.strength, 0.02]
        situation.fields = np.vstack([situation.fields, row])
