"""Actuator saturation: beyond a limit the drive delivers less than commanded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.quantities import Parameter

REACHED = (0.7, 0.85)  # shares of the largest command at which the limit may lie


class ActuatorSaturation(Effect):
    """Tension delivered = c - loss r(c - limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2: all of it below the limit, the share
    1 - loss of what is above, with a corner of that width.

    A drive that stalls has loss = 1.

    Source: ideal saturation with a soft corner. A motor's current limit, a spring on its block, a slipping clutch.

    >>> z = np.zeros
    >>> s = Signals(z(2), z(2), np.array([[1.0], [3.0]]), z((2, 1)), z((2, 0, 3)), z(2))
    >>> ActuatorSaturation(loss=1.0, limit=2.0, corner=1e-4).drive(s).tension[:, 0].round(3).tolist()
    [1.0, 2.0]
    """

    id = "actuator_saturation"
    parameters = (
        Parameter("loss", 0.0, "1", 0.0, 1.0, "1: not a newton more than the limit", scale=0.2),
        Parameter("limit", 3.0, "N", 0.1, 200.0, "the drive's own; ours: from toys to cable tools", scale=0.1),
        Parameter("corner", 0.1, "N", 1e-4, 2.0, "softness of the corner; ours", scale=0.1),
    )
    shape = ("limit", "corner")
    needs = frozenset({"load cells"})
    moves_with = "the pull near its upper end"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Limits below the largest pull of the day."""
        largest = max(float(s.tension.max(initial=0.0)) for s in predicted)
        for share in REACHED:
            if 0.1 < share * largest < 200.0:
                yield Start({"loss": 0.3, "limit": share * largest}, tuple(p.name for p in cls.parameters))

    def drive(self, command: Signals) -> Signals:
        if self["loss"] == 0.0:
            return command
        beyond = command.tension - self["limit"]
        over = 0.5 * (beyond + np.hypot(beyond, self["corner"]))
        slack = 0.5 * (-self["limit"] + np.hypot(self["limit"], self["corner"]))  # no command, no loss
        return command.with_(tension=command.tension - self["loss"] * (over - slack))
