"""Strains and tendon displacements to coordinates of the twin's deformation modes, by a small network with an error bar.

    (z, log std z) = MLP(features),       vertices = mean + basis z,      std^2 = sum_k (basis_k std z_k)^2 + rest^2

Trained on the factory's shapes alone: of all the ways in which hands may have made these strains it gives the mean, and their
spread. Two more things are outside what it knows, both by the 99.9 % quantile of held-out factory fingers: a shape whose own
strains are not those felt (no hand of the factory's makes these), and, where nothing is said to push, strains that tendons alone
do not make (`free.py`); the shape of such a frame is sought as if something pushed, which it does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import DataError
from twin.robots import Robot
from twin.shape.estimator import Felt, Shapes
from twin.shape.features import SLACK, STRAIN, features, lengths
from twin.shape.free import HANGING, Free, far, paid_out, wrong_by
from twin.shape.learned import Learned
from twin.shape.lesson import Data, Lesson, layers_of, torch_perceptron
from twin.shape.modes import COUNT, Habit, Modes
from twin.shape.weights import pack, perceptron, read_weights, unpack
from twin.soft import SoftStatics
from twin.twin import Twin

if TYPE_CHECKING:
    import torch

WIDTH, LAYERS = 192, 3
ALONE = [256, 256]  # widths of the network of `free.py`
RARE = 0.999  # of held-out factory fingers are nearer
FURTHER = 1.4  # times as far lie free motions of seven days of another simulator at most, on which this was chosen
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
        self.statics = SoftStatics(self.body)
        self.cords = self.statics.cords(self.mean[None])[0], self.statics.cords(basis) - self.body.cord_paths
        self.basis = np.einsum("pn,knc->kpc", weights, basis)
        self.mean = weights @ self.mean
        self.reach = (self.basis**2).sum(axis=2)

    @classmethod
    def lesson(cls, data: Data) -> Lesson:
        return ModalLesson(data)

    @classmethod
    def form(cls) -> str:
        return "twin-modal/4"

    def estimate(self, felt: Felt) -> Shapes:
        pressed = self.unexplained(felt) > FURTHER * self.arrays["free_far"]
        shapes = super().estimate(replace(felt, pushed=felt.pushed or bool(pressed.all())))
        if felt.pushed:
            return replace(shapes, pressed=pressed)
        if pressed.any() and not pressed.all():
            again = super().estimate(Felt(felt.strain[pressed], felt.displacement[pressed]))
            shapes.moved[pressed], shapes.std[pressed] = again.moved, again.std
        return replace(shapes, pressed=pressed, outside=shapes.outside | pressed)

    def unexplained(self, felt: Felt) -> np.ndarray:
        """(n,): how far what is felt is off the strains that tendons alone make, in standard deviations."""
        return far(self.net.free(felt.displacement), felt.strain)

    def missed(self, felt: Felt) -> np.ndarray:
        """(n,): how far what is felt is off the strains of the shape estimated, in standard deviations."""
        return far(self.strain(self.net(felt)[0]), felt.strain)

    def strain(self, z: np.ndarray) -> np.ndarray:
        """Strains (n, s) of shapes (n, k) m."""
        mean, basis = self.cords
        return self.statics.strain(mean + (z @ basis.reshape(len(basis), -1)).reshape(-1, *mean.shape))

    def levels(self, felt: Felt) -> dict[str, float]:
        if felt.pushed:
            return {"missed_far": float(np.quantile(self.missed(felt), RARE))}
        return {"free_far": float(np.quantile(self.unexplained(felt), RARE))}

    def _outside(self, felt: Felt) -> np.ndarray:
        far_off = super()._outside(felt)
        return far_off | (self.missed(felt) > self.arrays["missed_far"]) if felt.pushed else far_off

    def decode(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        z, std = self.net(felt)
        return self._at(z), np.sqrt(std**2 @ self.reach + REST**2)

    def displaced(self, felt: Felt) -> np.ndarray:
        return self._at(self.net(felt)[0]) if felt.pushed else super().displaced(felt)

    def _at(self, z: np.ndarray) -> np.ndarray:
        """Displacements (n, P, 3) m of the points at coordinates (n, k) m."""
        k, p = self.basis.shape[:2]
        return self.mean + (z @ self.basis.reshape(k, -1)).reshape(-1, p, 3)


class Network:
    """The trained network: layers and modes; `habit`: how its modes go together where hands push a finger whose tendons are paid
    out; `free`: the strains that tendons alone make."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = unpack("net", arrays)
        self.modes = Modes(arrays["mean"], arrays["basis"], arrays["spread"])
        self.habit = Habit(arrays["habit"], arrays["habit_inverse"], self.modes.spread)
        self.free = Free(arrays)

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
        taut = np.where(data.pushed, 0, (data.tension > 0.0).sum(axis=1))
        self.rarity = 1.0 / np.sqrt(np.bincount(taut)[taut] / len(taut))  # three taut tendons are rare, and hardest to foretell

    def network(self) -> torch.nn.Module:
        import torch

        s, t = self.data.strain.shape[1], self.data.displacement.shape[1]
        return torch.nn.ModuleDict({
            "net": torch_perceptron([self.inputs, *[WIDTH] * LAYERS, 2 * COUNT], torch.nn.SiLU),
            "free": torch_perceptron([t, *ALONE, s], torch.nn.ReLU),
        })  # fmt: skip

    def loss(self, net: Any, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        import torch

        spread = torch.tensor(self.modes.spread, dtype=torch.float32)
        mean, log_std = net["net"](x).split(COUNT, dim=1)
        error, log_std = (mean - torch.from_numpy(self.target[pick])) ** 2, log_std.clamp(LEAST, MOST)
        likelihood = (0.5 * error.detach() * torch.exp(-2.0 * log_std) + log_std).mean()
        shapes = 100.0 * (error * (spread / spread[0]) ** 2).sum(dim=1).mean() + 0.02 * likelihood
        return shapes + self._alone(net["free"], pick[~self.data.pushed[pick]], rng.spawn(1)[0])

    def _alone(self, net: torch.nn.Module, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        """Squared error of the strains that tendons alone make, in standard deviations of felt ones: free samples and the hanging
        rest."""
        import torch

        d = paid_out(rng, self.data.displacement[pick], self.data.tension[pick])
        slack = rng.uniform(SLACK, 0.0, (HANGING, d.shape[1]))
        wanted = np.concatenate([self.data.strain[pick], np.tile(self.data.hanging, (HANGING, 1))])
        weight = STRAIN / wrong_by(wanted) * np.sqrt(np.r_[self.rarity[pick], np.ones(HANGING)])[:, None]
        found = net(torch.from_numpy(lengths(np.concatenate([d, slack])).astype(np.float32)))
        off = found - torch.from_numpy((wanted / STRAIN).astype(np.float32))
        return (off * torch.from_numpy(weight.astype(np.float32))).square().mean()

    def missed(self, net: Any, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        away = (net["net"](x)[:, :COUNT].numpy() - self.target[pick]) * self.modes.spread
        return np.sqrt((away**2).sum(axis=1) / len(self.data.weights))

    def arrays(self, net: Any) -> dict[str, Any]:
        slack = self.data.kind == "pushed"
        coefficient, inverse = Habit.fit(self.z[slack], self.modes.spread)
        modes = {"mean": self.modes.mean, "basis": self.modes.basis.astype(np.float32), "spread": self.modes.spread}
        layers = {k: v for name in ("net", "free") for k, v in pack(name, layers_of(net[name])).items()}
        return layers | modes | {"habit": coefficient, "habit_inverse": inverse}
