"""Sensor hysteresis: a strain sensor's resistance depends on its strain before."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import Effect, FitStart
from twin.effects.tendon_backlash import play_side
from twin.foundation.compiled import jit
from twin.foundation.parameters import Parameter


@jit
def first_order_lag(a, time, tau, out):
    """Write the first-order lag of a (n, s) with time constant `tau` (s) to `out`, exact for a constant between samples."""
    for j in range(a.shape[1]):
        y = a[0, j]
        out[0, j] = y
        for i in range(1, a.shape[0]):
            y += (1.0 - np.exp(-(time[i] - time[i - 1]) / tau)) * (a[i, j] - y)
            out[i, j] = y


class SensorHysteresis(Effect):
    """Apparent strain read = a - width z - share (a - lag(a)), a = sqrt(R / R0) - 1 and lag(a) its first-order lag over `time`.

    z in [-1, 1] is the side of a play operator: it follows a and changes side over the strain `swap`. At constant strain the play
    is constant, while the lag decays. Every trial starts from z = 0 and lag(a) = a.

    Source: play operator (Krasnosel'skii and Pokrovskii); a Maxwell element. Carbon-filled rubber shows both.

    >>> z, one = np.zeros, np.full((3, 1), 1000.0)
    >>> R = 1000.0 * (1.0 + np.array([[0.0], [0.05], [0.0]])) ** 2
    >>> s = Signals(np.arange(3.0), z(3), z((3, 1)), z((3, 1)), z((3, 0, 3)), z(3), others={"sensor": R, "sensor_rest": one})
    >>> SensorHysteresis(width=0.01, swap=0.01, n_tendon=1).sense(s).others["sensor"].round(1).ravel().tolist()
    [1000.0, 1081.6, 1020.1]
    """

    id = "sensor_hysteresis"
    parameters = (
        Parameter("width", 0.0, "1", -0.1, 0.1, "half the loop, apparent strain; per cents of the range", scale=5e-4),
        Parameter("swap", 5e-3, "1", 1e-4, 0.2, "strain over which it changes side; ours", scale=1e-3),
        Parameter("share", 0.0, "1", -0.9, 0.9, "of a sudden strain that comes late; carbon-filled rubber: a tenth", scale=0.02),
        Parameter("time", 2.0, "s", 0.05, 500.0, "relaxation time of that", scale=0.5),
    )
    inactive_when_off = ("swap", "time")
    needs = frozenset({"strain sensors"})
    moves_with = "the direction of strain"
    plot_against = "loop"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with a play, with a short lag and with a long one."""
        yield FitStart({"width": 1e-3}, ("width", "swap"))
        yield FitStart({"share": 0.05, "time": 2.0}, ("share", "time"))
        yield FitStart({"share": 0.05, "time": 20.0}, ("share", "time"))

    def sense(self, true: Signals) -> Signals:
        if "sensor" not in true.others or not (self["width"] or self["share"]):
            return true
        rest = true.others["sensor_rest"]
        a = np.ascontiguousarray((true.others["sensor"] / rest) ** 0.5 - 1.0)
        side, late = np.empty_like(a), np.empty_like(a)
        play_side(a - a[0], np.full(a.shape[1], self["swap"]), side)
        first_order_lag(a, true.time, self["time"], late)
        read = a - self["width"] * side - self["share"] * (a - late)
        return true.with_changes(others={**true.others, "sensor": rest * (1.0 + read) ** 2})
