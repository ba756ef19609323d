"""Sensor drift: a strain sensor's resistance drifts with time."""

from __future__ import annotations

from collections.abc import Iterator

from twin.body import Signals
from twin.effects.base.effect import Effect, FitStart
from twin.effects.base.saturating_drift import saturated_time, saturating_starts
from twin.foundation.parameters import Parameter


class SensorDrift(Effect):
    """Resistance of sensor i = R_i (1 + rate_i (1 - exp(-levelling t)) / levelling), t the time since the first trial.

    It drifts by its rate at first and levels off as the cords settle; a negative levelling accelerates it, and without levelling it
    is R_i (1 + rate_i t).

    Source: conductive rubber drifts by up to 8.3 % in 1,000 cycles of 14 h (KineSoft, Yoo et al. 2025, arXiv 2503.01078); fresh
    cords by per cents in minutes, then less as their filler settles (cords of one batch alike). An accelerating drift is a
    second-order Taylor expansion.

    >>> import numpy as np
    >>> z = np.zeros
    >>> s = Signals(z(1), np.array([100.0]), z((1, 1)), z((1, 1)), z((1, 0, 3)), z(1), others={"sensor": np.array([[1000.0]])})
    >>> float(SensorDrift(rate_1=1e-4, n_tendon=1).sense(s).others["sensor"][0, 0])
    1010.0
    """

    id = "sensor_drift"
    parameters = (
        Parameter("levelling", 0.0, "1/s", -3e-4, 2e-2, "cords that settle in minutes to an hour; or ever faster", scale=1e-4),
    )
    per_tendon = (Parameter("rate", 0.0, "1/s", -1e-3, 1e-3, "per cents in minutes to per cents in days", std=5e-5, scale=2e-6),)
    inactive_when_off = ("levelling",)
    needs = frozenset({"strain sensors"})
    moves_with = "the time of day"
    plot_against = "clock"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with each cord alone and with all, with constant rates and with drifts that level off by the session's end."""
        yield from saturating_starts(super().fit_starts(predicted, n_tendon), predicted, cls.parameters[0].high)

    def sense(self, true: Signals) -> Signals:
        if "sensor" not in true.others:
            return true
        drifted = true.others["sensor"] * (
            1.0 + self.per_tendon_values("rate") * saturated_time(true.clock, self["levelling"])[:, None]
        )
        return true.with_changes(others={**true.others, "sensor": drifted})
