"""Effects of the strain sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class SensorDrift(Effect):
    """Every resistance grows or falls in proportion to the time of the day: R (1 + rate t)."""

    id: ClassVar[str] = "sensor_drift"

    rate_per_s: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SensorDrift:
        """Up to the 8.3 % seen in 1,000 cycles (KineSoft), here within one day of 800 s; all cords the same way."""
        return cls(tuple(map(float, rng.choice([-1.0, 1.0]) * rng.uniform(3e-5, 1e-4, 4))))

    def read(self, clock: np.ndarray, resistance: np.ndarray, built: Built) -> np.ndarray:
        return resistance * (1 + clock[:, None] * self.rate_per_s)


OUTSIDE = 0.2  # by which the larger or the smaller effective kappa lies outside its tolerance


@dataclass(frozen=True)
class SensorGain(Effect):
    """The change of resistance is read too large or too small: R0 + gain (R - R0).

    A gain that leaves kappa within its tolerance would be no effect, so every worn sensor's leaves the range 0.7 .. 1.3 of kappa.
    """

    id: ClassVar[str] = "sensor_gain"

    gain: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SensorGain:
        worn = rng.permutation(4) < rng.integers(1, 5)
        high = (1.3 + OUTSIDE + rng.uniform(0.0, 0.5)) / np.maximum(built.kappa_stretch, built.kappa_compression)
        low = (0.7 - OUTSIDE - rng.uniform(0.0, 0.2)) / np.minimum(built.kappa_stretch, built.kappa_compression)
        return cls(tuple(map(float, np.where(worn, high if rng.random() < 0.5 else low, 1.0))))

    def read(self, clock: np.ndarray, resistance: np.ndarray, built: Built) -> np.ndarray:
        return built.R0_ohm + np.array(self.gain) * (resistance - built.R0_ohm)


@dataclass(frozen=True)
class SensorHysteresis(Effect):
    """The conductors answer to a strain that remembers: (1 - share) strain + share m.

    lag: dm/dt = (strain - m) / time, a fading memory; play: m follows once the strain is `width` away, at any rate.
    """

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
