"""Out of catalogue: the silicone is soft around one point (a cavity): E (1 - depth exp(-|X - centre|^2 / 2 width^2))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class SoftSpot(Effect):
    id: ClassVar[str] = "soft_spot"
    in_catalogue: ClassVar[bool] = False

    depth: float
    width_mm: float
    centre_mm: tuple[float, float, float]  # of the undeformed finger, in its own frame

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SoftSpot:
        a, r, z = rng.uniform(0.0, 2 * np.pi), rng.uniform(4.0, 8.0), rng.uniform(25.0, 65.0)
        centre = (float(r * np.cos(a)), float(r * np.sin(a)), float(z))
        return cls(float(rng.uniform(0.6, 0.9)), float(rng.uniform(6.0, 9.0)), centre)

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        distance = ((finger.body.points - self.centre_mm) ** 2).sum(axis=-1)
        finger.body.scale(1 - self.depth * np.exp(-distance / 2 / self.width_mm**2))
