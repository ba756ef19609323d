"""The four cords as resistors and what built fingers differ in; ohm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Built:
    """One finger as made: its own parameters, none of them an effect."""

    E_kPa: float
    nu: float
    R0_ohm: list[float]
    kappa_stretch: list[float]
    kappa_compression: list[float]
    phi_deg: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Built:
        """Within the tolerances of the description: E +-15 %, R0 1 kohm +-20 %, kappa 0.7 .. 1.3, mounting within 8 degrees."""
        return cls(
            float(125.0 * rng.uniform(0.85, 1.15)),
            0.49,
            [float(r) for r in rng.uniform(800.0, 1200.0, 4)],
            [float(k) for k in rng.uniform(0.7, 1.3, 4)],
            [float(k) for k in rng.uniform(0.7, 1.3, 4)],
            float(np.clip(rng.normal(0.0, 3.0), -8.0, 8.0)),
        )

    def resistance(self, strain: np.ndarray) -> np.ndarray:
        """R0 (1 + kappa strain)^2 (n, 4) of an incompressible conductor, kappa by the strain's sign."""
        kappa = np.where(strain > 0, self.kappa_stretch, self.kappa_compression)
        return np.array(self.R0_ohm) * (1 + kappa * strain) ** 2

    def turn(self) -> np.ndarray:
        """Rotation (3, 3) from the finger's own frame to the base frame."""
        c, s = np.cos(np.deg2rad(self.phi_deg)), np.sin(np.deg2rad(self.phi_deg))
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
