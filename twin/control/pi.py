"""A PI law whose integral does not wind up, and the tension loop that is nothing else: the baseline of `tension`.

    u = clip(k_p e + v, low, high),   dv/dt = k_i e   but while u is at a limit and e drives it further there

Conditional integration: Astrom and Hagglund, PID Controllers, 1995, section 3.5.
"""

from __future__ import annotations

import numpy as np

from twin.control.guard import Guard


class PI:
    """One law for each of n signals."""

    def __init__(self, n: int, proportional: float, integral: float, low: float, high: float) -> None:
        self.proportional, self.integral, self.low, self.high = proportional, integral, low, high
        self.sum = np.zeros(n)

    def step(self, error: np.ndarray, dt: float, at_limit: np.ndarray | bool = False) -> np.ndarray:
        """The output (n,) for errors (n,) that hold for dt seconds; `at_limit` (n,): what follows the law cannot do more."""
        grown = self.sum + self.integral * error * dt
        wanted = self.proportional * error + grown
        further = at_limit | ((wanted > self.high) & (error > 0.0)) | ((wanted < self.low) & (error < 0.0))
        self.sum = np.where(further, self.sum, np.clip(grown, self.low, self.high))
        return np.clip(wanted, self.low, self.high)


class PlainLoop:
    """Tension error to voltage by PI alone, within the guard's limits."""

    def __init__(self, guard: Guard, proportional: float = 16.0, integral: float = 0.05) -> None:
        """Gains in V/N and V/(N s): the best of 1-40 and 0.05-0.8 on the circle of `tools.tracking` without a load."""
        self.guard = guard
        self.law = PI(guard.n, proportional, integral, 0.0, guard.supply)

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray:
        """Voltages (n,) V to hold for dt seconds. Arguments as of `TensionLoop.step`."""
        self.guard.observe(tension, elongation)
        return self.guard.allowed(self.law.step(target - tension, dt), elongation, dt, temperature)
