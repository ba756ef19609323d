"""Effects in the silicone: creep, rest curvature, uneven stiffness, a cavity, swelling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from tools.simulators.finger.effects.effect import Effect
from tools.simulators.finger.mechanics.mesh import CLAMP, FINGER_LENGTH, radius
from tools.simulators.finger.mechanics.statics import Finger
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class BackboneCreep(Effect):
    """Delayed strain of the silicone: a share of the shear modulus relaxes with one time (standard linear solid).

    The recursion is in `finger/mechanics/statics.py`; its state lives on the day's clock and relaxes in the pauses.
    """

    id: ClassVar[str] = "backbone_creep"

    share: float  # of the instantaneous shear modulus
    time_s: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> BackboneCreep:
        return cls(float(rng.uniform(0.08, 0.25)), float(np.exp(rng.uniform(np.log(4.0), np.log(40.0)))))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        finger.creep = (self.share, self.time_s)


@dataclass(frozen=True)
class BackbonePrecurvature(Effect):
    """A permanent set: without stress the finger is bent, most at its clamp, k (1 + cos pi s), s from clamp to tip.

    What was (x, y, z) has without stress gone to c(z) + R(z) (x, y, 0): the axis c along the bend, plane sections R turned with it.
    """

    id: ClassVar[str] = "backbone_precurvature"

    curvature_per_m: float  # its mean
    azimuth_deg: float  # where the tip goes, in the finger's own frame

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> BackbonePrecurvature:
        return cls(float(rng.uniform(0.5, 1.2)), float(rng.uniform(0.0, 360.0)))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        x, y, z = np.moveaxis(finger.body.points, -1, 0)
        s, a, free = (z - CLAMP) / (FINGER_LENGTH - CLAMP), np.deg2rad(self.azimuth_deg), FINGER_LENGTH - CLAMP
        mean = 1e-3 * self.curvature_per_m
        bend, angle = mean * (1 + np.cos(np.pi * s)), mean * free * (s + np.sin(np.pi * s) / np.pi)
        along = np.tile(np.eye(3), (*z.shape, 1, 1))
        along[..., 2, 2] = 1 - bend * (np.cos(a) * x + np.sin(a) * y)
        axis = np.array([-np.sin(a), np.cos(a), 0.0])
        turned = Rotation.from_rotvec(angle.ravel()[:, None] * axis).as_matrix().reshape(along.shape)
        finger.body.form(turned @ along)


@dataclass(frozen=True)
class StiffnessAsymmetry(Effect):
    """Stiffer in one bending plane or on one side: the modulus varies over the section.

    plane: E (1 + s (r/R)^2 cos 2 (azimuth - a)); side: E (1 + s r/R cos (azimuth - a)); azimuths in the finger's own frame.
    """

    id: ClassVar[str] = "stiffness_asymmetry"

    kind: str
    strength: float
    azimuth_deg: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> StiffnessAsymmetry:
        kind = str(rng.choice(["plane", "side"]))
        azimuth = rng.uniform(0.0, 180.0 if kind == "plane" else 360.0)
        return cls(kind, float(rng.uniform(0.25, 0.5)), float(azimuth))

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        x, y, z = np.moveaxis(finger.body.points, -1, 0)
        waves = {"plane": 2, "side": 1}[self.kind]
        turned = waves * (np.arctan2(y, x) - np.deg2rad(self.azimuth_deg))
        finger.body.scale(1 + self.strength * (np.hypot(x, y) / radius(z)) ** waves * np.cos(turned))


@dataclass(frozen=True)
class SoftSpot(Effect):
    """Out of catalogue: the silicone is soft around one point (a cavity): E (1 - depth exp(-|X - centre|^2 / 2 width^2))."""

    id: ClassVar[str] = "soft_spot"
    in_catalogue: ClassVar[bool] = False

    depth: float
    width_mm: float
    centre_mm: tuple[float, float, float]  # of the undeformed finger, in its own frame

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> SoftSpot:
        a, r, z = rng.uniform(0.0, 2 * np.pi), rng.uniform(4.0, 8.0), rng.uniform(25.0, 65.0)
        centre = (float(r * np.cos(a)), float(r * np.sin(a)), float(z))
        return cls(float(rng.uniform(0.6, 0.9)), float(rng.uniform(6.0, 9.0)), centre)

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        distance = ((finger.body.points - self.centre_mm) ** 2).sum(axis=-1)
        finger.body.scale(1 - self.depth * np.exp(-distance / 2 / self.width_mm**2))


@dataclass(frozen=True)
class Swelling(Effect):
    """Out of catalogue: the silicone takes up solvent and swells all day, alike everywhere.

    The unstressed volume goes with 1 + most (1 - exp(-t / time)).
    """

    id: ClassVar[str] = "swelling"
    in_catalogue: ClassVar[bool] = False

    most: float
    time_s: float

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> Swelling:
        return cls(float(rng.uniform(0.03, 0.06)), float(rng.uniform(200.0, 600.0)))

    def swell(self, clock: float) -> float:
        return 1 - self.most * float(np.expm1(-clock / self.time_s))
