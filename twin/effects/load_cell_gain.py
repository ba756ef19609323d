"""Load cell gain: the cell's reading is off by a constant factor."""

from __future__ import annotations

from twin.body import Signals
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class LoadCellGain(Effect):
    """Reading of cell i = gain_i * tension_i.

    Where tensions drive the twin, the true ones are found by inverting it.

    Source: linear sensor calibration; a cell re-mounted after its calibration is off by per cents.

    >>> import numpy as np
    >>> effect, z = LoadCellGain(gain_1=1.1, n_tendon=3), np.zeros
    >>> reported = Signals(z(2), np.array([0.0, 3600.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> bool(np.allclose(effect.sense(effect.command(reported)).tension, 1.0))
    True
    """

    id = "load_cell_gain"
    per_tendon = (Parameter("gain", 1.0, "1", 0.3, 3.0, "calibration of the cell", std=0.3, scale=0.03),)
    needs = frozenset({"load cells"})
    moves_with = "the tension itself"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.EVERY_TENDON})

    def sense(self, true: Signals) -> Signals:
        return true.with_changes(tension=true.tension * self.per_tendon_values("gain"))

    def command(self, reported: Signals) -> Signals:
        return reported.with_changes(tension=reported.tension / self.per_tendon_values("gain"))
