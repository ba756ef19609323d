"""Stroke limit: a drive that commands a length stops short of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.quantities import Parameter

REACHED = (0.7, 0.85)  # shares of the largest command at which the limit may lie
MOVED = 1e-4  # m of travel below which no limit shows


class StrokeLimit(Effect):
    """Tendon drawn in by drive i at command u = u - loss_i r(u - limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2: all of it below the
    limit, the share 1 - loss_i of what is above, with a corner of that width.

    A drive on its end stop has loss = 1, one that stalls on a spring less; 0 never comes so far. The limit is common to the drives,
    which are alike. Commands are what is logged: a drive that reports where it is shows nothing of it.

    Source: ideal saturation with a soft corner. An end stop, a servo's range, a spool that is full, a motor that stalls.

    >>> from twin.effects import Drive
    >>> u, z = np.array([[2e-3], [6e-3]]), np.zeros
    >>> s = Signals(z(2), z(2), 0 * u, u, z((2, 0, 3)), z(2), (Drive.DISPLACEMENT,))
    >>> law = StrokeLimit({"loss_1": 1.0, "limit": 5e-3, "corner": 1e-5}, 1)
    >>> (1e3 * law.drive(s).displacement[:, 0]).round(3).tolist()
    [2.0, 5.0]
    """

    id = "stroke_limit"
    parameters = (
        Parameter("limit", 1e-2, "m", 1e-4, 0.5, "the drive's own; ours: from toys to cable tools", scale=3e-4),
        Parameter("corner", 2e-4, "m", 1e-6, 5e-3, "softness of the corner; ours", scale=2e-4),
    )
    per_tendon = (Parameter("loss", 0.0, "1", 0.0, 1.0, "1: not a millimetre more than the limit", scale=0.2),)
    shape = ("limit", "corner")
    needs = frozenset({"elasticity"})
    moves_with = "the pull of a tendon near its upper end"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Limits below the largest command of the day, all drives that come so far at once. Only where displacements command all
        tendons."""
        held = [s.displacement[:, s.by_length] for s in predicted if s.by_length.all()]
        if not held:
            return
        top = np.concatenate(held).max(axis=0)
        for share in REACHED:
            limit = share * float(top.max())
            names = tuple(f"loss_{i}" for i in range(1, n_tendon + 1) if top[i - 1] > limit)
            if limit > MOVED:
                yield Start({"limit": limit, **dict.fromkeys(names, 0.3)}, ("limit", "corner", *names))

    def drive(self, command: Signals) -> Signals:
        loss = self.each("loss")
        if not loss.any():
            return command
        beyond = command.displacement - self["limit"]
        over = 0.5 * (beyond + np.hypot(beyond, self["corner"]))
        slack = 0.5 * (-self["limit"] + np.hypot(self["limit"], self["corner"]))  # no command, no loss
        stopped = command.displacement - loss * (over - slack)
        return command.with_(displacement=np.where(command.by_length, stopped, command.displacement))
