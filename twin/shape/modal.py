"""Strains and tendon displacements to coordinates of the twin's deformation modes, by a small network with an error bar.

    (z, log std z) = MLP(features),       vertices = mean + basis z,      std^2 = sum_k (basis_k std z_k)^2 + rest^2

Trained on the factory's shapes alone: of all the ways in which hands may have made these strains it gives the mean, and their
spread. A strain pattern is outside what it knows where its distance from the factory's patterns, a Mahalanobis distance, is beyond
theirs.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import DataError
from twin.shape.estimator import Estimator, Felt, Shapes
from twin.shape.features import features
from twin.shape.modes import Habit, Modes
from twin.twin import Twin

FILE, FORMAT = "modal.npz", "twin-modal/1"


class Modal(Estimator):
    """Remembers nothing."""

    about = "a small network onto the twin's deformation modes"

    def __init__(self, twin: Twin) -> None:
        super().__init__(twin)
        self.net = Network(read_weights(twin.robot.folder / FILE))
        weights = self.body.lattice.weights(self.points.rest)
        self._mean, basis = self.net.modes.mean.reshape(-1, 3), self.net.modes.basis.reshape(len(self.net.modes.basis), -1, 3)
        if self._mean.shape[0] != weights.shape[1]:
            raise DataError(f"{twin.robot.folder / FILE} was trained for another lattice; train it again: twin train")
        self._basis = np.einsum("pn,knc->kpc", weights, basis)
        self._mean = weights @ self._mean

    def estimate(self, felt: Felt) -> Shapes:
        z, std = self.net(felt)
        k, p = self._basis.shape[:2]
        moved = self._mean + (z @ self._basis.reshape(k, -1)).reshape(-1, p, 3)
        variance = std**2 @ (self._basis**2).sum(axis=2) + self.net.rest**2
        return Shapes(moved, np.sqrt(variance), self.net.outside(felt))


class Network:
    """The trained network: layers, modes and what it knows; `habit`: how its modes go together where
    hands push a finger whose tendons are paid out."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = [(arrays[f"weight_{i}"], arrays[f"bias_{i}"]) for i in range(int(arrays["layers"]))]
        self.modes = Modes(arrays["mean"], arrays["basis"], arrays["spread"])
        self.rest, self.widen = float(arrays["rest"]), arrays["widen"]
        self.habit = Habit(arrays["habit"], arrays["habit_inverse"], self.modes.spread)
        self._centre, self._inverse, self._far = arrays["known_mean"], arrays["known_inverse"], float(arrays["known_far"])

    def __call__(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, k) m of the modes and their standard deviations."""
        x = features(felt.strain, felt.displacement)
        for weight, bias in self.layers[:-1]:
            x = x @ weight.T + bias
            x = x / (1.0 + np.exp(-x))  # SiLU
        weight, bias = self.layers[-1]
        mean, log_std = np.split(x @ weight.T + bias, 2, axis=1)
        return mean * self.modes.spread, np.exp(np.clip(log_std, -8.0, 3.0)) * self.modes.spread * self.widen

    def outside(self, felt: Felt) -> np.ndarray:
        """(n,) whether strains, as far as they are there, lie further out than all but one in a thousand of those trained on."""
        x = np.where(np.isfinite(felt.strain), felt.strain, self._centre) - self._centre
        return np.einsum("ni,ij,nj->n", x, self._inverse, x) > self._far


def read_weights(path: Path) -> dict[str, Any]:
    """The arrays of a weights file. Raises DataError for a missing, truncated or foreign file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        if str(arrays["format"]) != FORMAT:
            raise DataError(f"{path}: format {arrays['format']}; {FORMAT} is needed, train it again: twin train")
    except FileNotFoundError:
        raise DataError(f"{path}: no weights there; train them: twin train") from None
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as fault:
        raise DataError(f"{path}: no weights of this program ({fault}); train them again: twin train") from None
    return {name: a.astype(float) if a.dtype == np.float32 else a for name, a in arrays.items()}
