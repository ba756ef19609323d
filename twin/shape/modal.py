"""Strains and tendon displacements to coordinates of the twin's deformation modes, by a small network with an error bar.

    (z, log std z) = MLP(features),       vertices = mean + basis z,      std^2 = sum_k (basis_k std z_k)^2 + rest^2

Trained on the factory's shapes alone: of all the ways in which hands may have made these strains it gives the mean, and their
spread.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import DataError
from twin.robots import Robot
from twin.shape.estimator import Felt
from twin.shape.features import features
from twin.shape.learned import Learned
from twin.shape.lesson import Data, Lesson, layers_of, torch_perceptron
from twin.shape.modes import COUNT, Habit, Modes
from twin.shape.weights import pack, perceptron, read_weights, unpack
from twin.twin import Twin

if TYPE_CHECKING:
    import torch

WIDTH, LAYERS = 192, 3
LEAST, MOST = -8.0, 3.0  # of log std z over the spread of z
REST = 1e-4  # m, what the modes leave out


class Modal(Learned):
    """Remembers nothing. `mean` (P, 3) m and `basis` (k, P, 3), orthonormal: displacements of the points are mean + z @ basis."""

    about = "a small network onto the twin's deformation modes"

    def __init__(self, twin: Twin, arrays: dict[str, Any] | None = None) -> None:
        super().__init__(twin, arrays)
        self.net = Network(self.arrays)
        weights = self.body.lattice.weights(self.points.rest)
        self.mean, basis = self.net.modes.mean.reshape(-1, 3), self.net.modes.basis.reshape(len(self.net.modes.basis), -1, 3)
        if self.mean.shape[0] != weights.shape[1]:
            raise DataError(f"{twin.robot.folder / self.file()} was trained for another lattice; train it again: twin train")
        self.basis = np.einsum("pn,knc->kpc", weights, basis)
        self.mean = weights @ self.mean

    @classmethod
    def lesson(cls, data: Data) -> Lesson:
        return ModalLesson(data)

    def decode(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        z, std = self.net(felt)
        k, p = self.basis.shape[:2]
        moved = self.mean + (z @ self.basis.reshape(k, -1)).reshape(-1, p, 3)
        return moved, np.sqrt(std**2 @ (self.basis**2).sum(axis=2) + REST**2)


class Network:
    """The trained network: layers and modes; `habit`: how its modes go together where hands push a finger whose tendons are paid
    out."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = unpack("net", arrays)
        self.modes = Modes(arrays["mean"], arrays["basis"], arrays["spread"])
        self.habit = Habit(arrays["habit"], arrays["habit_inverse"], self.modes.spread)

    @staticmethod
    def of(robot: Robot) -> Network:
        """The one beside a robot's description. Raises DataError for weights that are not there, truncated or foreign."""
        return Network(read_weights(robot.folder / Modal.file(), Modal.form()))

    def __call__(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, k) m of the modes and their standard deviations."""
        mean, log_std = np.split(perceptron(features(felt.strain, felt.displacement, felt.pushed), self.layers), 2, axis=1)
        return mean * self.modes.spread, np.exp(np.clip(log_std, LEAST, MOST)) * self.modes.spread


class ModalLesson(Lesson):
    """Squared error of the vertices, and the likelihood of what is left of each coordinate for its std."""

    batch, rate = 1024, 2e-3

    def __init__(self, data: Data) -> None:
        super().__init__(data)
        nodes = data.nodes.astype(float)
        self.modes = Modes.of(nodes[~data.held], data.weights, COUNT)
        self.z = self.modes.coordinates(nodes, data.weights)
        self.target = (self.z / self.modes.spread).astype(np.float32)

    def network(self) -> torch.nn.Module:
        import torch

        return torch_perceptron([self.inputs, *[WIDTH] * LAYERS, 2 * COUNT], torch.nn.SiLU)

    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        import torch

        spread = torch.tensor(self.modes.spread, dtype=torch.float32)
        mean, log_std = net(x).split(COUNT, dim=1)
        error, log_std = (mean - torch.from_numpy(self.target[pick])) ** 2, log_std.clamp(LEAST, MOST)
        likelihood = (0.5 * error.detach() * torch.exp(-2.0 * log_std) + log_std).mean()
        return 100.0 * (error * (spread / spread[0]) ** 2).sum(dim=1).mean() + 0.02 * likelihood

    def missed(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        away = (net(x)[:, :COUNT].numpy() - self.target[pick]) * self.modes.spread
        return np.sqrt((away**2).sum(axis=1) / len(self.data.weights))

    def arrays(self, net: torch.nn.Module) -> dict[str, Any]:
        slack = self.data.kind == "pushed"
        coefficient, inverse = Habit.fit(self.z[slack], self.modes.spread)
        modes = {"mean": self.modes.mean, "basis": self.modes.basis.astype(np.float32), "spread": self.modes.spread}
        return pack("net", layers_of(net)) | modes | {"habit": coefficient, "habit_inverse": inverse}
