"""Load cell drift: the cell's zero drifts with time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.effects.base.saturating_drift import saturated_time, saturating_starts
from twin.foundation.parameters import Parameter


class LoadCellDrift(Effect):
    """Reading of cell i = tension_i + rate_i (1 - exp(-levelling t)) / levelling, t the time since the first trial.

    It drifts by its rate at first and levels off at rate_i / levelling, as cells that warm up; a negative levelling accelerates it,
    and without levelling it is rate_i t. Where tensions drive the twin, the true ones are found by inverting it.

    Source: a body that warms up in a room approaches its temperature exponentially (Newton's law of cooling), and a bridge's zero
    follows its temperature; the cells share the amplifier and the room. An accelerating drift is a second-order Taylor expansion.

    >>> effect, z = LoadCellDrift(rate_1=1e-4, levelling=1e-3, n_tendon=3), np.zeros
    >>> true = Signals(z(2), np.array([0.0, 36000.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> effect.sense(true).tension[1].round(6).tolist()
    [1.1, 1.0, 1.0]
    >>> bool(np.allclose(effect.sense(effect.command(true)).tension, 1.0))
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
    inactive_when_off = ("levelling",)
    needs = frozenset({"load cells"})
    moves_with = "the time of day"
    plot_against = "clock"
    hidden_without = frozenset({DataNeed.RANDOM_ORDER})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with each cell alone and with all, with constant rates and with drifts that level off by the session's end."""
        yield from saturating_starts(super().fit_starts(predicted, n_tendon), predicted, cls.parameters[0].high)

    def sense(self, true: Signals) -> Signals:
        return true.with_changes(tension=true.tension + self.zero_drift(true.clock))

    def command(self, reported: Signals) -> Signals:
        return reported.with_changes(tension=reported.tension - self.zero_drift(reported.clock))

    def zero_drift(self, clock: np.ndarray) -> np.ndarray:
        """Return the cells' zeros (n, n_tendon) N at `clock` (n,) s."""
        return self.per_tendon_values("rate") * saturated_time(clock, self["levelling"])[:, None]
