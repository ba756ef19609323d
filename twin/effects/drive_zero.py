"""Drive zero: a motor's zero is off, so that its commands count from elsewhere."""

from __future__ import annotations

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class DriveZero(Effect):
    """The drive is given c' = c + zero, zero in the unit of its control: m of a winch, rad of a servo.

    Source: an encoder or a horn that was mounted a tooth off: degrees; a tendon that was tied by hand: millimetres.

    >>> t = np.arange(2.0)
    >>> s = Signals(t, t, np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 0, 3)), t, control=np.array([[0.1], [0.2]]))
    >>> DriveZero(zero_1=0.05).command(s).control[:, 0].round(3).tolist()
    [0.15, 0.25]
    """

    id = "drive_zero"
    per_tendon = (
        Parameter("zero", 0.0, "1", -0.5, 0.5, "in the unit of the control; a tooth of a servo's horn is 0.25 rad", scale=1e-3),
    )  # fmt: skip
    needs = frozenset({"controls"})
    moves_with = "nothing: it is the same in every pose"
    plot_against = "position"

    def command(self, reported: Signals) -> Signals:
        zero = self.per_tendon_values("zero")
        return reported.with_changes(control=reported.control + zero) if np.any(zero) else reported
