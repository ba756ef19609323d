"""Delayed strain of the silicone: a share of the shear modulus relaxes with one time (standard linear solid).

The recursion is in `tools/simulators/finger/statics.py`; its state lives on the day's clock and relaxes in the pauses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.statics import Finger


@dataclass(frozen=True)
class BackboneCreep(Effect):
    id: ClassVar[str] = "backbone_creep"

    share: float  # of the instantaneous shear modulus
    time_s: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> BackboneCreep:
        return cls(float(rng.uniform(0.08, 0.25)), float(np.exp(rng.uniform(np.log(4.0), np.log(40.0)))))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        finger.creep = (self.share, self.time_s)
