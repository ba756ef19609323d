"""Noise of the bench's instruments, and markers hidden from the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Noise:
    """Standard deviations; `colour` is the AR(1) coefficient from row to row, `tails` Student-t degrees of freedom."""

    load_cell: float = 0.01  # N
    marker: float = 0.25e-3  # m per coordinate
    displacement: float = 0.02e-3  # m
    ambient: float = 0.1  # K
    current: float = 3e-3  # A
    spring: float = 0.5  # K, of a spring's temperature
    colour: float = 0.0  # of the markers
    tails: float = np.inf  # of the markers
    hidden: float = 0.005  # share of markers that are missing

    @classmethod
    def draw(cls, rng: np.random.Generator, coloured: bool) -> Noise:
        load_cell = float(np.exp(rng.uniform(np.log(0.004), np.log(0.03))))
        return cls(load_cell=load_cell, colour=0.4 if coloured else 0.0, tails=5.0 if coloured else np.inf)

    def of_markers(self, rng: np.random.Generator, markers: np.ndarray) -> np.ndarray:
        """Markers (n, N, 3) as the camera logs them; a hidden marker is NaN in all three coordinates."""
        white = rng.normal(size=markers.shape)
        if np.isfinite(self.tails):
            white = rng.standard_t(self.tails, size=markers.shape) * np.sqrt((self.tails - 2) / self.tails)
        error = white.copy()
        for n in range(1, len(error)):
            error[n] = self.colour * error[n - 1] + np.sqrt(1 - self.colour**2) * white[n]
        logged = markers + self.marker * error
        logged[rng.random(markers.shape[:2]) < self.hidden] = np.nan
        return logged
