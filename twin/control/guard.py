"""What no spring may exceed: the supply's voltage, and a temperature above which NiTi loses its memory.

The voltage is cut so that by the spring's heat balance the temperature ends the step at most at the ceiling:

    U^2 / R <= h (T_max - T_a - keep x) / (1 - keep),   keep = exp(-h dt/c),   x = T - T_a          (twin.springs.heat)

Without a thermometer T is the guard's own heat model, whose loss is taken LESS than described: still air around the springs, or a
neighbour that warms them, may cool less, and the guard must then be too careful, never too late. Load cells are thermometers too:
a spring is at most at the temperature whose lower branch passes through its tension (hotter it would pull harder), and at least at
that of its upper one:

    T_up(s, e) - DOUBT <= T <= T_low(s, e) + DOUBT            where s is below the austenite line E_A e, which no heat exceeds
"""

from __future__ import annotations

import numpy as np

from twin.springs import Spring
from twin.springs.force import branches
from twin.springs.heat import heated, loss

LESS = 0.75  # of the described loss: a spring that cools a quarter less than described is still guarded
DOUBT = 8.0  # K: phase temperatures differ by some kelvins from spring to spring
AUSTENITE = 0.95  # of the austenite line: nearer to it tension says nothing about heat
WARMEST = 440.0  # K: where a tension is sought
THERMOMETER = 3.0  # K: noise of a measured temperature, six times 0.5 K, that the ceiling is lowered by


class Guard:
    """Limits of n springs, and their temperatures as voltages so far have made them."""

    def __init__(self, spring: Spring, ambient: float, *, supply: float = 0.9, ceiling: float = 423.15) -> None:
        """`supply` V, `ceiling` K (150 degC: annealing of NiTi springs starts well above), `ambient` K."""
        self.n = len(spring.capacity)
        self.spring, self.ambient, self.supply, self.ceiling = spring, ambient, supply, ceiling
        self.careful = spring._replace(
            **{
                name: LESS * getattr(spring, name)
                for name in spring._fields
                if name.startswith("loss") and name != "loss_surroundings"
            }
        )
        self.warmest = np.full(self.n, ambient)  # K, by the careful model
        self.temperature = np.full(self.n, ambient)  # K, by the described one

    def observe(self, tension: np.ndarray, elongation: np.ndarray) -> None:
        """Bound the modelled temperatures by measured tensions (n,) N of springs at elongations (n,) m."""
        low, up = loop_temperatures(self.spring, tension, elongation, self.ambient)
        known = tension < AUSTENITE * self.spring.austenite_stiffness * elongation
        self.warmest = np.where(known, np.minimum(self.warmest, low + DOUBT), self.warmest)
        self.temperature = np.clip(self.temperature, np.minimum(up - DOUBT, low), np.where(known, low + DOUBT, np.inf))

    def allowed(self, voltage: np.ndarray, elongation: np.ndarray, dt: float, measured: np.ndarray | None = None) -> np.ndarray:
        """The nearest allowed voltages (n,) V to hold for dt seconds, springs at elongations (n,) m; `measured` temperatures (n,) K
        where there are thermometers. The models of temperature go along."""
        hottest, ceiling = self.warmest, self.ceiling
        if measured is not None:
            hottest, ceiling = np.asarray(measured, float), self.ceiling - THERMOMETER
        given, own, careful = np.clip(voltage, 0.0, self.supply), self.spring.records, self.careful.records
        for t in range(self.n):
            h = loss(careful, t, hottest[t] - self.ambient, elongation[t], self.ambient)
            keep = np.exp(-h * dt / self.spring.capacity[t])
            power = h * (ceiling - self.ambient - keep * (hottest[t] - self.ambient)) / (1.0 - keep)
            given[t] = min(given[t], float(np.sqrt(max(power, 0.0) * self.spring.resistance[t])))
            current = given[t] / self.spring.resistance[t]
            self.warmest[t] = heated(careful, t, self.warmest[t], elongation[t], current, self.ambient, dt)
            self.temperature[t] = heated(own, t, self.temperature[t], elongation[t], current, self.ambient, dt)
        if measured is not None:
            self.temperature = np.asarray(measured, float).copy()
        return given


def loop_temperatures(spring: Spring, tension: np.ndarray, elongation: np.ndarray, ambient: float) -> tuple[np.ndarray, np.ndarray]:
    """(T_low, T_up), (n,) K each, between `ambient` and WARMEST: below T_low a spring at its elongation (n,) m does not pull up to
    `tension` (n,) N, above T_up it does not let go down to it."""
    low, up, records = np.empty(len(tension)), np.empty(len(tension)), spring.records
    for t, (s, e) in enumerate(zip(tension, elongation, strict=True)):
        for out, branch in ((low, 1), (up, 0)):
            cold, hot = ambient, WARMEST
            for _ in range(12):  # 0.03 K
                middle = 0.5 * (cold + hot)
                at = branches(records, t, middle)
                cold, hot = (middle, hot) if at[2 * branch] + at[2 * branch + 1] * e < s else (cold, middle)
            out[t] = hot
    return low, up
