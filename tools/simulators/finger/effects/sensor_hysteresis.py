"""The conductors answer to a strain that remembers: (1 - share) strain + share m.

lag: dm/dt = (strain - m) / time, a fading memory; play: m follows once the strain is `width` away, at any rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class SensorHysteresis(Effect):
    id: ClassVar[str] = "sensor_hysteresis"

    kind: str
    share: float
    time_s: float | None
    width: float | None

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SensorHysteresis:
        if rng.random() < 0.5:
            return cls("lag", float(rng.uniform(0.15, 0.4)), float(rng.uniform(1.0, 6.0)), None)
        return cls("play", float(rng.uniform(0.3, 0.7)), None, float(rng.uniform(0.003, 0.008)))

    def stretch(self, clock: np.ndarray, strain: np.ndarray) -> np.ndarray:
        memory = strain.copy()
        for n in range(1, len(strain)):
            if self.time_s is not None:
                keep = np.exp(-(clock[n] - clock[n - 1]) / self.time_s)
                memory[n] = keep * memory[n - 1] + (1 - keep) * strain[n]
            else:
                memory[n] = np.clip(memory[n - 1], strain[n] - self.width, strain[n] + self.width)
        return (1 - self.share) * strain + self.share * memory
