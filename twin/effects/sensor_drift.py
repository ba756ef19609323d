"""Sensor drift: a strain sensor's resistance wanders with time."""

from __future__ import annotations

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


class SensorDrift(Effect):
    """Resistance of sensor i = R_i (1 + rate_i t), t the time since the first trial.

    Source: first-order Taylor expansion of a slow drift. Conductive rubber: up to 8.3 % in 1,000 cycles of 14 h (KineSoft, Yoo et
    al. 2025, arXiv 2503.01078); fresh cords by per cents in minutes.

    >>> import numpy as np
    >>> z = np.zeros
    >>> s = Signals(z(1), np.array([100.0]), z((1, 1)), z((1, 1)), z((1, 0, 3)), z(1), others={"sensor": np.array([[1000.0]])})
    >>> float(SensorDrift(rate_1=1e-4, n_tendon=1).sense(s).others["sensor"][0, 0])
    1010.0
    """

    id = "sensor_drift"
    per_tendon = (Parameter("rate", 0.0, "1/s", -1e-3, 1e-3, "per cents in minutes to per cents in days", std=5e-5, scale=2e-6),)
    needs = frozenset({"strain sensors"})
    moves_with = "the time of day"

    def sense(self, true: Signals) -> Signals:
        if "sensor" not in true.others:
            return true
        drifted = true.others["sensor"] * (1.0 + self.each("rate") * true.clock[:, None])
        return true.with_(others={**true.others, "sensor": drifted})
