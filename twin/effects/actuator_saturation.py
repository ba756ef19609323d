"""Actuator saturation: above a limit the drive delivers less tension, length or current than commanded."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

import mujoco
import numpy as np

from twin.body import ROPE_FEATURES, Body, Route, Signals
from twin.body.drives.counts import of_a_model
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter

LIMIT_SHARES = (0.7, 0.85)  # of the largest command: limits from which fits start
STALLED_SHARES = (0.25, 0.1)  # of the rows: with more tension than the stall tensions from which fits start
NO_LIMIT = 1e4  # N or N m: more than any actuator of a robot gives
NO_STALL = 1e3  # N: a stall tension that means that no motor stalls
MIN_STROKE = 1e-4  # m of travel: shorter strokes do not show


def _soft_excess(command: np.ndarray, limit: float, corner: float) -> np.ndarray:
    """Return the command's excess over the limit with a soft corner, zero for no command.

    It is r(c - limit) - r(-limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2.
    """
    over, none = command - limit, -limit
    return 0.5 * (over + np.hypot(over, corner) - none - np.hypot(none, corner))


class ActuatorSaturation(Effect):
    """Delivered = c - loss r(c - limit), r(x) = (x + sqrt(x^2 + corner^2)) / 2: below the limit c, above it the share 1 - loss.

    Tensions, and thrusts of rods: one `loss` for all drives above `limit`, with a corner of width `corner` (N). Currents: the same
    `loss` above `ceiling`, with a corner of width `knee` (A). Lengths: drive i has its own `loss_i` above `stroke`, with a corner
    of width `give` (m), both common to the drives, which are alike. A motor that holds a length gives way where its tendon would
    pull more than `stall`, and returns where it would not. Actuators of an MJCF: the force (torque) of actuator i stays within
    +-limit_i.

    A drive that stalls or stands on its end stop has a loss of 1, one that stalls on a spring less. It acts on commands: the log of
    a drive that reports its position does not show it.

    Source: ideal saturation with a soft corner. A motor's current limit, a spring on its block, a slipping clutch; an end stop, a
    servo's range, a full spool; a supply's largest current, or its voltage over the resistance of spring and leads.

    >>> from twin.body import Drive
    >>> z = np.zeros
    >>> s = Signals(z(2), z(2), np.array([[1.0], [3.0]]), z((2, 1)), z((2, 0, 3)), z(2))
    >>> ActuatorSaturation(loss=1.0, limit=2.0, corner=1e-4, n_tendon=1).drive(s).tension[:, 0].round(3).tolist()
    [1.0, 2.0]
    >>> s = Signals(z(2), z(2), z((2, 1)), np.array([[2e-3], [6e-3]]), z((2, 0, 3)), z(2), (Drive.DISPLACEMENT,))
    >>> stops = ActuatorSaturation({"loss_1": 1.0, "stroke": 5e-3, "give": 1e-5}, 1)
    >>> (1e3 * stops.drive(s).displacement[:, 0]).round(3).tolist()
    [2.0, 5.0]
    >>> ActuatorSaturation(stall=1.5, n_tendon=1).route().stall_tension
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
        Parameter("stall", NO_STALL, "N", 0.1, NO_STALL, "a motor's largest current, a torque limit, a slipping clutch", scale=0.1),
    )
    per_tendon = (
        Parameter("loss", 0.0, "1", 0.0, 1.0, "1: not a millimetre more than the stroke", scale=0.2),
        Parameter(
            "limit", NO_LIMIT, "1", 1e-3, NO_LIMIT, "N or N m: a current limit, a weak supply, a slipping clutch", scale=0.02
        ),
    )
    inactive_when_off = ("limit", "corner", "stroke", "give", "ceiling", "knee")
    needs = frozenset({"drives that saturate"})
    moves_with = "the pull near its upper end"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.REVERSALS})

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return the parameters of tendons' drives, or those of an MJCF's actuators."""
        own = cls.per_tendon[1] if of_a_model(n_tendon) else cls.per_tendon[0]
        each = tuple(replace(own, name=f"{own.name}_{i}") for i in range(1, n_tendon + 1))
        return each if of_a_model(n_tendon) else (*cls.parameters, *each)

    @classmethod
    def _starts_of_model(cls, predicted: list[Signals]) -> Iterator[FitStart]:
        """Yield limits below the largest force of each actuator, alone and all together."""
        forces = [s.others["actuator force"] for s in predicted if "actuator force" in s.others]
        largest = np.abs(np.concatenate(forces)).max(axis=0) if forces else np.zeros(0)
        for share in LIMIT_SHARES:
            starts = {f"limit_{i}": share * float(f) for i, f in enumerate(largest, 1) if share * f > cls.per_tendon[1].low}
            for values in (*({n: v} for n, v in starts.items()), *([starts] if len(starts) > 1 else [])):
                yield FitStart(values, tuple(values))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start at limits below the largest command of the session, or the largest force of an MJCF's actuators.

        Where lengths drive all tendons: at strokes below the largest length, for all drives that reach them at once, and at stall
        tensions that the tautest tendon of some rows exceeds.
        """
        if of_a_model(n_tendon):
            yield from cls._starts_of_model(predicted)
            return
        if not predicted:
            return
        lengths = [s.displacement for s in predicted if s.driven_by_length.all()]
        if len(lengths) == len(predicted):
            longest = np.concatenate(lengths).max(axis=0)
            for stroke in (share * float(longest.max()) for share in LIMIT_SHARES):
                names = tuple(f"loss_{i}" for i in range(1, n_tendon + 1) if longest[i - 1] > stroke)
                if stroke > MIN_STROKE:
                    yield FitStart({"stroke": stroke, **dict.fromkeys(names, 0.3)}, ("stroke", "give", *names))
            tautest = np.concatenate([s.tension.max(axis=1) for s in predicted])
            for share in STALLED_SHARES:
                if 0.1 < (stall := float(np.quantile(tautest, 1.0 - share))) < NO_STALL:
                    yield FitStart({"stall": stall}, ("stall",), ROPE_FEATURES)
            return
        if all(s.driven_by_current.all() for s in predicted):
            largest = max(float(s.current.max(initial=0.0)) for s in predicted)
            for share in LIMIT_SHARES:
                if 0.02 < share * largest < 50.0:
                    yield FitStart({"loss": 0.3, "ceiling": share * largest}, ("loss", "ceiling", "knee"))
            return
        largest = max(float(np.abs(s.tension).max(initial=0.0)) for s in predicted)
        for share in LIMIT_SHARES:
            if 0.1 < share * largest < 200.0:
                yield FitStart({"loss": 0.3, "limit": share * largest}, ("loss", "limit", "corner"))

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return "one" if len(free) == 1 and min(free).startswith("limit_") else ""

    def edit(self, body: Body) -> None:
        if of_a_model(self.n_tendon):
            limit = self.per_tendon_values("limit")
            body.limit_actuators(np.where(limit < NO_LIMIT, limit, np.inf))

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Return whether all is said: forces' ranges are numbers of the model, which `edit` has changed."""
        return of_a_model(self.n_tendon)

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray] | None:
        return (lambda command: command) if of_a_model(self.n_tendon) else None

    def drive(self, command: Signals) -> Signals:
        if of_a_model(self.n_tendon):
            return command
        tension, displacement, current = command.tension, command.displacement, command.current
        if self["loss"]:
            over = _soft_excess(np.abs(tension), self["limit"], self["corner"])
            tension = tension - self["loss"] * np.copysign(over, tension)
            current = current - self["loss"] * _soft_excess(current, self["ceiling"], self["knee"])
        if (loss := self.per_tendon_values("loss")).any():
            stopped = displacement - loss * _soft_excess(displacement, self["stroke"], self["give"])
            displacement = np.where(command.driven_by_length, stopped, displacement)
        return command.with_changes(tension=tension, displacement=displacement, current=current)

    def route(self) -> Route:
        stall = self.values.get("stall", NO_STALL)
        return Route(stall_tension=stall if stall < NO_STALL else np.inf)
