"""Effects around the robot: a tilted base, a weight, an obstacle, a camera that looks from elsewhere."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from tools.simulators.second_rod.day import STANDARD_GRAVITY, Day, Trial
from tools.simulators.second_rod.effects.effect import Array, Effect, Markers, any_three, floats, rotation, sign
from tools.simulators.second_rod.effects.tendon import BOTH
from tools.simulators.second_rod.mechanics.contact import POST_OBSTACLE, WALL_OBSTACLE, obstacle
from tools.simulators.second_rod.robot import Robot

WALL_HEIGHT = 0.06  # m: where a wall's distance is told, half way up the robot


@dataclass(frozen=True)
class Tilt(Effect):
    name, identifier = "tilt", "base_tilt"
    law = "gravity is the declared one turned by degrees about axis, a unit vector of the base frame"
    size, largest, wants = ("degrees",), 11.0, frozenset({"weights"})

    degrees: float
    axis: tuple[float, ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        """About an axis across the declared gravity: about gravity itself nothing would turn."""
        down = day.gravities[day.mount] / STANDARD_GRAVITY
        axis = np.cross(down, random.normal(size=3))
        return cls(3.0, floats(axis / np.linalg.norm(axis)))

    def gravity(self, gravity: Array) -> Array:
        return rotation(np.deg2rad(self.degrees) * np.array(self.axis)) @ gravity


@dataclass(frozen=True)
class Payload(Effect):
    name, identifier = "payload", "tip_payload"
    law = "a point mass (kg) at lever (m) beyond the tip disk's centre along its axis, in every trial, besides what is declared"
    size, largest, drives, wants = ("mass",), 0.015, BOTH, frozenset({"weights"})

    mass: float
    lever: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(3e-3, random.uniform(3e-3, 8e-3))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, outboard=(self.mass, self.lever))


@dataclass(frozen=True)
class Wall(Effect):
    name, identifier = "wall", "contact"
    law = "a frictionless plane at distance (m) from the straight robot at z = 60 mm, at azimuth angle, leaning (rad)"
    size, largest, drives = ("nearness",), 1.0, BOTH

    nearness: float
    angle: float
    lean: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.4, random.uniform(0, 2 * np.pi), np.deg2rad(random.uniform(-14, 14)))

    @property
    def distance(self) -> float:
        return 0.03 + 0.05 * (1 - self.nearness)

    def parameters(self) -> dict[str, Any]:
        return {"distance": self.distance, "angle": self.angle, "lean": self.lean}

    def built(self, robot: Robot, share: float) -> Robot:
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        point = np.array([self.distance * cos, self.distance * sin, WALL_HEIGHT])
        normal = -np.array([cos * np.cos(self.lean), sin * np.cos(self.lean), np.sin(self.lean)])
        return replace(robot, obstacle=obstacle(WALL_OBSTACLE, point, normal))


@dataclass(frozen=True)
class Post(Effect):
    name, identifier = "post", "contact"
    law = (
        "a frictionless round post of radius (m) across the robot's way, its axis through the point at azimuth angle, distance and "
        "height (m), slanted (rad) from the horizontal"
    )
    size, largest, drives = ("nearness",), 1.0, BOTH

    nearness: float
    angle: float
    height: float
    slant: float
    radius: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        angle, height = random.uniform(0, 2 * np.pi), random.uniform(0.065, 0.09)
        return cls(0.5, angle, height, np.deg2rad(random.uniform(15, 35)) * sign(random), random.uniform(5e-3, 8e-3))

    @property
    def distance(self) -> float:
        """At its nearest the rims of the straight robot pass 3 mm away."""
        return self.radius + 0.012 + 0.035 * (1 - self.nearness)

    def parameters(self) -> dict[str, Any]:
        return {
            "distance": self.distance, "angle": self.angle, "height": self.height, "slant": self.slant, "radius": self.radius
        }  # fmt: skip

    def built(self, robot: Robot, share: float) -> Robot:
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        point = np.array([self.distance * cos, self.distance * sin, self.height])
        along = np.array([-sin * np.cos(self.slant), cos * np.cos(self.slant), np.sin(self.slant)])
        return replace(robot, obstacle=obstacle(POST_OBSTACLE, point, along, self.radius))


@dataclass(frozen=True)
class Camera(Effect):
    name, identifier = "camera", "camera_misalignment"
    law = "seen = R(turn) position + shift, turn a rotation vector in rad about the base's origin, shift in m"
    size, largest, drives, stage = ("turn", "shift"), 0.1, BOTH, 9

    turn: tuple[float, ...]
    shift: tuple[float, ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(floats(np.deg2rad(0.8) * any_three(random)), floats(1e-3 * any_three(random)))

    def seen(self, markers: Markers, trial: Trial, day: Day) -> Array:
        return markers.positions @ rotation(np.array(self.turn)).T + np.array(self.shift)
