"""A mass of 1 g strength at the tip that nobody wrote down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TipPayload(Effect):
    id: ClassVar[str] = "tip_payload"

    def mount(self, situation: Situation) -> None:
        situation.payload += 1e-3 * self.strength
