"""Sensor gain: a strain sensor's reading is off by a constant factor."""

from __future__ import annotations

from twin.body import Signals
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class SensorGain(Effect):
    """Resistance of sensor i = scale_i R0 (1 + gain_i a)^2, a = sqrt(R / R0) - 1 its apparent strain, R0 at no strain.

    The description gives the spread of R0 and kappa of built fingers; only a deviation beyond it is a gain.

    Source: linear calibration of the amplifier (`scale`) and of the cord's gauge factor (`gain`).

    >>> import numpy as np
    >>> z, one = np.zeros, np.full((1, 1), 1000.0)
    >>> s = Signals(z(1), z(1), z((1, 1)), z((1, 1)), z((1, 0, 3)), z(1), others={"sensor": 1.21 * one, "sensor_rest": one})
    >>> round(float(SensorGain(gain_1=2.0, n_tendon=1).sense(s).others["sensor"][0, 0]), 1)
    1440.0
    """

    id = "sensor_gain"
    per_tendon = (
        Parameter("gain", 1.0, "1", 0.05, 20.0, "gauge factor over the described one", std=0.5, scale=0.03),
        Parameter("scale", 1.0, "1", 0.05, 20.0, "calibration of the amplifier", std=0.5, scale=0.03),
    )
    needs = frozenset({"strain sensors"})
    moves_with = "the strain itself"
    plot_against = "reach"

    def sense(self, true: Signals) -> Signals:
        if "sensor" not in true.others:
            return true
        R, rest = true.others["sensor"], true.others["sensor_rest"]
        apparent = (R / rest) ** 0.5 - 1.0
        return true.with_changes(
            others={
                **true.others,
                "sensor": self.per_tendon_values("scale") * rest * (1.0 + self.per_tendon_values("gain") * apparent) ** 2,
            }
        )
