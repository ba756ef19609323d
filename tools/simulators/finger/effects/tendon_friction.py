"""Capstan friction at all 19 bends of every tendon, with pre-sliding; the law is in `tools/simulators/finger/cables.py`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class TendonFriction(Effect):
    id: ClassVar[str] = "tendon_friction"

    mu: float
    stroke_mm: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> TendonFriction:
        return cls(float(rng.uniform(0.25, 0.6)), float(rng.uniform(0.05, 0.2)))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        finger.cables.mu, finger.cables.stroke = self.mu, self.stroke_mm
