"""Effects that no catalogue names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation, rotation, unit_vector
from tools.simulators.rod.mechanics.fields import MAGNET_FIELD


@dataclass(frozen=True)
class ClampSlip(Effect):
    """Out of catalogue: the base clamp slips once in mid-session; from then on the robot is turned by 0.5 degree strength.

    Markers turn against the camera and gravity turns against the robot.
    """

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


@dataclass(frozen=True)
class Helix(Effect):
    """Out of catalogue: the disks are glued on ever further turned, hole angles grow by 5 degrees strength sign from base to
    tip."""

    id: ClassVar[str] = "helix"
    in_catalogue: ClassVar[bool] = False
    most: ClassVar[float] = 12.0

    sign: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Helix:
        return cls(1.0, float(rng.choice([-1.0, 1.0])))

    def mount(self, situation: Situation) -> None:
        x = np.linspace(0.0, 1.0, len(situation.rod.pitch) + 1)[:, None]
        angle = situation.rod.hole_angle + np.radians(5.0) * self.strength * self.sign * x
        situation.rod = replace(situation.rod, hole_angle=angle)


@dataclass(frozen=True)
class Magnet(Effect):
    """Out of catalogue: a magnet beside the robot attracts the tip disk, F = 1e-6 N m^3 strength d / (d^2 + (20 mm)^2)^2."""

    id: ClassVar[str] = "magnet"
    in_catalogue: ClassVar[bool] = False

    point: tuple[float, ...]  # m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Magnet:
        a = rng.uniform(0, 2 * np.pi)
        return cls(1.0, (float(0.09 * np.cos(a)), float(0.09 * np.sin(a)), float(rng.uniform(0.06, 0.12))))

    def mount(self, situation: Situation) -> None:
        tip = len(situation.rod.pitch)
        row = [MAGNET_FIELD, tip, *self.point, 0.0, 0.0, 1.0, 1e-6 * self.strength, 0.02]
        situation.fields = np.vstack([situation.fields, row])


@dataclass(frozen=True)
class SoftSpot(Effect):
    """Out of catalogue: one interval between two disks is damaged, its stiffness is divided by 1 + 0.5 strength."""

    id: ClassVar[str] = "soft_spot"
    in_catalogue: ClassVar[bool] = False

    interval: int  # from 0

    @classmethod
    def draw(cls, rng: np.random.Generator) -> SoftSpot:
        return cls(1.0, int(rng.integers(1, 6)))

    def mount(self, situation: Situation) -> None:
        profile = situation.rod.stiffness_profile.copy()
        profile[self.interval] /= 1 + 0.5 * self.strength
        situation.rod = replace(situation.rod, stiffness_profile=profile)


@dataclass(frozen=True)
class Vibration(Effect):
    """Out of catalogue: the building shakes the robot; markers swing by 0.5 mm strength (s/L)^2 at the tip with `frequency`."""

    id: ClassVar[str] = "vibration"
    in_catalogue: ClassVar[bool] = False

    frequency: float  # Hz
    azimuth: float  # rad
    phase: float  # rad

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Vibration:
        return cls(1.0, float(rng.uniform(0.05, 0.6)), float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 2 * np.pi)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        x = np.arange(1, markers.shape[1] + 1) / markers.shape[1]
        out = np.array([np.cos(self.azimuth), np.sin(self.azimuth), 0.0])
        swing = 0.5e-3 * self.strength * np.sin(2 * np.pi * self.frequency * clock + self.phase)
        return markers + swing[:, None, None] * (x**2)[:, None] * out


@dataclass(frozen=True)
class WarmMarkers(Effect):
    """Out of catalogue: the camera's mount expands, markers shift by 0.1 mm/K strength (T - 23 degC) along `direction`."""

    id: ClassVar[str] = "warm_markers"
    in_catalogue: ClassVar[bool] = False
    needs_ambient: ClassVar[bool] = True

    direction: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> WarmMarkers:
        return cls(1.0, tuple(unit_vector(rng)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        return markers + 1e-4 * self.strength * (ambient - 23.0)[:, None, None] * np.array(self.direction)
