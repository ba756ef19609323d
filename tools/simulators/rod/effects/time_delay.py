"""Outputs are logged 0.1 s strength after the inputs of the same time stamp: y(t) = y_true(t - delay)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class TimeDelay(Effect):
    id: ClassVar[str] = "time_delay"

    def mount(self, situation: Situation) -> None:
        situation.latency = 0.1 * self.strength
