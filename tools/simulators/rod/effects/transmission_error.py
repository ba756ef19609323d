"""A drum whose axis is off its centre, 0.1 mm times strength, draws in more or less tendon than its turning says.

The tendon leaves the drum (radius R) on its tangent through a guide g 40 mm away. With its centre at c = e (cos(theta + p),
sin(theta + p)) the piece from guide to drum is sqrt(|g - c|^2 - R^2) and touches the drum at angle(g - c) + arccos(R / |g - c|).
The drive takes R theta for what is drawn in; the drum draws in R theta and what both pieces change by. Drums are alike but for p.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect

GUIDE = 0.04  # m
ROUNDS = 40  # of the inverse; each takes off the error's slope, below a half


@dataclass(frozen=True)
class TransmissionError(Effect):
    id: ClassVar[str] = "transmission_error"
    most: ClassVar[float] = 10.0
    seen_in: ClassVar[str] = "displacement"
    driven_by_length: ClassVar[bool] = True

    radius: float  # m
    phases: tuple[float, ...]  # rad
    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TransmissionError:
        phases, share = rng.uniform(-np.pi, np.pi, 3), rng.uniform(0.3, 1.0, 3)
        return cls(1.0, float(rng.uniform(2.5e-3, 5e-3)), tuple(map(float, phases)), tuple(map(float, share)))

    def _led(self, theta: np.ndarray) -> np.ndarray:
        """Tendon (m) between guide and the drum's own zero mark, but for R theta."""
        e = 1e-4 * self.strength * np.array(self.share)
        angle = theta + np.array(self.phases)
        x, y = GUIDE - e * np.cos(angle), -e * np.sin(angle)
        distance = np.hypot(x, y)
        return np.sqrt(distance**2 - self.radius**2) - self.radius * (np.arctan2(y, x) + np.arccos(self.radius / distance))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        theta = displacement / self.radius
        return displacement + self._led(theta) - self._led(0.0 * theta)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        motor = displacement
        for _ in range(ROUNDS):
            motor = displacement - (self.pull(motor) - motor)
        return motor
