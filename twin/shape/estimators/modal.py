"""Strains and tendon displacements to coordinates of deformation modes, by a small network with an error bar.

    (z, log std z) = MLP(features),       vertices = mean + basis z,      std^2 = sum_k (basis_k std z_k)^2 + rest^2

The network is trained on simulated shapes alone: it gives the mean and the spread of all shapes whose strains these may be. Two
more cases are outside its domain, both by the 99.9 % quantile of held-out fingers: a shape whose own strains are not the measured
ones, and, where no contact is declared, strains that tendons alone do not make (`tendon_strains.py`). The shape of such a frame is
estimated as if contact had been declared.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.foundation.errors import DataError
from twin.mechanics.silicone import SoftStatics
from twin.prediction.twin import Twin
from twin.robots import Robot
from twin.shape.estimators.deformation_modes import MODE_COUNT, DeformationModes, ModeCoupling
from twin.shape.estimators.estimator import SensorReadings, ShapeEstimates
from twin.shape.estimators.features import SLACK_DISPLACEMENT, STRAIN_SCALE, network_features, scale_displacements
from twin.shape.estimators.learned import LearnedEstimator
from twin.shape.estimators.tendon_strains import (
    HANGING_PER_BATCH,
    TendonStrainNetwork,
    largest_deviation,
    pay_out_slack_tendons,
    strain_error_std,
)
from twin.shape.estimators.weights import pack_layers, perceptron, read_weights, unpack_layers
from twin.shape.training.samples import TrainingSamples
from twin.shape.training.training_spec import TrainingSpec, build_perceptron, perceptron_layers

if TYPE_CHECKING:
    import torch

HIDDEN_WIDTH, HIDDEN_LAYERS = 192, 3
TENDON_STRAIN_WIDTHS = [256, 256]  # hidden widths of the network of `tendon_strains.py`
KNOWN_QUANTILE = 0.999  # of held-out fingers deviate less
PRESSED_FACTOR = 1.4  # times that deviation: the most in free motions of seven days of another simulator, on which this was chosen
LEAST_LOG_STD, MOST_LOG_STD = -8.0, 3.0  # limits of log std z over the spread of z
TRUNCATION_ERROR = 1e-4  # m, of the modes left out


class ModalEstimator(LearnedEstimator):
    """A network onto deformation modes, without memory.

    `mean` (P, 3) m and `basis` (k, P, 3), orthonormal: displacements of the points are mean + z @ basis.
    """

    description = "a small network onto the twin's deformation modes"

    def __init__(self, twin: Twin, arrays: dict[str, Any] | None = None) -> None:
        super().__init__(twin, arrays)
        self.network = ModalNetwork(self.arrays)
        weights = self.body.lattice.weights(self.points.rest)
        self.mean, basis = (
            self.network.modes.mean.reshape(-1, 3),
            self.network.modes.basis.reshape(len(self.network.modes.basis), -1, 3),
        )
        if self.mean.shape[0] != weights.shape[1]:
            raise DataError(f"{self.weights_path(twin.robot)} was trained for another lattice; train it again: twin train")
        self.statics = SoftStatics(self.body)
        self.cords = self.statics.cord_paths(self.mean[None])[0], self.statics.cord_paths(basis) - self.body.cord_paths
        self.basis = np.einsum("pn,knc->kpc", weights, basis)
        self.mean = weights @ self.mean
        self.reach = (self.basis**2).sum(axis=2)

    @classmethod
    def training_spec(cls, samples: TrainingSamples) -> TrainingSpec:
        return ModalTrainingSpec(samples)

    @classmethod
    def weights_format(cls) -> str:
        return "twin-modal/4"

    def estimate(self, readings: SensorReadings) -> ShapeEstimates:
        """Estimate the shapes; frames with undeclared contact are marked and estimated as pushed."""
        pressed = self.tendon_strain_deviation(readings) > PRESSED_FACTOR * self.arrays["free_far"]
        shapes = super().estimate(replace(readings, pushed=readings.pushed or bool(pressed.all())))
        if readings.pushed:
            return replace(shapes, pressed=pressed)
        if pressed.any() and not pressed.all():
            again = super().estimate(SensorReadings(readings.strain[pressed], readings.displacement[pressed]))
            shapes.displacements[pressed], shapes.std[pressed] = again.displacements, again.std
        return replace(shapes, pressed=pressed, outside=shapes.outside | pressed)

    def tendon_strain_deviation(self, readings: SensorReadings) -> np.ndarray:
        """Return how far the readings (n,) are off the strains that tendons alone make, in standard deviations."""
        return largest_deviation(self.network.tendon_strains(readings.displacement), readings.strain)

    def shape_strain_deviation(self, readings: SensorReadings) -> np.ndarray:
        """Return how far the readings (n,) are off the strains of the estimated shape, in standard deviations."""
        return largest_deviation(self.strain(self.network(readings)[0]), readings.strain)

    def strain(self, z: np.ndarray) -> np.ndarray:
        """Return the strains (n, s) of shapes (n, k) m."""
        mean, basis = self.cords
        return self.statics.strain(mean + (z @ basis.reshape(len(basis), -1)).reshape(-1, *mean.shape))

    def held_out_quantiles(self, readings: SensorReadings) -> dict[str, float]:
        if readings.pushed:
            return {"missed_far": float(np.quantile(self.shape_strain_deviation(readings), KNOWN_QUANTILE))}
        return {"free_far": float(np.quantile(self.tendon_strain_deviation(readings), KNOWN_QUANTILE))}

    def _is_outside(self, readings: SensorReadings) -> np.ndarray:
        outside = super()._is_outside(readings)
        return outside | (self.shape_strain_deviation(readings) > self.arrays["missed_far"]) if readings.pushed else outside

    def decode(self, readings: SensorReadings) -> tuple[np.ndarray, np.ndarray]:
        z, std = self.network(readings)
        return self._displacements_at(z), np.sqrt(std**2 @ self.reach + TRUNCATION_ERROR**2)

    def estimate_displacements(self, readings: SensorReadings) -> np.ndarray:
        return self._displacements_at(self.network(readings)[0]) if readings.pushed else super().estimate_displacements(readings)

    def _displacements_at(self, z: np.ndarray) -> np.ndarray:
        """Return the points' displacements (n, P, 3) m at coordinates (n, k) m."""
        k, p = self.basis.shape[:2]
        return self.mean + (z @ self.basis.reshape(k, -1)).reshape(-1, p, 3)


class ModalNetwork:
    """The trained network: layers, modes, their `coupling` where hands push a finger with slack tendons, and `tendon_strains`."""

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.layers = unpack_layers("net", arrays)
        self.modes = DeformationModes(arrays["mean"], arrays["basis"], arrays["spread"])
        self.coupling = ModeCoupling(arrays["habit"], arrays["habit_inverse"], self.modes.spread)
        self.tendon_strains = TendonStrainNetwork(arrays)

    @staticmethod
    def of(robot: Robot) -> ModalNetwork:
        """Read the network beside a robot's description. Raises DataError for weights that are missing, truncated or foreign."""
        return ModalNetwork(read_weights(ModalEstimator.weights_path(robot), ModalEstimator.weights_format()))

    def __call__(self, readings: SensorReadings) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (n, k) m of the modes and their standard deviations."""
        mean, log_std = np.split(
            perceptron(network_features(readings.strain, readings.displacement, readings.pushed), self.layers), 2, axis=1
        )
        return mean * self.modes.spread, np.exp(np.clip(log_std, LEAST_LOG_STD, MOST_LOG_STD)) * self.modes.spread


class ModalTrainingSpec(TrainingSpec):
    """Training by the squared error of the vertices, and by the likelihood of each coordinate's residual for its std."""

    batch, learning_rate = 1024, 2e-3

    def __init__(self, samples: TrainingSamples) -> None:
        super().__init__(samples)
        nodes = samples.nodes.astype(float)
        self.modes = DeformationModes.of(nodes[~samples.held_out], samples.point_weights, MODE_COUNT)
        self.z = self.modes.coordinates(nodes, samples.point_weights)
        self.target = (self.z / self.modes.spread).astype(np.float32)
        taut = np.where(samples.pushed, 0, (samples.tension > 0.0).sum(axis=1))
        self.rarity = 1.0 / np.sqrt(np.bincount(taut)[taut] / len(taut))  # three taut tendons are rare, and hardest to predict

    def build_network(self) -> torch.nn.Module:
        import torch

        s, t = self.samples.strain.shape[1], self.samples.displacement.shape[1]
        return torch.nn.ModuleDict({
            "net": build_perceptron([self.input_size, *[HIDDEN_WIDTH] * HIDDEN_LAYERS, 2 * MODE_COUNT], torch.nn.SiLU),
            "free": build_perceptron([t, *TENDON_STRAIN_WIDTHS, s], torch.nn.ReLU),
        })  # fmt: skip

    def loss(self, net: Any, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        import torch

        spread = torch.tensor(self.modes.spread, dtype=torch.float32)
        mean, log_std = net["net"](x).split(MODE_COUNT, dim=1)
        error, log_std = (mean - torch.from_numpy(self.target[pick])) ** 2, log_std.clamp(LEAST_LOG_STD, MOST_LOG_STD)
        likelihood = (0.5 * error.detach() * torch.exp(-2.0 * log_std) + log_std).mean()
        shapes = 100.0 * (error * (spread / spread[0]) ** 2).sum(dim=1).mean() + 0.02 * likelihood
        return shapes + self._tendon_strain_loss(net["free"], pick[~self.samples.pushed[pick]], rng.spawn(1)[0])

    def _tendon_strain_loss(self, net: torch.nn.Module, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        """Return the squared error of the tendon strains of free samples and the hanging rest, in standard deviations of measured
        ones."""
        import torch

        displacement = pay_out_slack_tendons(rng, self.samples.displacement[pick], self.samples.tension[pick])
        slack = rng.uniform(SLACK_DISPLACEMENT, 0.0, (HANGING_PER_BATCH, displacement.shape[1]))
        target = np.concatenate([self.samples.strain[pick], np.tile(self.samples.hanging_strain, (HANGING_PER_BATCH, 1))])
        weight = STRAIN_SCALE / strain_error_std(target) * np.sqrt(np.r_[self.rarity[pick], np.ones(HANGING_PER_BATCH)])[:, None]
        predicted = net(torch.from_numpy(scale_displacements(np.concatenate([displacement, slack])).astype(np.float32)))
        error = predicted - torch.from_numpy((target / STRAIN_SCALE).astype(np.float32))
        return (error * torch.from_numpy(weight.astype(np.float32))).square().mean()

    def validation_error(self, net: Any, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        error = (net["net"](x)[:, :MODE_COUNT].numpy() - self.target[pick]) * self.modes.spread
        return np.sqrt((error**2).sum(axis=1) / len(self.samples.point_weights))

    def export_arrays(self, net: Any) -> dict[str, Any]:
        slack = self.samples.kind == "pushed"
        coefficient, inverse = ModeCoupling.fit(self.z[slack], self.modes.spread)
        modes = {"mean": self.modes.mean, "basis": self.modes.basis.astype(np.float32), "spread": self.modes.spread}
        layers = {k: v for name in ("net", "free") for k, v in pack_layers(name, perceptron_layers(net[name])).items()}
        return layers | modes | {"habit": coefficient, "habit_inverse": inverse}
