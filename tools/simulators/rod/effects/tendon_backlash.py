"""Play between drive and tendon: the motor leads by half the gap in the direction of travel, gap = 0.1 mm strength. One drive is
worn, or all three are alike.

The lead p swaps sides with the tendon's travel d over SWAP: dp = (gap/2 sign(dd) - p) (1 - exp(-|dd| / SWAP)).
Driven by tension, only the logged displacement shows it; driven by length, the tendon lags the motor by p.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect

SWAP = 2e-5  # m


@dataclass(frozen=True)
class TendonBacklash(Effect):
    id: ClassVar[str] = "tendon_backlash"
    seen_in: ClassVar[str] = "displacement"

    worn: tuple[float, ...] = (1.0, 1.0, 1.0)  # share of the gap, a drive

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonBacklash:
        """All drives as often as one of them."""
        one = np.eye(3)[rng.integers(3)]
        return cls(1.0, tuple(map(float, one if rng.random() < 0.5 else np.ones(3))))

    def _lead(self, travelled: np.ndarray) -> np.ndarray:
        half = 0.5e-4 * self.strength * np.array(self.worn)
        lead = np.zeros_like(travelled)
        for n, travel in enumerate(np.diff(travelled, axis=0), start=1):
            lead[n] = lead[n - 1] + (half * np.sign(travel) - lead[n - 1]) * -np.expm1(-np.abs(travel) / SWAP)
        return lead

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + self._lead(displacement)

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return displacement - self._lead(displacement)
