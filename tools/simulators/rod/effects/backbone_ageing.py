"""The backbone tires over the session, compliance times 1 + 0.05 strength (clock / 1 h)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect


@dataclass(frozen=True)
class BackboneAgeing(Effect):
    id: ClassVar[str] = "backbone_ageing"
    most: ClassVar[float] = 10.0  # half as compliant again in an hour; more is no ageing

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray:
        return 1 + 0.05 * self.strength * clock / 3600.0
