"""The tension of each spring by its heating voltage.

A spring pulls harder along its lower branch (heating) and lets go along its upper one (cooling), some 25 K apart; between them heat
changes nothing. With T_low(s), T_up(s) the temperatures at which these branches pass through the wanted tension s at the spring's
elongation, e = s - s_measured and sat(x) = clip(x, -1, 1),

    T_goal = (T_low + T_up)/2 + (T_low - T_up)/2 sat(e/band) + PI(e) + u_RBF(s, s_measured - s, elongation)
    U^2/R  = h (T_goal - T_a) + c (T_goal - T)/tau

T by the described heat balance, or measured. PI and network take up what the description is wrong about: cooling, phase
temperatures, load cells' offset against the law. Heat goes in at 15 K/s and out at 3 K/s at most; a spring that has pulled needs
some ten seconds before it lets go, and no controller can change that but by asking early, or by pulling with the others.

Source: RBF compensation Peng et al. 2025 (Eqs 11-12); the inverse of the loop is that of a play operator (Kuhnen 2003), ours here.
"""

from __future__ import annotations

import numpy as np

from twin.control.guard import Guard, loop_temperatures
from twin.control.pi import PI
from twin.control.rbf import RBF
from twin.springs import Spring
from twin.springs.force import branches
from twin.springs.heat import loss

BAND = 0.06  # N: six times a load cell's noise, so that noise does not heat; at 0.02 N the tip jitters more than it gains
SETTLE = 0.4  # s, of the temperature
SMOOTH = 0.15  # s, of the measured tension


class TensionLoop:
    """The loops of n springs."""

    def __init__(self, guard: Guard, *, proportional: float = 20.0, integral: float = 8.0, learning: float = 25.0) -> None:
        """Gains in K/N, K/(N s), and the network's in K/(N s); `learning` 0 leaves the network out."""
        n = guard.n
        self.guard = guard
        self.law = PI(n, proportional, integral, -25.0, 25.0)
        self.network = RBF(n, 3, learning, 25.0)
        self.seen: np.ndarray | None = None
        self.stuck = np.zeros(n, bool)  # heated or cooled as fast as can be: what is missing then is time, nothing to be learned

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray:
        """Voltages (n,) V to hold for dt seconds towards tensions `target` (n,) N, from measured ones (n,) N, the springs'
        elongations (n,) m and, where there are thermometers, temperatures (n,) K."""
        g, s = self.guard, self.guard.spring
        self.seen = tension if self.seen is None else self.seen + min(1.0, dt / SMOOTH) * (tension - self.seen)
        g.observe(self.seen, elongation)
        now = g.temperature if temperature is None else np.asarray(temperature, float)
        error = target - self.seen
        low, up = loop_temperatures(s, target, elongation, g.ambient)
        share = np.clip(error / BAND, -1.0, 1.0)
        X = np.stack([target - 2.0, share, (elongation - s.initial_elongation) / 3e-3], axis=1)
        goal = 0.5 * (low + up) + 0.5 * (low - up) * share + self.law.step(error, dt, self.stuck)
        goal += self.network.step(X, np.where(self.stuck, 0.0, error), dt)
        records = s.records
        h = np.array([loss(records, t, max(goal[t] - g.ambient, 0.0), elongation[t], g.ambient) for t in range(g.n)])
        power = h * (goal - g.ambient) + s.capacity * (goal - now) / SETTLE
        given = g.allowed(np.sqrt(np.maximum(power, 0.0) * s.resistance), elongation, dt, temperature)
        self.stuck = np.where(error > 0.0, power * s.resistance > given**2 * 1.001, power < 0.0)
        return given


def passive(spring: Spring, elongation: np.ndarray, ambient: float) -> np.ndarray:
    """Tension (n,) N that springs which have once pulled keep at `ambient` K: the cold plateau at their elongation (n,) m.

    Less is held only by a spring that was stretched further since and let go again.
    """
    out, records = np.empty(len(elongation)), spring.records
    for t, e in enumerate(elongation):
        upper, slope, _, _ = branches(records, t, ambient)
        out[t] = max(0.0, min(upper + slope * e, spring.austenite_stiffness[t] * e))
    return out
