"""Load cell bias: the cell's reading has a constant offset."""

from __future__ import annotations

from twin.body import Signals
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class LoadCellBias(Effect):
    """Reading of cell i = tension_i + bias_i.

    Where tensions drive the twin, the true ones are found by inverting it.

    Source: linear sensor calibration; a cell not zeroed after mounting.

    >>> import numpy as np
    >>> effect, z = LoadCellBias(bias_1=0.1, n_tendon=3), np.zeros
    >>> reported = Signals(z(2), np.array([0.0, 3600.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> bool(np.allclose(effect.sense(effect.command(reported)).tension, 1.0))
    True
    """

    id = "load_cell_bias"
    per_tendon = (Parameter("bias", 0.0, "N", -1.0, 1.0, "zero of the cell", std=0.2, scale=0.03),)
    needs = frozenset({"load cells"})
    moves_with = "the pull of one tendon, mostly where the others are slack"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.TWO_LOADS})

    def sense(self, true: Signals) -> Signals:
        return true.with_changes(tension=true.tension + self.per_tendon_values("bias"))

    def command(self, reported: Signals) -> Signals:
        return reported.with_changes(tension=reported.tension - self.per_tendon_values("bias"))
