"""Control each spring's tension by its heating voltage.

A spring pulls harder along its lower branch (heating) and relaxes along its upper one (cooling), some 25 K apart; between them heat
changes nothing. With T_low(s), T_up(s) the temperatures at which these branches pass through the wanted tension s at the spring's
elongation, e = s - s_measured and sat(x) = clip(x, -1, 1),

    T_goal = (T_low + T_up)/2 + (T_low - T_up)/2 sat(e/band) + PI(e) + u_RBF(s, s_measured - s, elongation)
    U^2/R  = h (T_goal - T_a) + c (T_goal - T)/tau

T by the described heat balance, or measured. PI and network correct errors of the description: cooling, phase temperatures, load
cells' offset. A spring heats at 15 K/s and cools at 3 K/s at most; after pulling it takes some ten seconds to relax, which a
controller can only anticipate, or counter with the other springs.

Source: RBF compensation Peng et al. 2025 (Eqs 11-12); the inverse of the loop is that of a play operator (Kuhnen 2003), ours here.
"""

import numpy as np

from twin.body.drives.spring import Spring
from twin.control.heating_guard import HeatingGuard, branch_temperatures
from twin.control.pi_controller import PIController
from twin.control.rbf_network import RBFNetwork
from twin.mechanics.springs.force import hysteresis_branches
from twin.mechanics.springs.heat import heat_loss

LOOP_BAND = 0.06  # N: six times a load cell's noise, so that noise does not heat; 0.02 N only adds jitter
TEMPERATURE_TIME_CONSTANT = 0.4  # s
TENSION_SMOOTHING_TIME = 0.15  # s, of the measured tension


class TensionLoop:
    """The loops of n springs."""

    def __init__(self, guard: HeatingGuard, *, proportional: float = 20.0, integral: float = 8.0, learning: float = 25.0) -> None:
        """Gains in K/N, K/(N s), and the network's in K/(N s); `learning` 0 disables the network."""
        n = guard.n
        self.guard = guard
        self.controller = PIController(n, proportional, integral, -25.0, 25.0)
        self.network = RBFNetwork(n, 3, learning, 25.0)
        self.smoothed: np.ndarray | None = None
        self.saturated = np.zeros(n, bool)  # heats or cools at its limit: nothing to learn then

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray:
        """Return voltages (n,) V to hold for dt seconds, towards tensions `target` (n,) N.

        From measured tensions (n,) N, the springs' elongations (n,) m and, where there are thermometers, temperatures (n,) K.
        """
        g, s = self.guard, self.guard.spring
        self.smoothed = (
            tension if self.smoothed is None else self.smoothed + min(1.0, dt / TENSION_SMOOTHING_TIME) * (tension - self.smoothed)
        )
        g.bound_temperatures(self.smoothed, elongation)
        now = g.temperature if temperature is None else np.asarray(temperature, float)
        error = target - self.smoothed
        low, up = branch_temperatures(s, target, elongation, g.ambient)
        share = np.clip(error / LOOP_BAND, -1.0, 1.0)
        X = np.stack([target - 2.0, share, (elongation - s.initial_elongation) / 3e-3], axis=1)
        goal = 0.5 * (low + up) + 0.5 * (low - up) * share + self.controller.step(error, dt, self.saturated)
        goal += self.network.step(X, np.where(self.saturated, 0.0, error), dt)
        records = s.records
        h = np.array([heat_loss(records, t, max(goal[t] - g.ambient, 0.0), elongation[t], g.ambient) for t in range(g.n)])
        power = h * (goal - g.ambient) + s.capacity * (goal - now) / TEMPERATURE_TIME_CONSTANT
        voltages = g.limit_voltages(np.sqrt(np.maximum(power, 0.0) * s.resistance), elongation, dt, temperature)
        self.saturated = np.where(error > 0.0, power * s.resistance > voltages**2 * 1.001, power < 0.0)
        return voltages


def cold_tension(spring: Spring, elongation: np.ndarray, ambient: float) -> np.ndarray:
    """Return the tension (n,) N of springs that pulled before, at `ambient` K: the cold plateau at their elongation (n,) m.

    Only a spring that was stretched further since and released again holds less.
    """
    out, records = np.empty(len(elongation)), spring.records
    for t, e in enumerate(elongation):
        upper, slope, _, _ = hysteresis_branches(records, t, ambient)
        out[t] = max(0.0, min(upper + slope * e, spring.austenite_stiffness[t] * e))
    return out
