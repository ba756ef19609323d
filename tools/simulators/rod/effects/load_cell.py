"""Effects of the load cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, unit_vector


@dataclass(frozen=True)
class LoadCellBias(Effect):
    """Each load cell is off by a constant: y_i = T_i + 0.03 N strength share_i."""

    id: ClassVar[str] = "load_cell_bias"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellBias:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return tension + 0.03 * self.strength * np.array(self.share)


@dataclass(frozen=True)
class LoadCellCrosstalk(Effect):
    """A load cell also feels its neighbours: y_i = T_i + 0.03 strength sum_j share_ij T_j, j other than i."""

    id: ClassVar[str] = "load_cell_crosstalk"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]  # (12, 13, 21, 23, 31, 32)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellCrosstalk:
        return cls(1.0, tuple(unit_vector(rng, 6) * np.sqrt(6)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        mix = np.zeros((3, 3))
        mix[~np.eye(3, dtype=bool)] = self.share
        return tension @ (np.eye(3) + 0.03 * self.strength * mix).T


@dataclass(frozen=True)
class LoadCellDrift(Effect):
    """The zero of each load cell wanders with the common clock: y_i = T_i + 0.05 N strength share_i (x + bend x^2), x = clock / 1
    h."""

    id: ClassVar[str] = "load_cell_drift"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]
    bend: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellDrift:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)), float(rng.uniform(-0.25, 0.25)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        hours = clock[:, None] / 3600.0
        return tension + 0.05 * self.strength * np.array(self.share) * (hours + self.bend * hours**2)


@dataclass(frozen=True)
class LoadCellGain(Effect):
    """Each load cell reads its tension with its own factor: y_i = (1 + 0.03 strength share_i) T_i."""

    id: ClassVar[str] = "load_cell_gain"
    seen_by_length: ClassVar[str] = "tension"

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LoadCellGain:
        return cls(1.0, tuple(unit_vector(rng) * np.sqrt(3)))

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return tension * (1 + 0.03 * self.strength * np.array(self.share))
