"""Load cell crosstalk: a cell also measures a share of the other tendons' tension."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter


class LoadCellCrosstalk(Effect):
    """Reading of cell i = tension_i + sum over j other than i of share_i_j tension_j.

    Where tensions drive the twin, the true ones are found by inverting it.

    Source: linear multi-axis sensor model; a common mounting plate that bends gives a few per cent.

    >>> z = np.zeros
    >>> true = Signals(z(1), z(1), np.array([[1.0, 2.0, 0.0]]), z((1, 3)), z((1, 0, 3)), z(1))
    >>> LoadCellCrosstalk(share_1_2=0.1, n_tendon=3).sense(true).tension.round(3).tolist()
    [[1.2, 2.0, 0.0]]
    """

    id = "load_cell_crosstalk"
    needs = frozenset({"load cells"})
    moves_with = "the tension of the other tendons"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.EVERY_TENDON})

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        source = "a bending mounting plate: per cents"
        return tuple(
            Parameter(f"share_{i}_{j}", 0.0, "1", -0.3, 0.3, source, std=0.1, scale=0.02)
            for i, j in itertools.permutations(range(1, n_tendon + 1), 2)
        )

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        names = tuple(p.name for p in cls.all_parameters(n_tendon))
        if names:
            yield FitStart(dict.fromkeys(names, 0.02), names)

    def crosstalk_matrix(self) -> np.ndarray:
        """Return the matrix (n_tendon, n_tendon) that turns tensions into readings."""
        out = np.eye(self.n_tendon)
        for name, value in self.values.items():
            _, i, j = name.split("_")
            out[int(i) - 1, int(j) - 1] = value
        return out

    def sense(self, true: Signals) -> Signals:
        return true.with_changes(tension=true.tension @ self.crosstalk_matrix().T)

    def command(self, reported: Signals) -> Signals:
        return reported.with_changes(tension=np.linalg.solve(self.crosstalk_matrix(), reported.tension.T).T)
