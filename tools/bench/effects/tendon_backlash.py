"""Play between drive and tendon: the motor leads by half the gap in the direction of travel, gap = 0.1 mm strength.

The lead p swaps sides with the tendon's travel d over SWAP: dp = (gap/2 sign(dd) - p) (1 - exp(-|dd| / SWAP)).
Driven by tension, only the logged displacement shows it; driven by length, the tendon lags the motor by p.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect

SWAP = 2e-5  # m


@dataclass(frozen=True)
class TendonBacklash(Effect):
    id: ClassVar[str] = "tendon_backlash"
    seen_in: ClassVar[str] = "displacement"

    def _lead(self, travelled: np.ndarray) -> np.ndarray:
        half = 0.5e-4 * self.strength
        lead = np.zeros_like(travelled)
        for n, travel in enumerate(np.diff(travelled, axis=0), start=1):
            lead[n] = lead[n - 1] + (half * np.sign(travel) - lead[n - 1]) * -np.expm1(-np.abs(travel) / SWAP)
        return lead

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + self._lead(displacement)

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return displacement - self._lead(displacement)
