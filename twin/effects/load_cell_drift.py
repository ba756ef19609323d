"""Load cell drift: the cell's zero wanders with time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.effects.levelling import levelled, levelled_starts
from twin.quantities import Parameter


class LoadCellDrift(Effect):
    """Reading of cell i = tension_i + rate_i (1 - exp(-levelling t)) / levelling, t the time since the first trial: at first by its
    rate, and ever less where the cells warm up, to rate_i / levelling; ever more where levelling is negative, else rate_i t.

    Where tensions drive the twin, the true ones are found by inverting this.

    Source: a body that warms up in a room nears its end exponentially (Newton's law of cooling), and a bridge's zero follows its
    temperature; the cells share the amplifier and the room. A bend the other way is second-order Taylor expansion.

    >>> law, z = LoadCellDrift(rate_1=1e-4, levelling=1e-3), np.zeros
    >>> seen = Signals(z(2), np.array([0.0, 36000.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> law.sense(seen).tension[1].round(6).tolist()
    [1.1, 1.0, 1.0]
    >>> bool(np.allclose(law.sense(law.command(seen)).tension, 1.0))
    True
    """

    id = "load_cell_drift"
    parameters = (
        Parameter(
            "levelling",
            0.0,
            "1/s",
            -3e-4,
            2e-2,
            "warm-up of an amplifier: minutes to an hour; or ever faster",
            scale=1e-4,
        ),
    )
    per_tendon = (Parameter("rate", 0.0, "N/s", -2e-3, 2e-3, "warm-up of the amplifier; 0.1 N/h to 1 N/h", std=1e-4, scale=2e-5),)
    shape = ("levelling",)
    needs = frozenset({"load cells"})
    moves_with = "the time of day"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Each cell alone and all, all through the session alike, then levelled off by its end."""
        yield from levelled_starts(super().starts(predicted, n_tendon), predicted, cls.parameters[0].high)

    def sense(self, true: Signals) -> Signals:
        return true.with_(tension=true.tension + self.wander(true.clock))

    def command(self, reported: Signals) -> Signals:
        return reported.with_(tension=reported.tension - self.wander(reported.clock))

    def wander(self, clock: np.ndarray) -> np.ndarray:
        """The zero (N), shape (n, n_tendon), at `clock` (n,) s."""
        return self.each("rate") * levelled(clock, self["levelling"])[:, None]
