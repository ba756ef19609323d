"""Effects in the backbone: creep, rest curvature, uneven stiffness, softening by use or by temperature."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class BackboneAgeing(Effect):
    """The backbone tires over the session, compliance times 1 + 0.05 strength (clock / 1 h)."""

    id: ClassVar[str] = "backbone_ageing"
    most: ClassVar[float] = 10.0  # half as compliant again in an hour; more is no ageing

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray:
        return 1 + 0.05 * self.strength * clock / 3600.0


@dataclass(frozen=True)
class BackboneCreep(Effect):
    """Delayed strain of the backbone in bending and twist, with two retardation times, integrated in `march.py`.

    J(t) = C (1 + 0.08 strength sum_n split_n (1 - exp(-t / time_n))). The state lives on the common clock and relaxes in the gaps.
    """

    id: ClassVar[str] = "backbone_creep"

    split: tuple[float, float]
    time: tuple[float, float]  # s

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BackboneCreep:
        fast = rng.uniform(0.3, 0.7)
        return cls(
            1.0,
            (float(fast), 1.0 - float(fast)),
            (float(rng.uniform(3, 12)), float(np.exp(rng.uniform(np.log(30), np.log(200))))),
        )

    def mount(self, situation: Situation) -> None:
        situation.creep = (0.08 * self.strength * np.array(self.split), np.array(self.time))


@dataclass(frozen=True)
class BackbonePrecurvature(Effect):
    """The unloaded backbone is bent: curvature 0.5 strength (1/m) towards `angle`, varying linearly along the body by `slope`."""

    id: ClassVar[str] = "backbone_precurvature"

    angle: float  # rad
    slope: float  # relative difference tip minus base

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BackbonePrecurvature:
        return cls(1.0, float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(-0.6, 0.6)))

    def mount(self, situation: Situation) -> None:
        x = (np.arange(len(situation.rod.pitch)) + 0.5) / len(situation.rod.pitch)
        size = 0.5 * self.strength * (1 + self.slope * (x - 0.5))
        # A tip towards `angle` is a rotation about the axis 90 degrees further on.
        bend = size[:, None] * np.array([-np.sin(self.angle), np.cos(self.angle), 0.0])
        situation.rod = replace(situation.rod, precurvature=situation.rod.precurvature + bend)


@dataclass(frozen=True)
class StiffnessAsymmetry(Effect):
    """The backbone's two bending stiffnesses differ: ratio exp(0.1 strength), the soft direction at `angle`."""

    id: ClassVar[str] = "stiffness_asymmetry"
    most: ClassVar[float] = 6.0

    angle: float  # rad

    @classmethod
    def draw(cls, rng: np.random.Generator) -> StiffnessAsymmetry:
        return cls(1.0, float(rng.uniform(0, np.pi)))

    def mount(self, situation: Situation) -> None:
        situation.rod = replace(situation.rod, stiffness_asymmetry=float(np.exp(0.1 * self.strength)), asymmetry_angle=self.angle)


@dataclass(frozen=True)
class StiffnessGradient(Effect):
    """Bending and twisting stiffness changes linearly from base to tip, by 0.2 strength sign of the mean."""

    id: ClassVar[str] = "stiffness_gradient"
    most: ClassVar[float] = 7.0

    sign: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> StiffnessGradient:
        return cls(1.0, float(rng.choice([-1.0, 1.0])))

    def mount(self, situation: Situation) -> None:
        situation.rod = replace(situation.rod, stiffness_gradient=0.2 * self.strength * self.sign)


@dataclass(frozen=True)
class TemperatureSoftening(Effect):
    """Young's modulus falls with the room's temperature: E(T) = E(23 degC) (1 - 0.005 strength (T - 23))."""

    id: ClassVar[str] = "temperature_softening"
    needs_ambient: ClassVar[bool] = True
    most: ClassVar[float] = 10.0

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray:
        return 1 / (1 - 0.005 * self.strength * (ambient - 23.0))
