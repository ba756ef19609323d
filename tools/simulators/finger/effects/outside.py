"""Effects of the tendons and around the finger."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.mechanics.skin import Pad
from tools.simulators.finger.mechanics.statics import Finger
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class Contact(Effect):
    """A soft pad stands upright beside the finger and presses back on skin that enters it, in proportion to the depth."""

    id: ClassVar[str] = "contact"

    azimuth_deg: float  # in the base frame
    distance_mm: float  # of the pad's face from the base's centre
    stiffness_N_mm3: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> Contact:
        stiffness = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2)))
        return cls(float(rng.uniform(0.0, 360.0)), float(rng.uniform(16.0, 21.0)), float(stiffness))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        a = np.deg2rad(self.azimuth_deg)
        normal = turn.T @ [np.cos(a), np.sin(a), 0.0]
        finger.pads = (*finger.pads, Pad(tuple(map(float, normal)), self.distance_mm, self.stiffness_N_mm3))


@dataclass(frozen=True)
class TendonBacklash(Effect):
    """Play between drive and tendon: the tendon stays where it is until the drive has crossed the gap.

    Delivered displacement d' = min(max(d', d - gap), d): taut when pulling begins at the far side, so the first `gap` pulls
    nothing.
    """

    id: ClassVar[str] = "tendon_backlash"

    gap_mm: tuple[float, float, float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> TendonBacklash:
        return cls(tuple(map(float, rng.uniform(0.25, 0.9) * rng.uniform(0.8, 1.2, 4))))

    def drive(self, command: np.ndarray) -> np.ndarray:
        delivered = command.copy()
        for n in range(1, len(command)):
            delivered[n] = np.clip(delivered[n - 1], command[n] - self.gap_mm, command[n])
        return delivered


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Capstan friction at all 19 bends of every tendon, with pre-sliding; the law is in `finger/mechanics/cables.py`."""

    id: ClassVar[str] = "tendon_friction"

    mu: float
    stroke_mm: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> TendonFriction:
        return cls(float(rng.uniform(0.25, 0.6)), float(rng.uniform(0.05, 0.2)))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        finger.cables.mu, finger.cables.stroke = self.mu, self.stroke_mm
