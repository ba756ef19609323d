"""Limit the heating of springs: the supply's voltage, and a temperature above which NiTi loses its memory.

The voltage is cut so that by the spring's heat balance the temperature ends the step at most at the ceiling:

    U^2 / R <= h (T_max - T_a - keep x) / (1 - keep),   keep = exp(-h dt/c),   x = T - T_a          (twin.mechanics.springs.heat)

Without a thermometer T comes from the guard's own heat model, with CAREFUL_LOSS_SHARE of the described loss: still air or a warm
neighbour may cool the spring less, and the guard must then be early, never late. Load cells bound the temperature too: a spring is
at most at the temperature whose lower branch passes through its tension (hotter it would pull harder), and at least at that of its
upper one:

    T_up(s, e) - MARGIN <= T <= T_low(s, e) + MARGIN          where s is below the austenite line E_A e, which no heat exceeds
"""

import numpy as np

from twin.body.drives.spring import Spring
from twin.mechanics.springs.force import hysteresis_branches
from twin.mechanics.springs.heat import heat_loss, heated_temperature

CAREFUL_LOSS_SHARE = 0.75  # of the described loss: covers a spring that cools a quarter less than described
PHASE_TEMPERATURE_MARGIN = 8.0  # K: phase temperatures differ by some kelvins from spring to spring
AUSTENITE_LINE_SHARE = 0.95  # of the austenite line: nearer to it the tension does not bound the temperature
HIGHEST_SOUGHT_TEMPERATURE = 440.0  # K, end of the bisection
THERMOMETER_MARGIN = 3.0  # K, lowers the ceiling: six times the noise of 0.5 K of a measured temperature


class HeatingGuard:
    """Limits of n springs, and models of their temperatures under the voltages so far."""

    def __init__(self, spring: Spring, ambient: float, *, supply: float = 0.9, ceiling: float = 423.15) -> None:
        """`supply` V, `ceiling` K (150 degC: annealing of NiTi springs starts well above), `ambient` K."""
        self.n = len(spring.capacity)
        self.spring, self.ambient, self.supply, self.ceiling = spring, ambient, supply, ceiling
        self.careful_spring = spring._replace(
            **{
                name: CAREFUL_LOSS_SHARE * getattr(spring, name)
                for name in spring._fields
                if name.startswith("loss") and name != "loss_surroundings"
            }
        )
        self.careful_temperature = np.full(self.n, ambient)  # K, by the model with less loss
        self.temperature = np.full(self.n, ambient)  # K, by the described model

    def bound_temperatures(self, tension: np.ndarray, elongation: np.ndarray) -> None:
        """Bound the modelled temperatures by measured tensions (n,) N of springs at elongations (n,) m."""
        low, up = branch_temperatures(self.spring, tension, elongation, self.ambient)
        known = tension < AUSTENITE_LINE_SHARE * self.spring.austenite_stiffness * elongation
        self.careful_temperature = np.where(
            known, np.minimum(self.careful_temperature, low + PHASE_TEMPERATURE_MARGIN), self.careful_temperature
        )
        self.temperature = np.clip(
            self.temperature,
            np.minimum(up - PHASE_TEMPERATURE_MARGIN, low),
            np.where(known, low + PHASE_TEMPERATURE_MARGIN, np.inf),
        )

    def limit_voltages(
        self, voltage: np.ndarray, elongation: np.ndarray, dt: float, measured: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the nearest allowed voltages (n,) V to hold for dt seconds, and advance the temperature models.

        The springs are at elongations (n,) m; `measured` temperatures (n,) K where there are thermometers.
        """
        hottest, ceiling = self.careful_temperature, self.ceiling
        if measured is not None:
            hottest, ceiling = np.asarray(measured, float), self.ceiling - THERMOMETER_MARGIN
        allowed, described, careful = np.clip(voltage, 0.0, self.supply), self.spring.records, self.careful_spring.records
        for t in range(self.n):
            h = heat_loss(careful, t, hottest[t] - self.ambient, elongation[t], self.ambient)
            keep = np.exp(-h * dt / self.spring.capacity[t])
            power = h * (ceiling - self.ambient - keep * (hottest[t] - self.ambient)) / (1.0 - keep)
            allowed[t] = min(allowed[t], float(np.sqrt(max(power, 0.0) * self.spring.resistance[t])))
            current = allowed[t] / self.spring.resistance[t]
            self.careful_temperature[t] = heated_temperature(
                careful, t, self.careful_temperature[t], elongation[t], current, self.ambient, dt
            )
            self.temperature[t] = heated_temperature(described, t, self.temperature[t], elongation[t], current, self.ambient, dt)
        if measured is not None:
            self.temperature = np.asarray(measured, float).copy()
        return allowed


def branch_temperatures(
    spring: Spring, tension: np.ndarray, elongation: np.ndarray, ambient: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (T_low, T_up), (n,) K each, between `ambient` and HIGHEST_SOUGHT_TEMPERATURE.

    Below T_low a spring at its elongation (n,) m does not pull up to `tension` (n,) N, above T_up it does not relax down to it.
    """
    low, up, records = np.empty(len(tension)), np.empty(len(tension)), spring.records
    for t, (s, e) in enumerate(zip(tension, elongation, strict=True)):
        for out, branch in ((low, 1), (up, 0)):
            cold, hot = ambient, HIGHEST_SOUGHT_TEMPERATURE
            for _ in range(12):  # 0.03 K
                middle = 0.5 * (cold + hot)
                at = hysteresis_branches(records, t, middle)
                cold, hot = (middle, hot) if at[2 * branch] + at[2 * branch + 1] * e < s else (cold, middle)
            out[t] = hot
    return low, up
