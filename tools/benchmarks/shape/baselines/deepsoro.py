"""After DeepSoRo (Wang et al. 2020, arXiv 1904.03820): a decoder that learns surfaces from unordered points.

    c = MLP(features),      b = MLP(g),      place = g + MLP(b + c),      g a prototype point

trained by the symmetric chamfer distance between the decoded prototype and a cloud of the true skin, without correspondence. From
DeepSoRo come the code added to the lifted prototype, one fold, and the loss. The encoder takes sensor readings in place of camera
images; the prototype, a half cylinder there, is the finger's own skin at rest, to which the fold is added, so that points keep
names as far as the chamfer distance allows. Points inside are placed by a fold that was not trained on any.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tools.benchmarks.shape.baselines.pointwise import DISPLACEMENT_SCALE, PLACE_SCALE, PointwiseEstimator
from twin.shape.estimators.estimator import SensorReadings
from twin.shape.estimators.features import network_features
from twin.shape.estimators.weights import pack_layers, perceptron, relu, unpack_layers
from twin.shape.training.samples import TrainingSamples
from twin.shape.training.training_spec import TrainingSpec, build_perceptron, perceptron_layers

if TYPE_CHECKING:
    import torch

CODE_SIZE, LAYER_WIDTH = 64, 64
PROTOTYPE_POINTS, CLOUD_POINTS = 96, 192  # points of the prototype and of the true skin in one training step


class DeepSoRoEstimator(PointwiseEstimator):
    """A decoder trained without correspondence, without memory."""

    description = "after DeepSoRo: a decoder trained by chamfer distance, without correspondence"
    limitations = "which point is which, and points inside"

    def moved(self, felt: SensorReadings) -> np.ndarray:
        code, lift, fold = (unpack_layers(name, self.arrays) for name in ("code", "lift", "fold"))
        c = perceptron(network_features(felt.strain, felt.displacement, felt.pushed), code, relu)
        b = perceptron(self.points.rest / PLACE_SCALE, lift, relu)
        return DISPLACEMENT_SCALE * perceptron(b + c[:, None], fold, relu)

    @classmethod
    def training_spec(cls, data: TrainingSamples) -> TrainingSpec:
        return DeepSoRoTrainingSpec(data)


class DeepSoRoTrainingSpec(TrainingSpec):
    """Training by the squared chamfer distance, prototype and cloud drawn anew in every step."""

    batch, learning_rate = 256, 2e-3

    def __init__(self, data: TrainingSamples) -> None:
        super().__init__(data)
        self.prototype = data.points.rest[data.points.skin]

    def build_network(self) -> torch.nn.Module:
        import torch

        sizes = {
            "code": [self.input_size, 128, 128, CODE_SIZE],
            "lift": [3, LAYER_WIDTH, CODE_SIZE],
            "fold": [CODE_SIZE, LAYER_WIDTH, LAYER_WIDTH, 3],
        }
        return torch.nn.ModuleDict({name: build_perceptron(s, torch.nn.ReLU) for name, s in sizes.items()})

    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        chosen = rng.choice(len(self.prototype), PROTOTYPE_POINTS, replace=False)
        return (
            self._nearest(net, x, pick, (chosen, rng.choice(len(self.samples.skin.rest), CLOUD_POINTS, replace=False)))
            .square()
            .mean()
        )

    def validation_error(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        every = np.arange(0, len(self.prototype), 3), np.arange(0, len(self.samples.skin.rest), 4)
        return DISPLACEMENT_SCALE * self._nearest(net, x, pick, every).mean(dim=1).numpy()

    def _nearest(self, net: Any, x: torch.Tensor, pick: np.ndarray, points: tuple[np.ndarray, np.ndarray]) -> torch.Tensor:
        """Return distances (b, k + m), in DISPLACEMENT_SCALE, of decoded points from the nearest of the cloud, and the other way
        round."""
        import torch

        g = torch.from_numpy(self.prototype[points[0]].astype(np.float32))
        skin, nodes = self.samples.skin, self.samples.nodes[pick].reshape(len(pick), -1, 3)
        moved = np.einsum("pn,bnc->bpc", skin.weights[points[1]], nodes, optimize=True)
        cloud = ((skin.rest[points[1]] + moved) / DISPLACEMENT_SCALE).astype(np.float32)
        decoded, there = (
            g / DISPLACEMENT_SCALE + net["fold"](net["lift"](g / PLACE_SCALE) + net["code"](x)[:, None]),
            torch.from_numpy(cloud),
        )
        with torch.no_grad():
            apart = torch.cdist(decoded, there)
            of_decoded, of_there = apart.argmin(dim=2), apart.argmin(dim=1)
        return torch.cat([decoded - _gather_points(there, of_decoded), there - _gather_points(decoded, of_there)], dim=1).norm(
            dim=2
        )

    def export_arrays(self, net: Any) -> dict[str, Any]:
        return {k: v for name in ("code", "lift", "fold") for k, v in pack_layers(name, perceptron_layers(net[name])).items()}


def _gather_points(points: torch.Tensor, which: torch.Tensor) -> torch.Tensor:
    """Return points (b, m, 3) at `which` (b, k)."""
    return points.gather(1, which[:, :, None].expand(-1, -1, 3))
