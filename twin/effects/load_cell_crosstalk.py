"""Load cell crosstalk: a cell also feels its neighbours' tendons."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.quantities import Parameter


class LoadCellCrosstalk(Effect):
    """Reading of cell i = tension_i + sum over j other than i of share_i_j tension_j.

    Where tensions drive the twin, the true ones are found by inverting this.

    Source: linear multi-axis sensor model; a common mounting plate that bends gives per cents.

    >>> z = np.zeros
    >>> seen = Signals(z(1), z(1), np.array([[1.0, 2.0, 0.0]]), z((1, 3)), z((1, 0, 3)), z(1))
    >>> LoadCellCrosstalk(share_1_2=0.1).sense(seen).tension.round(3).tolist()
    [[1.2, 2.0, 0.0]]
    """

    id = "load_cell_crosstalk"
    needs = frozenset({"load cells"})
    moves_with = "the tension of the other tendons"

    @classmethod
    def declared(cls, n_tendon: int) -> tuple[Parameter, ...]:
        one = range(1, n_tendon + 1)
        words = "a bending mounting plate: per cents"
        return tuple(
            Parameter(f"share_{i}_{j}", 0.0, "1", -0.3, 0.3, words, std=0.1, scale=0.02) for i in one for j in one if i != j
        )

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        names = tuple(p.name for p in cls.declared(n_tendon))
        if names:
            yield Start(dict.fromkeys(names, 0.02), names)

    def mix(self) -> np.ndarray:
        """Readings from tensions, (n_tendon, n_tendon)."""
        out = np.eye(self.n_tendon)
        for name, value in self.values.items():
            _, i, j = name.split("_")
            out[int(i) - 1, int(j) - 1] = value
        return out

    def sense(self, true: Signals) -> Signals:
        return true.with_(tension=true.tension @ self.mix().T)

    def command(self, reported: Signals) -> Signals:
        return reported.with_(tension=np.linalg.solve(self.mix(), reported.tension.T).T)
