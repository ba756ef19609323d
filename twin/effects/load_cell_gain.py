"""Load cell gain: the cell reads a constant factor too much or too little."""

from __future__ import annotations

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


class LoadCellGain(Effect):
    """Reading of cell i = gain_i * tension_i.

    Where tensions drive the twin, the true ones are found by inverting this.

    Source: linear sensor calibration; a cell re-mounted after its calibration is off by per cents.

    >>> import numpy as np
    >>> law, z = LoadCellGain(gain_1=1.1), np.zeros
    >>> seen = Signals(z(2), np.array([0.0, 3600.0]), np.ones((2, 3)), z((2, 3)), z((2, 1, 3)), z(2))
    >>> bool(np.allclose(law.sense(law.command(seen)).tension, 1.0))
    True
    """

    id = "load_cell_gain"
    per_tendon = (Parameter("gain", 1.0, "1", 0.3, 3.0, "calibration of the cell", std=0.3, scale=0.03),)
    needs = frozenset({"load cells"})
    moves_with = "the tension itself"

    def sense(self, true: Signals) -> Signals:
        return true.with_(tension=true.tension * self.each("gain"))

    def command(self, reported: Signals) -> Signals:
        return reported.with_(tension=reported.tension / self.each("gain"))
