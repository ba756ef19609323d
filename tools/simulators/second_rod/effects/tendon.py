"""Effects in the tendons: friction in the holes, holes elsewhere, stretch."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from tools.simulators.second_rod.day import Day, Drive
from tools.simulators.second_rod.effects.effect import Effect, sign
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS
from tools.simulators.second_rod.robot import Robot

BOTH: frozenset[Drive] = frozenset({"tension", "displacement"})


@dataclass(frozen=True)
class Friction(Effect):
    name, identifier = "friction", "tendon_friction"
    law = (
        "capstan at the base hole and each disk's hole but the last: T_next = T exp(-mu (theta + least_wrap) z), "
        "dz/dx = (sign(dx) - z) / sliding_length in the travel through the hole; least_wrap in rad, sliding_length in m"
    )
    size, largest, remembers, between_rows = ("mu",), 0.35, True, 5

    mu: float
    least_wrap: float
    sliding_length: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.1, random.uniform(0.005, 0.015), random.uniform(2e-5, 6e-5))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, friction=self.mu, least_wrap=self.least_wrap, sliding_length=self.sliding_length)


@dataclass(frozen=True)
class Routing(Effect):
    name, identifier = "routing", "tendon_routing"
    law = "all holes of one tendon (from 1) turned about the backbone by degrees"
    size, largest, drives = ("degrees",), 25.0, BOTH

    tendon: int
    degrees: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(int(random.integers(1, ROD_TENDONS + 1)), 4.0 * sign(random))

    def built(self, robot: Robot, share: float) -> Robot:
        angles = robot.hole_angles.copy()
        angles[self.tendon - 1] += np.deg2rad(self.degrees)
        return replace(robot, hole_angles=angles)


@dataclass(frozen=True)
class Elasticity(Effect):
    name, identifier = "elasticity", "tendon_elasticity"
    law = "T = stretch (1 + stiffening stretch) / (compliance + the drive's own), compliance in m/N, stiffening in 1/m"
    size, largest, drives = ("compliance",), 0.8e-3, frozenset({"displacement"})

    compliance: float
    stiffening: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.15e-3, random.uniform(100, 300))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, compliance=robot.compliance + self.compliance, stiffening=self.stiffening)
