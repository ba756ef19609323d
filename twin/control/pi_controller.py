"""PI control with limits and without integral windup.

    u = clip(k_p e + v, low, high),   dv/dt = k_i e   but while u is at a limit and e drives it further there

Conditional integration: Astrom and Hagglund, PID Controllers, 1995, section 3.5.
"""

import numpy as np


class PIController:
    """One PI controller for each of n signals."""

    def __init__(self, n: int, proportional: float, integral: float, low: float, high: float) -> None:
        self.proportional, self.integral, self.low, self.high = proportional, integral, low, high
        self.integral_sum = np.zeros(n)

    def step(self, error: np.ndarray, dt: float, at_limit: np.ndarray | bool = False) -> np.ndarray:
        """Return the output (n,) for errors (n,) that hold for dt seconds. `at_limit` (n,): the actuator is at its limit."""
        integral = self.integral_sum + self.integral * error * dt
        wanted = self.proportional * error + integral
        saturated = at_limit | ((wanted > self.high) & (error > 0.0)) | ((wanted < self.low) & (error < 0.0))
        self.integral_sum = np.where(saturated, self.integral_sum, np.clip(integral, self.low, self.high))
        return np.clip(wanted, self.low, self.high)
