"""SMA springs that pull the tendons, in the units of their source: mm, gram-force, degC.

The laws are those of Kolyvas and Tzes, JIMSS 2018, doi 10.1177/1045389X18770880.

Heat: over a step of t seconds under the current I, with x (K) above ambient and h (W/K) as they are at its start,

    x+ = x_end + (x - x_end) exp(-h t / c),   x_end = R I^2 / h

Force: of the elongation e the largest and smallest forces allowed at a temperature are two broken lines; in between the spring
answers with 80 gf/mm from where it was.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

GF = 9.80665e-3  # N
HEAT_LOSS = (1.484, 0.04956, 0.4973, -0.000294, 0.01563, 0.2379)  # mW/K: 1, x, y, x^2, x y, y^2
FIRST_ELONGATION, FIRST_FORCE = 9.0, 0.7 / GF  # mm, gf
SLOPE_STEP = 1e-7  # mm, for a slope


@dataclass(frozen=True)
class Springs:
    """The laws' numbers, (3,) or scalars, and the springs' state after the last step; `stepped` and `rested` return the next."""

    resistance: float = 0.45
    capacity: float = 0.1155
    coils: float = 8.0
    phases: tuple[float, float, float, float] = (60.0, 43.0, 69.0, 83.0)  # Ms, Mf, As, Af, degC
    per_kelvin: float = 10.6  # gf/K
    slopes: tuple[float, float] = (50.0, 80.0)  # gf/mm
    plateau: tuple[float, float] = (110.0, 460.0)  # gf
    reach: float = 24.0  # mm
    draught: np.ndarray = field(default_factory=lambda: np.ones(3))  # on the heat loss
    temperature: np.ndarray = field(default_factory=lambda: np.zeros(3))  # degC
    elongation: np.ndarray = field(default_factory=lambda: np.full(3, FIRST_ELONGATION))
    force: np.ndarray = field(default_factory=lambda: np.full(3, FIRST_FORCE))

    def at(self, temperature: np.ndarray | float) -> Springs:
        return replace(self, temperature=np.broadcast_to(temperature, self.elongation.shape))

    def stepped(self, current: np.ndarray, ambient: float, seconds: float) -> Springs:
        """Heated for a while; elongation as it was at the start."""
        x, y = self.temperature - ambient, self.elongation / self.coils
        a, b, c, d, f, g = HEAT_LOSS
        h = 1e-3 * self.draught * (a + b * x + c * y + d * x * x + f * x * y + g * y * y)
        end = self.resistance * current**2 / h
        return replace(self, temperature=ambient + end + (x - end) * np.exp(-h * seconds / self.capacity))

    def rested(self, elongation: np.ndarray) -> Springs:
        """At rest at another elongation (mm)."""
        return replace(self, elongation=elongation, force=np.maximum(0.0, self.pull(elongation)))

    def pull(self, e: np.ndarray) -> np.ndarray:
        """Force (gf) at an elongation (mm) reached from the last rest at the present temperature; negative where slack."""
        ms, mf, as_, af = self.phases
        above, (austenite, martensite) = self.per_kelvin * self.temperature, self.slopes
        from_twinned = np.maximum(self.plateau[0], above - self.per_kelvin * ms)
        to_detwinned = np.maximum(self.plateau[1], above - self.per_kelvin * mf)
        most = np.minimum(austenite * e, self._line(from_twinned, to_detwinned, e))
        least = self._line(above - self.per_kelvin * af, above - self.per_kelvin * as_, e)
        inner = martensite * (e - self.elongation) + self.force
        return np.maximum(martensite * (e - self.reach), np.minimum(most, np.maximum(least, inner)))

    def _line(self, low: np.ndarray, high: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Through (low / 50, low) and (high / 80 + 24, high)."""
        e_low, e_high = low / self.slopes[0], high / self.slopes[1] + self.reach
        return low + (high - low) * (e - e_low) / (e_high - e_low)

    def tangent(self, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force (gf) and its slope (gf/mm)."""
        s = self.pull(e)
        return s, np.maximum((self.pull(e + SLOPE_STEP) - s) / SLOPE_STEP, 0.1)
