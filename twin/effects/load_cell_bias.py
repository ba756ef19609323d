"""Load cell bias: the cell reads a constant too much."""

from __future__ import annotations

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


class LoadCellBias(Effect):
    """Reading of cell i = tension_i + bias_i.

    Where tensions drive the twin, the true ones are found by inverting this.

    Source: linear sensor calibration; a cell not zeroed after mounting.

    >>> import numpy as np
    >>> law, z = LoadCellBias(bias_1=0.1), np.zeros
    >>> seen = Signals(z(2), np.array([0.0, 3600.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> bool(np.allclose(law.sense(law.command(seen)).tension, 1.0))
    True
    """

    id = "load_cell_bias"
    per_tendon = (Parameter("bias", 0.0, "N", -1.0, 1.0, "zero of the cell", std=0.2, scale=0.03),)
    needs = frozenset({"load cells"})
    moves_with = "the pull of one tendon, mostly where the others are slack"

    def sense(self, true: Signals) -> Signals:
        return true.with_(tension=true.tension + self.each("bias"))

    def command(self, reported: Signals) -> Signals:
        return reported.with_(tension=reported.tension - self.each("bias"))
