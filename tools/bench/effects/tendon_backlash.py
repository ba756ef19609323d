"""Play between drive and tendon: the motor leads by half the gap in the direction of travel, gap = 0.1 mm strength.

The lead p swaps sides with the tendon's travel d over 0.02 mm: dp = (gap/2 sign(dd) - p) (1 - exp(-|dd| / 0.02 mm)).
Only the logged displacement shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.bench.effects.effect import Effect


@dataclass(frozen=True)
class TendonBacklash(Effect):
    id: ClassVar[str] = "tendon_backlash"
    seen_in: ClassVar[str] = "displacement"

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        half = 0.5e-4 * self.strength
        lead = np.zeros(displacement.shape[1])
        out = np.empty_like(displacement)
        out[0] = displacement[0]
        for n, travel in enumerate(np.diff(displacement, axis=0), start=1):
            lead = lead + (half * np.sign(travel) - lead) * -np.expm1(-np.abs(travel) / 2e-5)
            out[n] = displacement[n] + lead
        return out
