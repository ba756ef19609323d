"""Load cell drift: the cell's zero wanders with time."""

from __future__ import annotations

import numpy as np

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter

HOUR = 3600.0  # s


class LoadCellDrift(Effect):
    """Reading of cell i = tension_i + rate_i t + bend_i t^2 / hour, t the time since the first trial.

    Where tensions drive the twin, the true ones are found by inverting this.

    Source: second-order Taylor expansion of a slow zero drift.

    >>> law, z = LoadCellDrift(rate_1=1e-4), np.zeros
    >>> seen = Signals(z(2), np.array([0.0, 3600.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> bool(np.allclose(law.sense(law.command(seen)).tension, 1.0))
    True
    """

    id = "load_cell_drift"
    per_tendon = (
        Parameter("rate", 0.0, "N/s", -2e-3, 2e-3, "warm-up of the amplifier; 0.1 N/h to 1 N/h", std=1e-4, scale=2e-5),
        Parameter("bend", 0.0, "N/s", -2e-3, 2e-3, "curvature of the drift over an hour", std=1e-4, scale=2e-5),
    )
    needs = frozenset({"load cells"})
    moves_with = "the time of day"

    def sense(self, true: Signals) -> Signals:
        return true.with_(tension=true.tension + self.wander(true.clock))

    def command(self, reported: Signals) -> Signals:
        return reported.with_(tension=reported.tension - self.wander(reported.clock))

    def wander(self, clock: np.ndarray) -> np.ndarray:
        """The zero (N), shape (n, n_tendon), at `clock` (n,) s."""
        t = np.asarray(clock, float)[:, None]
        return self.each("rate") * t + self.each("bend") * t**2 / HOUR
