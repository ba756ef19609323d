"""Effects between a command and what reaches the tendon or the log: lag, delay, saturation, backlash, an eccentric drum."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from scipy.linalg import expm

from tools.simulators.second_rod.day import Day
from tools.simulators.second_rod.effects.effect import Array, Effect, floats
from tools.simulators.second_rod.effects.tendon import BOTH
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS


@dataclass(frozen=True)
class Saturation(Effect):
    name, identifier = "saturation", "actuator_saturation"
    law = "delivered = x / (1 + (x / limit)^sharpness)^(1 / sharpness) for x > 0, limit = (1 - share) of the largest command"
    size, largest, drives, stage = ("share",), 0.75, BOTH, 0

    share: float
    sharpness: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.25, random.uniform(6, 10))

    def delivered(self, command: Array, step: float, day: Day) -> Array:
        ratio = np.maximum(command, 0) / ((1 - self.share) * day.largest_command)
        return np.where(command > 0, command / (1 + ratio**self.sharpness) ** (1 / self.sharpness), command)


@njit(cache=True)
def lagging(command, carry):
    """(n, ROD_TENDONS) a linear system's answer, exact for a command that is constant over each step.

    carry (order, order): what one step makes of (place less command, speed).
    """
    out, order = np.empty_like(command), carry.shape[0]
    for tendon in range(command.shape[1]):
        state, after = np.zeros(order), np.zeros(order)
        place = command[0, tendon]
        for row in range(command.shape[0]):
            state[0] = place - command[row, tendon]
            for i in range(order):
                after[i] = 0.0
                for j in range(order):
                    after[i] += carry[i, j] * state[j]
            state[:] = after
            place = command[row, tendon] + state[0]
            out[row, tendon] = place
    return out


@dataclass(frozen=True)
class Lag(Effect):
    name, identifier = "lag", "actuator_lag"
    law = "delivered = command / (delay p + 1), or / (delay^2 p^2 + 2 damping delay p + 1) for order 2; delay in s"
    size, largest, drives, stage = ("delay",), 1.2, BOTH, 1

    order: int
    delay: float
    damping: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(int(random.integers(1, 3)), 0.25, random.uniform(0.6, 0.9))

    def delivered(self, command: Array, step: float, day: Day) -> Array:
        """A trial starts with the drive at rest at its first command."""
        rate = 1 / self.delay
        system = np.array([[-rate]]) if self.order == 1 else np.array([[0.0, 1.0], [-(rate**2), -2 * self.damping * rate]])
        out = lagging(command, np.asarray(expm(system * step)))
        return out if day.by_displacement else np.maximum(out, 0)


@njit(cache=True)
def play(command, width):
    """A play operator of a width, m, centred when the trial begins: (n, ROD_TENDONS)."""
    out = np.empty_like(command)
    for tendon in range(command.shape[1]):
        at = 0.0
        for row in range(command.shape[0]):
            at = max(min(command[row, tendon] + width / 2, at), command[row, tendon] - width / 2)
            out[row, tendon] = at
    return out


@dataclass(frozen=True)
class Backlash(Effect):
    name, identifier = "backlash", "tendon_backlash"
    law = "delivered = mean of three play operators of widths width (1 - spread), width, width (1 + spread), in m, centred at first"
    size, largest, drives, stage = ("width",), 3e-3, frozenset({"displacement"}), 2

    width: float
    spread: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.5e-3, random.uniform(0.25, 0.45))

    def delivered(self, command: Array, step: float, day: Day) -> Array:
        return np.mean([play(command, self.width * (1 + k * self.spread)) for k in (-1, 0, 1)], axis=0)


@dataclass(frozen=True)
class Drum(Effect):
    name, identifier = "drum", "transmission_error"
    law = "delivered = d + error (sin(d / radius + phase) - sin(phase)), error and radius in m, phases in rad"
    size, largest, drives, stage = ("error",), 1.2e-3, frozenset({"displacement"}), 3

    error: float
    radius: float
    phases: tuple[float, ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.3e-3, random.uniform(5e-3, 8e-3), floats(random.uniform(0, 2 * np.pi, ROD_TENDONS)))

    def delivered(self, command: Array, step: float, day: Day) -> Array:
        phases = np.array(self.phases)
        return command + self.error * (np.sin(command / self.radius + phases) - np.sin(phases))


@dataclass(frozen=True)
class Delay(Effect):
    name, identifier = "delay", "time_delay"
    law = "what is logged of the markers at t is the robot at t - delay, delay in s"
    size, largest, drives = ("delay",), 0.9, BOTH

    delay: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(0.15)

    def clock(self, times: Array) -> Array:
        return np.maximum(times - self.delay, 0)
