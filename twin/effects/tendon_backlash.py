"""Tendon backlash: play or slack between drive and tendon."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from twin.body import Route, Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart, each_then_all
from twin.foundation.compiled import jit
from twin.foundation.parameters import Parameter

GAP_GUESS = 2e-4  # m, or in the unit of a control, from which fits start


class PlayingSteps:
    """Controls (nu,) one after another through plays (nu,): each is followed where it leaves the middle by half its play."""

    def __init__(self, play: np.ndarray, first: np.ndarray) -> None:
        self._half, self._followed = 0.5 * play, np.array(first, float)

    def __call__(self, control: np.ndarray) -> np.ndarray:
        self._followed = np.clip(self._followed, control - self._half, control + self._half)
        return self._followed.copy()


@jit
def play_side(travelled, swap, z):
    """Write the side of the gap to z, in [-1, 1], for travel (n, m): z = clip(z + d travel / swap, -1, 1) from 0, swap (m,)."""
    for j in range(travelled.shape[1]):
        before, side = 0.0, 0.0
        for i in range(travelled.shape[0]):
            side = min(1.0, max(-1.0, side + (travelled[i, j] - before) / swap[j]))
            before = travelled[i, j]
            z[i, j] = side


class TendonBacklash(Effect):
    """Displacement at the motor = that of the tendon + slack + gap/2 z, z = +1 after pulling in, -1 after paying out.

    The gap of drive i is `gap`, common to all, plus its own gap_i. The side z changes over the travel `swap`. With swap = gap/2 the
    tendon is at rest while the motor crosses the gap (the play operator); with less the gap is spring-loaded. If the gaps differ,
    swap is that of the mean gap, and each drive's is in proportion to its gap. `slack` is taken up before the tendon
    pulls; rods, which push, have none.

    An SMA spring follows its tendon with that play: its elongation is the path's less gap/2 z, z = +1 after paying out. With
    swap = gap/2 it is at rest while the tendon crosses the gap (99 % of it: play alone would leave no stiffness). Slack does not
    act there, and a logged displacement is the tendon's own.

    Each of two antagonists on a rigid joint only pulls, so its play is on the pulling side, z = +1, in both directions of travel.
    It is slack of gap/2 in both: a dead band that is crossed where the load, not the travel, changes its sign.

    An actuator of an MJCF follows its control through the play operator: c' = c - play_i/2 z in the unit of the control, with z = 0
    where a trial starts.

    Source: play operator (Krasnosel'skii and Pokrovskii). Worn gears, a loose coupling, a slack line: tenths of a millimetre.

    >>> from twin.body import Drive
    >>> u = np.array([[0.0], [1e-3], [0.5e-3]])
    >>> s = Signals(u[:, 0], u[:, 0], 0 * u, u, np.zeros((3, 0, 3)), u[:, 0], (Drive.DISPLACEMENT,))
    >>> (1e3 * TendonBacklash(gap=2e-4, swap=1e-4, n_tendon=1).drive(s).displacement[:, 0]).round(3).tolist()
    [0.0, 0.9, 0.6]
    """

    id = "tendon_backlash"
    parameters = (
        Parameter("gap", 0.0, "m", 0.0, 2e-2, "gears and couplings: 0.05-1 mm at the tendon", scale=5e-5),
        Parameter("swap", 1e-4, "m", 1e-5, 1e-2, "half the gap for pure play; ours", scale=5e-5),
        Parameter("slack", 0.0, "m", -2e-2, 2e-2, "a line cut too long; negative: pre-tensioned", scale=5e-5),
    )
    per_tendon = (
        Parameter("gap", 0.0, "m", -2e-2, 2e-2, "one drive's, beside that of all; as gap", scale=5e-5),
        Parameter("play", 0.0, "1", 0.0, 0.5, "an actuator's, in the unit of its control; as gap", scale=5e-5),
    )
    inactive_when_off = ("swap",)
    extended_parameters = ("slack",)
    extended_needs = frozenset({"elasticity", "slack"})
    moves_with = "the direction of travel"
    plot_against = "loop"
    hidden_without = frozenset({DataNeed.REVERSALS, DataNeed.DISPLACEMENTS})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with equal play in all drives; and, for several drives that bend a body, in each drive that moves.

        Actuators start each with its own, then all of them.
        """
        if predicted and (driven := predicted[0].driven_by_control).any():
            yield from each_then_all([{f"play_{i + 1}": GAP_GUESS} for i in np.flatnonzero(driven)])
            return
        yield FitStart({"gap": GAP_GUESS}, ("gap", "swap"))
        if n_tendon == 1 or not predicted or any(s.antagonists for s in predicted):
            return
        if any(s.driven_by_current.any() for s in predicted):
            yield FitStart({"gap": 4.0 * GAP_GUESS, "swap": 2.0 * GAP_GUESS}, ("gap", "swap"))
        travel = np.ptp(np.concatenate([s.displacement for s in predicted]), axis=0)
        for i in np.flatnonzero(travel > GAP_GUESS) + 1:
            yield FitStart({f"gap_{i}": GAP_GUESS}, (f"gap_{i}", "swap"))

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        """Start with slack; and, if several drives have one gap, also with each drive's own gap except the last one's."""
        yield from super().extended_starts(predicted)
        if self.n_tendon > 1 and self["gap"] > 0.0 and not self.per_tendon_values("gap").any():
            own = tuple(f"gap_{i}" for i in range(1, self.n_tendon))
            yield FitStart({"slack": 5e-5}, ("slack", *own))

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return PlayingSteps(self.per_tendon_values("play"), first)

    def drive(self, command: Signals) -> Signals:
        if np.any(play := self.per_tendon_values("play")):
            z = np.zeros_like(command.control)
            play_side(np.ascontiguousarray(command.control - command.control[:1]), np.maximum(0.5 * play, 1e-12), z)
            command = command.with_changes(control=command.control - 0.5 * play * z)
        moved = command.displacement - self["slack"] - 0.5 * self._gap() * self._side(command)
        return command.with_changes(displacement=np.where(command.driven_by_length, moved, command.displacement))

    def sense(self, true: Signals) -> Signals:
        reported = true.displacement + self["slack"] + 0.5 * self._gap() * self._side(true)
        return true.with_changes(displacement=np.where(true.driven_by_length | true.driven_by_current, true.displacement, reported))

    def route(self) -> Route:
        if not np.any(self._gap()):
            return Route()
        return Route(backlash=tuple(0.5 * self._gap()), crossing_travel=tuple(self._swap()))

    def _gap(self) -> np.ndarray:
        return np.maximum(self["gap"] + self.per_tendon_values("gap"), 0.0)

    def _swap(self) -> np.ndarray:
        gap = self._gap()
        open_ = gap > 0.0
        return self["swap"] * np.where(open_, gap / gap[open_].mean() if open_.any() else 1.0, 1.0)

    def _side(self, signals: Signals) -> np.ndarray:
        if signals.antagonists:
            return np.ones_like(signals.displacement)
        z = np.empty_like(signals.displacement)
        play_side(np.ascontiguousarray(signals.displacement), self._swap(), z)
        return z
