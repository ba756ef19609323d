"""Play between drive and tendon: the tendon stays where it is until the drive has crossed the gap.

Delivered displacement d' = min(max(d', d - gap), d): taut when pulling begins at the far side, so the first `gap` pulls nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class TendonBacklash(Effect):
    id: ClassVar[str] = "tendon_backlash"

    gap_mm: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> TendonBacklash:
        return cls(tuple(map(float, rng.uniform(0.25, 0.9) * rng.uniform(0.8, 1.2, 4))))

    def drive(self, command: np.ndarray) -> np.ndarray:
        delivered = command.copy()
        for n in range(1, len(command)):
            delivered[n] = np.clip(delivered[n - 1], command[n] - self.gap_mm, command[n])
        return delivered
