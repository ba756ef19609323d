"""Time delay: inputs and outputs are logged with a shift in time."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


class TimeDelay(Effect):
    """Outputs logged late: reported(t) = true(t - delay), by monotone cubics between samples.

    Before the log starts the first value holds.

    Source: two loggers without a common clock; a camera's exposure and transfer (20-200 ms).

    >>> z = np.zeros
    >>> t = np.arange(4.0)
    >>> s = Signals(t, t, z((4, 1)), t[:, None], z((4, 1, 3)), z(4))
    >>> TimeDelay(delay=0.5).sense(s).displacement[:, 0].tolist()
    [0.0, 0.5, 1.5, 2.5]
    """

    id = "time_delay"
    parameters = (Parameter("delay", 0.0, "s", -3.0, 3.0, "positive: outputs come late", scale=0.05),)
    guesses = ({"delay": 0.1},)
    moves_with = "the rate of change of the pull"

    def sense(self, true: Signals) -> Signals:
        t = true.time - self["delay"]
        flat = np.concatenate([true.displacement, true.markers.reshape(len(t), -1)], axis=1)
        late = PchipInterpolator(true.time, flat)(np.clip(t, true.time[0], true.time[-1])) if len(t) > 1 else flat
        n = true.displacement.shape[1]
        return true.with_(displacement=late[:, :n], markers=late[:, n:].reshape(true.markers.shape))
