"""Effects in the backbone: creep, precurvature, uneven stiffness, softening by temperature or use."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from tools.simulators.second_rod.day import REFERENCE, Day
from tools.simulators.second_rod.effects.effect import Array, Backbone, Effect, sign
from tools.simulators.second_rod.mechanics.rod import Rod
from tools.simulators.second_rod.robot import Robot


class Creeping(Backbone):
    """Two Kelvin-Voigt elements in series with the elastic bending; twist does not creep."""

    def __init__(self, compliances: Array, delays: Array, size: int) -> None:
        self.compliances, self.delays = compliances, delays  # (2,), (2,) s
        self.strains = np.zeros((2, size))  # rad

    def rest(self) -> Array:
        return self.strains.sum(0)

    def wait(self, seconds: float) -> None:
        self.strains *= np.exp(-seconds / self.delays)[:, None]

    def spend(self, seconds: float, elastic: Array, moved: Array) -> None:
        bent = elastic.copy()
        bent[2 * bent.size // 3 :] = 0
        reached = 1 - np.exp(-seconds / self.delays)[:, None]
        self.strains += (self.compliances[:, None] * bent - self.strains) * reached


@dataclass(frozen=True)
class Creep(Effect):
    name, identifier = "creep", "backbone_creep"
    law = (
        "two Kelvin-Voigt elements in series with bending: delay_k d(curvature_k)/dt = J_k elastic curvature - curvature_k, "
        "J_1 = split J, J_2 = (1 - split) J, delays in s"
    )
    size, largest, remembers = ("compliance",), 0.5, True

    compliance: float
    split: float
    delays: tuple[float, float]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.08, random.uniform(0.35, 0.65), (random.uniform(30, 80), random.uniform(300, 800)))

    def backbone(self, rod: Rod, day: Day) -> Backbone:
        compliances = self.compliance * np.array([self.split, 1 - self.split])
        return Creeping(compliances, np.array(self.delays), 3 * rod.basis.shape[1])


class Bent(Backbone):
    """A rest shape that stays."""

    def __init__(self, coefficients: Array) -> None:
        self.coefficients = coefficients

    def rest(self) -> Array:
        return self.coefficients


@dataclass(frozen=True)
class Precurvature(Effect):
    name, identifier = "precurvature", "backbone_precurvature"
    law = "rest curvature (1/m) times 1 + slope (2 s / L - 1), bent towards azimuth angle (rad)"
    size, largest = ("curvature",), 6.0

    curvature: float
    angle: float
    slope: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(1.0, random.uniform(0, 2 * np.pi), random.uniform(-0.4, 0.4))

    def backbone(self, rod: Rod, day: Day) -> Backbone:
        coefficients = np.zeros((3, rod.basis.shape[1]))
        along = self.curvature * rod.length * np.array([1.0, self.slope])
        coefficients[0, :2] = -np.sin(self.angle) * along
        coefficients[1, :2] = np.cos(self.angle) * along
        return Bent(coefficients.ravel())


@dataclass(frozen=True)
class Asymmetry(Effect):
    name, identifier = "asymmetry", "stiffness_asymmetry"
    law = "bending stiffness E I (1 + share) about the material axis at angle (rad) from x, E I (1 - share) about the one across"
    size, largest = ("share",), 0.4

    share: float
    angle: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.06, random.uniform(0, np.pi))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, asymmetry=(self.share, self.angle))


@dataclass(frozen=True)
class Gradient(Effect):
    name, identifier = "gradient", "stiffness_gradient"
    law = "all stiffnesses times 1 + share tanh((s / L - middle) / width)"
    size, largest = ("share",), 0.5

    share: float
    middle: float
    width: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.1 * sign(random), random.uniform(0.35, 0.65), random.uniform(0.2, 0.35))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, stiffness_profile=lambda along: 1 + self.share * np.tanh((along - self.middle) / self.width))


class Softened(Backbone):
    def __init__(self, law: TemperatureSoftening, day: Day) -> None:
        self.law, self.day = law, day

    def stiffness(self, clock: float) -> float:
        above = float(self.day.temperature(np.array([clock]))[0]) - REFERENCE
        return 1 - self.law.per_kelvin * above * (1 + self.law.curved * above)


@dataclass(frozen=True)
class TemperatureSoftening(Effect):
    name, identifier = "temperature", "temperature_softening"
    law = "all stiffnesses times 1 - per_kelvin T (1 + curved T), T in K above 23 degC, per_kelvin and curved in 1/K"
    size, largest = ("per_kelvin",), 0.03
    wants = frozenset({"ambient temperature", "repeats over hours"})

    per_kelvin: float
    curved: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.006, random.uniform(0, 0.03))

    def backbone(self, rod: Rod, day: Day) -> Backbone:
        return Softened(self, day)


class Worn(Backbone):
    """Softer with all the bending it has done; the mean curvature's way in the plane counts."""

    def __init__(self, law: Ageing) -> None:
        self.law, self.way = law, 0.0  # rad

    def stiffness(self, clock: float) -> float:
        return 1 - self.law.share * (1 - np.exp(-self.way / self.law.used))

    def spend(self, seconds: float, elastic: Array, moved: Array) -> None:
        functions = moved.size // 3
        self.way += float(np.hypot(moved[0], moved[functions]))


@dataclass(frozen=True)
class Ageing(Effect):
    name, identifier = "ageing", "backbone_ageing"
    law = "all stiffnesses times 1 - share (1 - exp(-w / used)), w the way of the total bend angle since the day began, used in rad"
    size, largest, remembers = ("share",), 0.4, True
    wants = frozenset({"repeats over hours"})

    share: float
    used: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.1, random.uniform(25, 50))

    def backbone(self, rod: Rod, day: Day) -> Backbone:
        return Worn(self)
