"""Out of catalogue: the base clamp slips once in mid-session; from then on the robot is turned by 0.5 degree strength.

Markers turn against the camera and gravity turns against the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation, rotation, unit_vector


@dataclass(frozen=True)
class ClampSlip(Effect):
    id: ClassVar[str] = "clamp_slip"
    in_catalogue: ClassVar[bool] = False

    axis: tuple[float, ...]
    moment: float  # s on the common clock

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ClampSlip:
        return cls(1.0, tuple(unit_vector(rng)), float(rng.uniform(800, 1600)))

    def _turn(self) -> np.ndarray:
        return rotation(np.radians(0.5 * self.strength) * np.array(self.axis))

    def mount(self, situation: Situation) -> None:
        if situation.start > self.moment:
            situation.gravity = self._turn().T @ situation.gravity

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        # The clamp slips between two trials: a whole trial lies before or after.
        return markers @ self._turn().T if clock[0] > self.moment else markers
