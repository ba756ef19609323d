"""Effects in the load cells: the tension logged is not the tension."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from tools.simulators.second_rod.day import Day
from tools.simulators.second_rod.effects.effect import Array, Effect, any_three, floats
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS


@dataclass(frozen=True)
class Crosstalk(Effect):
    name, identifier = "crosstalk", "load_cell_crosstalk"
    law = "logged_i = T_i + sum_j shares_ij T_j, nothing on the diagonal"
    size, largest, stage = ("shares",), 0.3, 0

    shares: tuple[tuple[float, ...], ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(tuple(floats(row) for row in random.uniform(0, 0.06, (ROD_TENDONS, ROD_TENDONS)) * (1 - np.eye(ROD_TENDONS))))

    def read(self, tension: Array, share: Array) -> Array:
        return tension + tension @ np.array(self.shares).T


@dataclass(frozen=True)
class Gain(Effect):
    name, identifier = "gain", "load_cell_gain"
    law = "logged_i = (1 + errors_i) T_i"
    size, largest, stage = ("errors",), 0.3, 1

    errors: tuple[float, ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(floats(0.05 * any_three(random)))

    def read(self, tension: Array, share: Array) -> Array:
        return tension * (1 + np.array(self.errors))


@dataclass(frozen=True)
class Bias(Effect):
    name, identifier = "bias", "load_cell_bias"
    law = "logged_i = T_i + biases_i, N"
    size, largest, stage, wants = ("biases",), 0.19, 2, frozenset({"pretension"})

    biases: tuple[float, ...]

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(floats(0.06 * any_three(random)))

    def read(self, tension: Array, share: Array) -> Array:
        return tension + np.array(self.biases)


@dataclass(frozen=True)
class Drift(Effect):
    name, identifier = "drift", "load_cell_drift"
    law = "logged_i = T_i + biases_i ((1 - steady) (1 - exp(-x / delay)) + steady x), x the share of the day that has passed; N"
    size, largest, stage, wants = ("biases",), 0.19, 3, frozenset({"pretension", "repeats over hours"})

    biases: tuple[float, ...]
    delay: float
    steady: float

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        return cls(floats(0.1 * any_three(random)), random.uniform(0.25, 0.6), random.uniform(0.2, 0.5))

    def read(self, tension: Array, share: Array) -> Array:
        grown = (1 - self.steady) * (1 - np.exp(-share / self.delay)) + self.steady * share
        return tension + np.outer(grown, self.biases)
