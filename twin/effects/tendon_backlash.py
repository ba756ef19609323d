"""Tendon backlash: play or slack between drive and tendon."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.compiled import jit
from twin.effects.effect import Effect, Route, Signals, Start
from twin.quantities import Parameter

GUESS = 2e-4  # m


@jit
def lead(travelled, swap, z):
    """Side of the gap z in [-1, 1] for travel (n, m), from the middle at rest: z = clip(z + d travel / swap, -1, 1), swap (m,)."""
    for j in range(travelled.shape[1]):
        before, side = 0.0, 0.0
        for i in range(travelled.shape[0]):
            side = min(1.0, max(-1.0, side + (travelled[i, j] - before) / swap[j]))
            before = travelled[i, j]
            z[i, j] = side


class TendonBacklash(Effect):
    """Displacement at the motor = that of the tendon + slack + gap/2 z, z = +1 after pulling in, -1 after paying out.

    The gap of drive i is `gap`, common to all, plus its own gap_i. The side z changes over the travel `swap`; with swap = gap/2
    the tendon stands still while the motor crosses the gap (the play operator), with less it is a spring-loaded one. Of drives with
    gaps of their own it is the mean's, and each is crossed in proportion. `slack` is what must be taken up before the tendon pulls.

    An SMA spring follows its tendon with that play: it is longer than the path has it by gap/2 z less, z = +1 after paying out, and
    with swap = gap/2 stands still while the tendon crosses the gap (99 % of it: play alone would leave no stiffness). Slack is not
    taken up there, and a displacement that is logged there is the tendon's own.

    Antagonists that turn a rigid joint: each of them only ever pulls, so that its play lies on the pulling side, z = +1, whichever
    way it travels. It is slack of gap/2 in both: a dead band that is crossed where the load, not the travel, changes its sign.

    Source: play operator (Krasnosel'skii and Pokrovskii). Worn gears, a loose coupling, a slack line: tenths of a millimetre.

    >>> from twin.effects import Drive
    >>> u = np.array([[0.0], [1e-3], [0.5e-3]])
    >>> s = Signals(u[:, 0], u[:, 0], 0 * u, u, np.zeros((3, 0, 3)), u[:, 0], (Drive.DISPLACEMENT,))
    >>> (1e3 * TendonBacklash(gap=2e-4, swap=1e-4).drive(s).displacement[:, 0]).round(3).tolist()
    [0.0, 0.9, 0.6]
    """

    id = "tendon_backlash"
    parameters = (
        Parameter("gap", 0.0, "m", 0.0, 2e-2, "gears and couplings: 0.05-1 mm at the tendon", scale=5e-5),
        Parameter("swap", 1e-4, "m", 1e-5, 1e-2, "half the gap for pure play; ours", scale=5e-5),
        Parameter("slack", 0.0, "m", -2e-2, 2e-2, "a line cut too long; negative: pre-tensioned", scale=5e-5),
    )
    per_tendon = (Parameter("gap", 0.0, "m", -2e-2, 2e-2, "one drive's, beside that of all; as gap", scale=5e-5),)
    shape = ("swap",)
    richer = ("slack",)
    richer_needs = frozenset({"elasticity"})
    moves_with = "the direction of travel"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Play in all drives alike; and, of several that bend a body, in one that moves."""
        yield Start({"gap": GUESS}, ("gap", "swap"))
        if n_tendon == 1 or any(s.antagonists for s in predicted):
            return
        if any(s.by_current.any() for s in predicted):
            yield Start({"gap": 4.0 * GUESS, "swap": 2.0 * GUESS}, ("gap", "swap"))
        travel = np.ptp(np.concatenate([s.displacement for s in predicted]), axis=0)
        for i in np.flatnonzero(travel > GUESS) + 1:
            yield Start({f"gap_{i}": GUESS}, (f"gap_{i}", "swap"))

    def fuller_starts(self, predicted: list[Signals]) -> Iterator[Start]:
        """With slack; and, of several drives with one gap, with gaps of their own, the last one's being that of all."""
        yield from super().fuller_starts(predicted)
        if self.n_tendon > 1 and self["gap"] > 0.0 and not self.each("gap").any():
            own = tuple(f"gap_{i}" for i in range(1, self.n_tendon))
            yield Start({"slack": 5e-5}, ("slack", *own))

    def drive(self, command: Signals) -> Signals:
        moved = command.displacement - self["slack"] - 0.5 * self._gap() * self._side(command)
        return command.with_(displacement=np.where(command.by_length, moved, command.displacement))

    def sense(self, true: Signals) -> Signals:
        ahead = true.displacement + self["slack"] + 0.5 * self._gap() * self._side(true)
        return true.with_(displacement=np.where(true.by_length | true.by_current, true.displacement, ahead))

    def route(self) -> Route:
        return Route(play=tuple(0.5 * self._gap()), swap=tuple(self._swap()))

    def _gap(self) -> np.ndarray:
        return np.maximum(self["gap"] + self.each("gap"), 0.0)

    def _swap(self) -> np.ndarray:
        gap = self._gap()
        there = gap > 0.0
        return self["swap"] * np.where(there, gap / gap[there].mean() if there.any() else 1.0, 1.0)

    def _side(self, signals: Signals) -> np.ndarray:
        if signals.antagonists:
            return np.ones_like(signals.displacement)
        z = np.empty_like(signals.displacement)
        lead(np.ascontiguousarray(signals.displacement), self._swap(), z)
        return z
