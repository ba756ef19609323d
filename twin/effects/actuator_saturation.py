"""Actuator saturation: beyond a limit the drive delivers less than commanded, of a tension, a length or a current."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import ROPES, Effect, Route, Signals, Start
from twin.quantities import Parameter

REACHED = (0.7, 0.85)  # shares of the largest command at which the limit may lie
OVER = (0.25, 0.1)  # shares of the rows that may ask for more than a motor can pull
NEVER = 1e3  # N: no motor of these stalls there
MOVED = 1e-4  # m of travel below which no end of a stroke shows


def _beyond(command: np.ndarray, limit: float, corner: float) -> np.ndarray:
    """What of the command is above the limit, softly: r(c - limit) - r(-limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2. No command,
    nothing beyond."""
    over, none = command - limit, -limit
    return 0.5 * (over + np.hypot(over, corner) - none - np.hypot(none, corner))


class ActuatorSaturation(Effect):
    """Delivered = c - loss r(c - limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2: all of it below the limit, the share 1 - loss of
    what is above, with a corner of that width. Of tensions `loss` is common to the drives, with `limit` and `corner` in N; of
    currents too, beyond a `ceiling` with a corner `knee` in A; of lengths drive i has its own `loss_i`, beyond a `stroke` with a
    corner `give` that the drives, which are alike, share; and a motor that holds a length gives way where its tendon would pull
    more than `stall`, and is back where it would not.

    A drive that stalls or stands on its end stop has a loss of 1, one that stalls on a spring less. Commands are what is logged: a
    drive that reports where it is shows nothing of it.

    Source: ideal saturation with a soft corner. A motor's current limit, a spring on its block, a slipping clutch; an end stop, a
    servo's range, a spool that is full; a supply's largest current, or voltage over the resistance of spring and leads.

    >>> from twin.effects import Drive
    >>> z = np.zeros
    >>> s = Signals(z(2), z(2), np.array([[1.0], [3.0]]), z((2, 1)), z((2, 0, 3)), z(2))
    >>> ActuatorSaturation(loss=1.0, limit=2.0, corner=1e-4).drive(s).tension[:, 0].round(3).tolist()
    [1.0, 2.0]
    >>> s = Signals(z(2), z(2), z((2, 1)), np.array([[2e-3], [6e-3]]), z((2, 0, 3)), z(2), (Drive.DISPLACEMENT,))
    >>> stops = ActuatorSaturation({"loss_1": 1.0, "stroke": 5e-3, "give": 1e-5}, 1)
    >>> (1e3 * stops.drive(s).displacement[:, 0]).round(3).tolist()
    [2.0, 5.0]
    >>> ActuatorSaturation(stall=1.5).route().stall
    1.5
    """

    id = "actuator_saturation"
    parameters = (
        Parameter("loss", 0.0, "1", 0.0, 1.0, "1: not a newton more than the limit", scale=0.2),
        Parameter("limit", 3.0, "N", 0.1, 200.0, "the drive's own; ours: from toys to cable tools", scale=0.1),
        Parameter("corner", 0.1, "N", 1e-4, 2.0, "softness of the corner; ours", scale=0.1),
        Parameter("stroke", 1e-2, "m", 1e-4, 0.5, "the drive's own; ours: from toys to cable tools", scale=3e-4),
        Parameter("give", 2e-4, "m", 1e-6, 5e-3, "softness of the stroke's end; ours", scale=2e-4),
        Parameter("ceiling", 1.0, "A", 0.02, 50.0, "the supply's own; SMA wires of 0.1-0.5 mm: 0.2-5 A", scale=0.02),
        Parameter("knee", 0.05, "A", 1e-4, 5.0, "softness of the ceiling; ours", scale=0.02),
        Parameter("stall", NEVER, "N", 0.1, NEVER, "a motor's largest current, a torque limit, a slipping clutch", scale=0.1),
    )
    per_tendon = (Parameter("loss", 0.0, "1", 0.0, 1.0, "1: not a millimetre more than the stroke", scale=0.2),)
    shape = ("limit", "corner", "stroke", "give", "ceiling", "knee")
    needs = frozenset({"load cells"})
    moves_with = "the pull near its upper end"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Limits below the largest pull of the day; where lengths command all tendons strokes below the largest length, of all
        drives that come so far at once, and tensions that some rows' tautest tendon would exceed; of currents ceilings alike."""
        held = [s.displacement for s in predicted if s.by_length.all()]
        if len(held) == len(predicted):
            top = np.concatenate(held).max(axis=0)
            for stroke in (share * float(top.max()) for share in REACHED):
                names = tuple(f"loss_{i}" for i in range(1, n_tendon + 1) if top[i - 1] > stroke)
                if stroke > MOVED:
                    yield Start({"stroke": stroke, **dict.fromkeys(names, 0.3)}, ("stroke", "give", *names))
            tautest = np.concatenate([s.tension.max(axis=1) for s in predicted])
            for share in OVER:
                if 0.1 < (stall := float(np.quantile(tautest, 1.0 - share))) < NEVER:
                    yield Start({"stall": stall}, ("stall",), ROPES)
            return
        if predicted and all(s.by_current.all() for s in predicted):
            most = max(float(s.current.max(initial=0.0)) for s in predicted)
            for share in REACHED:
                if 0.02 < share * most < 50.0:
                    yield Start({"loss": 0.3, "ceiling": share * most}, ("loss", "ceiling", "knee"))
            return
        largest = max(float(s.tension.max(initial=0.0)) for s in predicted)
        for share in REACHED:
            if 0.1 < share * largest < 200.0:
                yield Start({"loss": 0.3, "limit": share * largest}, ("loss", "limit", "corner"))

    def drive(self, command: Signals) -> Signals:
        tension, displacement, current = command.tension, command.displacement, command.current
        if self["loss"]:
            tension = tension - self["loss"] * _beyond(tension, self["limit"], self["corner"])
            current = current - self["loss"] * _beyond(current, self["ceiling"], self["knee"])
        if (loss := self.each("loss")).any():
            stopped = displacement - loss * _beyond(displacement, self["stroke"], self["give"])
            displacement = np.where(command.by_length, stopped, displacement)
        return command.with_(tension=tension, displacement=displacement, current=current)

    def route(self) -> Route:
        return Route(stall=self["stall"] if self["stall"] < NEVER else np.inf)
