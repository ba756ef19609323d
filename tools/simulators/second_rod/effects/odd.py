"""Effects no catalogue has: a diagnosis should say that something is left, and not put a known name to it."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from tools.simulators.second_rod.day import STANDARD_GRAVITY, Day, Trial
from tools.simulators.second_rod.effects.effect import Array, Effect, Markers, floats, sign
from tools.simulators.second_rod.effects.tendon import BOTH
from tools.simulators.second_rod.loom import Loom as Sliders
from tools.simulators.second_rod.mechanics.fields import Jet
from tools.simulators.second_rod.mechanics.fields import Magnet as Repeller
from tools.simulators.second_rod.mechanics.rod import INTERVALS
from tools.simulators.second_rod.robot import ROD_LENGTH, Robot


@dataclass(frozen=True)
class Magnet(Effect):
    name = identifier = "magnet"
    known = False
    law = "a magnet at place (m) repels the tip with energy E core^6 / (r^2 + core^2)^3, E in J, core in m"
    size, largest, drives = ("energy",), 6e-3, BOTH

    energy: float
    place: tuple[float, ...]
    core: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        angle = random.uniform(0, 2 * np.pi)
        place = (float(0.05 * np.cos(angle)), float(0.05 * np.sin(angle)), random.uniform(0.085, 0.105))
        return cls(1e-3, place, random.uniform(0.022, 0.03))

    def built(self, robot: Robot, share: float) -> Robot:
        return replace(robot, magnet=Repeller(np.array(self.place), self.energy, self.core))


@dataclass(frozen=True)
class Air(Effect):
    name = identifier = "air"
    known = False
    law = (
        "a jet through (0, 0, height) along direction, Gaussian of width (m): each disk feels drag (N, face on, on the axis) that "
        "falls to the share edge_on as it turns, half of it along its own normal"
    )
    size, largest, drives = ("drag",), 0.03, BOTH

    drag: float
    height: float
    direction: tuple[float, ...]
    width: float
    edge_on: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        angle = random.uniform(0, 2 * np.pi)
        direction = np.array([np.cos(angle), np.sin(angle), random.uniform(-0.2, 0.2)])
        return cls(
            6e-3, random.uniform(0.07, 0.11), floats(direction / np.linalg.norm(direction)), random.uniform(0.03, 0.05),
            random.uniform(0.25, 0.45),
        )  # fmt: skip

    def built(self, robot: Robot, share: float) -> Robot:
        origin = np.array([0, 0, self.height])
        return replace(robot, jet=Jet(origin, np.array(self.direction), self.drag, self.width, self.edge_on))


@dataclass(frozen=True)
class LooseDisk(Effect):
    name = identifier = "loose_disk"
    known = False
    law = "a disk (from 1) with its holes, mass and marker slides along the backbone by shift (m) times (share of the day)^power"
    size, largest, drives, wants = ("shift",), 9.5e-3, BOTH, frozenset({"every marker"})

    disk: int
    shift: float
    power: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(int(random.integers(3, INTERVALS - 1)), 5e-3 * sign(random), random.uniform(0.6, 1.4))

    def built(self, robot: Robot, share: float) -> Robot:
        positions = robot.disk_positions.copy()
        positions[self.disk - 1] += self.shift * share**self.power
        return replace(robot, disk_positions=positions)


@dataclass(frozen=True)
class Loom(Effect):
    name = identifier = "loom"
    known = False
    law = "a cable loom at the tip: three elastic-plastic sliders, stiffnesses (N/m) and limits (N) times scale, and a mass (kg)"
    size, largest, drives, remembers, between_rows = ("scale",), 6.0, BOTH, True, 5

    scale: float
    stiffnesses: tuple[float, ...]
    limits: tuple[float, ...]
    mass: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(1.0, floats(np.array([0.9, 0.5, 0.25]) * random.uniform(0.8, 1.25, 3)), (0.004, 0.008, 0.02), 0.4e-3)

    def built(self, robot: Robot, share: float) -> Robot:
        sliders = Sliders(self.scale * np.array(self.stiffnesses), self.scale * np.array(self.limits), self.mass)
        return replace(robot, loom=sliders)


@dataclass(frozen=True)
class Stalks(Effect):
    name = identifier = "stalks"
    known = False
    law = "markers on soft stalks, each off by sags_k (m) times gravity's part across its disk's axis over g, with a delay (s)"
    size, largest, drives, stage = ("sags",), 7e-3, BOTH, 0

    sags: tuple[float, ...]
    delay: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(floats(1.5e-3 * random.uniform(0.6, 1.4, INTERVALS)), random.uniform(0.4, 1.2))

    def seen(self, markers: Markers, trial: Trial, day: Day) -> Array:
        across = markers.gravity - (markers.axes @ markers.gravity)[:, :, None] * markers.axes
        reached = np.array(self.sags)[:, None] * across / STANDARD_GRAVITY
        offset = reached.copy()
        for row, step in enumerate(np.diff(trial.times), 1):
            offset[row] = reached[row] + (offset[row - 1] - reached[row]) * np.exp(-step / self.delay)
        return markers.positions + offset


RINGING_STEP = 5e-3  # s, of the oscillator's integration
LARGEST_ACCELERATION = 2.0  # m/s^2: rows are too far apart to tell more
PUMP = 0.6e-3  # m at the tip


@njit(cache=True)
def ringing(acceleration, frequency, damping, step):
    """y'' + 2 damping w y' + w^2 y = -acceleration (n, 2), from rest, symplectic Euler: (n, 2) m."""
    out, place, speed, rate = np.empty_like(acceleration), np.zeros(2), np.zeros(2), 2 * np.pi * frequency
    for row in range(acceleration.shape[0]):
        for axis in range(2):
            force = -acceleration[row, axis] - rate**2 * place[axis] - 2 * damping * rate * speed[axis]
            speed[axis] += step * force
            place[axis] += step * speed[axis]
            out[row, axis] = place[axis]
    return out


@dataclass(frozen=True)
class Vibration(Effect):
    name = identifier = "vibration"
    known = False
    law = (
        "scale times (s / L)^2 times the answer of a mode (frequency in Hz, damping) to the tip's motion, and a pump's tone (Hz) "
        "of 0.6 mm towards azimuth angle that comes and goes"
    )
    size, largest, drives, remembers, stage = ("scale",), 8.0, BOTH, True, 1

    scale: float
    frequency: float
    damping: float
    tone: float
    angle: float
    seed: int

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(
            1.0, random.uniform(2.4, 3.4), random.uniform(0.02, 0.05), random.uniform(2.1, 4.4), random.uniform(0, 2 * np.pi),
            int(random.integers(1_000_000)),
        )  # fmt: skip

    def seen(self, markers: Markers, trial: Trial, day: Day) -> Array:
        random = np.random.default_rng([self.seed, markers.number])
        fine = np.arange(0, trial.times[-1] + RINGING_STEP, RINGING_STEP)
        acceleration = CubicSpline(trial.times, markers.positions[:, -1, :2])(fine, 2)
        acceleration = np.clip(acceleration, -LARGEST_ACCELERATION, LARGEST_ACCELERATION)
        moved = ringing(np.ascontiguousarray(acceleration), self.frequency, self.damping, RINGING_STEP)
        period, phases = random.uniform(15, 40), random.uniform(0, 2 * np.pi, 2)
        strength = np.clip(0.5 + 0.8 * np.sin(2 * np.pi * fine / period + phases[0]), 0, 1)
        tone = strength * np.sin(2 * np.pi * self.tone * fine + phases[1])
        moved = moved + PUMP * np.outer(tone, [np.cos(self.angle), np.sin(self.angle)])
        mode = (day.robot.disk_positions / ROD_LENGTH) ** 2
        out = markers.positions.copy()
        out[:, :, :2] += self.scale * mode[None, :, None] * CubicSpline(fine, moved)(trial.times)[:, None, :]
        return out
