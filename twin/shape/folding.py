"""A baseline: KineSoft's estimator, strains to the displacement of every vertex by a decoder after FoldingNet.

    c = MLP(features),      f_1 = MLP(c, g),      displacement = MLP(c, f_1),      g the vertex's place at rest

Two folds (Yang et al. 2018, arXiv 1712.07262), the grid in place of which the finger's own points are folded; trained by the mean
squared displacement error, correspondence known (Yoo et al. 2025, arXiv 2503.01078; layer sizes are not published, these are ours).
The paper feeds a history of strains. This one remembers nothing: the factory's shapes are equilibria of an elastic body, each
following from what acts on it now, and its chains have no clock; hysteresis and drift of sensors are undone before, which left
0.03 mm (`modal`, bench day 515, a lag of 27 % over 4.5 s) for a history to gain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.shape.estimator import Felt
from twin.shape.features import features
from twin.shape.learned import Pointwise
from twin.shape.lesson import Data, Lesson, layers_of, torch_perceptron
from twin.shape.weights import pack, perceptron, relu, unpack

if TYPE_CHECKING:
    import torch

CODE, WIDTH = 64, 64
PLACE, MOVE = 0.05, 0.01  # m: sizes that count as one
POINTS = 96  # of a sample that a step of training sees


class Folding(Pointwise):
    """Remembers nothing."""

    about = "KineSoft's way: a decoder that folds the rest shape, vertex by vertex"
    unknown = "histories of strain"

    def moved(self, felt: Felt) -> np.ndarray:
        code, first, second = (unpack(name, self.arrays) for name in ("code", "first", "second"))
        c = perceptron(features(felt.strain, felt.displacement, felt.pushed), code, relu)
        place = np.broadcast_to(self.points.rest / PLACE, (len(c), *self.points.rest.shape))
        return MOVE * _fold(c, _fold(c, place, first), second)

    @classmethod
    def lesson(cls, data: Data) -> Lesson:
        return FoldingLesson(data)


def _fold(c: np.ndarray, places: np.ndarray, layers: Any) -> np.ndarray:
    """(n, P, 3) of codes (n, CODE) and places (n, P, 3): the perceptron of both, the code's share reckoned once a sample."""
    (weight, bias), *rest = layers
    first = (c @ weight[:, :CODE].T + bias)[:, None] + places @ weight[:, CODE:].T
    return perceptron(relu(first), rest, relu)


class FoldingLesson(Lesson):
    """Mean squared error of the vertices' displacements, by some of the vertices at a time."""

    batch, rate = 512, 2e-3

    def network(self) -> torch.nn.Module:
        import torch

        def two() -> torch.nn.Module:
            return torch_perceptron([CODE + 3, WIDTH, WIDTH, 3], torch.nn.ReLU)

        code = torch_perceptron([self.inputs, 128, 128, CODE], torch.nn.ReLU)
        return torch.nn.ModuleDict({"code": code, "first": two(), "second": two()})

    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        return self._away(net, x, pick, rng.choice(len(self.data.weights), POINTS, replace=False)).square().mean()

    def missed(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        every = np.arange(0, len(self.data.weights), 5)
        return MOVE * self._away(net, x, pick, every).norm(dim=2).mean(dim=1).numpy()

    def _away(self, net: Any, x: torch.Tensor, pick: np.ndarray, points: np.ndarray) -> torch.Tensor:
        """(b, k, 3) of these points, in MOVE."""
        import torch

        true = np.einsum("pn,bnc->bpc", self.data.weights[points], self.data.nodes[pick].reshape(len(pick), -1, 3), optimize=True)
        c = net["code"](x)[:, None].expand(-1, len(points), -1)
        place = torch.from_numpy((self.data.points.rest[points] / PLACE).astype(np.float32)).expand(len(x), -1, -1)
        folded = net["second"](torch.cat([c, net["first"](torch.cat([c, place], dim=2))], dim=2))
        return folded - torch.from_numpy((true / MOVE).astype(np.float32))

    def arrays(self, net: Any) -> dict[str, Any]:
        return {k: v for name in ("code", "first", "second") for k, v in pack(name, layers_of(net[name])).items()}
