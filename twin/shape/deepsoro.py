"""A baseline: after DeepSoRo (Wang et al. 2020, arXiv 1904.03820), a decoder that learns surfaces from unordered points.

    c = MLP(features),      b = MLP(g),      place = g + MLP(b + c),      g a prototype point

trained by the symmetric chamfer distance between the decoded prototype and a cloud of the true skin, without correspondence. Of
DeepSoRo it keeps the code that is added to the lifted prototype, one fold, and the loss. The encoder takes what is felt in place of
camera images; the prototype, a half cylinder there, is the finger's own skin at rest, to which the fold is added, so that points
have names, as far as the chamfer distance lets them keep theirs. Points inside are where the fold, which has seen none, takes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.shape.estimator import Felt
from twin.shape.features import features
from twin.shape.folding import MOVE, PLACE
from twin.shape.learned import Pointwise
from twin.shape.lesson import Data, Lesson, layers_of, torch_perceptron
from twin.shape.weights import pack, perceptron, relu, unpack

if TYPE_CHECKING:
    import torch

CODE, WIDTH = 64, 64
POINTS, CLOUD = 96, 192  # of the prototype and of the true skin, that a step of training sees


class DeepSoRo(Pointwise):
    """Remembers nothing."""

    about = "after DeepSoRo: a decoder trained by chamfer distance, without correspondence"
    unknown = "which point is which, and points inside"

    def moved(self, felt: Felt) -> np.ndarray:
        code, lift, fold = (unpack(name, self.arrays) for name in ("code", "lift", "fold"))
        c = perceptron(features(felt.strain, felt.displacement, felt.pushed), code, relu)
        b = perceptron(self.points.rest / PLACE, lift, relu)
        return MOVE * perceptron(b + c[:, None], fold, relu)

    @classmethod
    def lesson(cls, data: Data) -> Lesson:
        return DeepSoRoLesson(data)


class DeepSoRoLesson(Lesson):
    """Squared chamfer distance, prototype and cloud drawn anew in every step."""

    batch, rate = 256, 2e-3

    def __init__(self, data: Data) -> None:
        super().__init__(data)
        self.prototype = data.points.rest[data.points.skin]

    def network(self) -> torch.nn.Module:
        import torch

        sizes = {"code": [self.inputs, 128, 128, CODE], "lift": [3, WIDTH, CODE], "fold": [CODE, WIDTH, WIDTH, 3]}
        return torch.nn.ModuleDict({name: torch_perceptron(s, torch.nn.ReLU) for name, s in sizes.items()})

    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        chosen = rng.choice(len(self.prototype), POINTS, replace=False)
        return self._nearest(net, x, pick, (chosen, rng.choice(len(self.data.skin.rest), CLOUD, replace=False))).square().mean()

    def missed(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        every = np.arange(0, len(self.prototype), 3), np.arange(0, len(self.data.skin.rest), 4)
        return MOVE * self._nearest(net, x, pick, every).mean(dim=1).numpy()

    def _nearest(self, net: Any, x: torch.Tensor, pick: np.ndarray, points: tuple[np.ndarray, np.ndarray]) -> torch.Tensor:
        """(b, k + m) distances, in MOVE, of decoded points from the nearest of the cloud, and of the cloud's from the decoded."""
        import torch

        g = torch.from_numpy(self.prototype[points[0]].astype(np.float32))
        skin, nodes = self.data.skin, self.data.nodes[pick].reshape(len(pick), -1, 3)
        moved = np.einsum("pn,bnc->bpc", skin.weights[points[1]], nodes, optimize=True)
        cloud = ((skin.rest[points[1]] + moved) / MOVE).astype(np.float32)
        decoded, there = g / MOVE + net["fold"](net["lift"](g / PLACE) + net["code"](x)[:, None]), torch.from_numpy(cloud)
        with torch.no_grad():
            apart = torch.cdist(decoded, there)
            of_decoded, of_there = apart.argmin(dim=2), apart.argmin(dim=1)
        return torch.cat([decoded - _taken(there, of_decoded), there - _taken(decoded, of_there)], dim=1).norm(dim=2)

    def arrays(self, net: Any) -> dict[str, Any]:
        return {k: v for name in ("code", "lift", "fold") for k, v in pack(name, layers_of(net[name])).items()}


def _taken(points: torch.Tensor, which: torch.Tensor) -> torch.Tensor:
    """points (b, m, 3) at `which` (b, k)."""
    return points.gather(1, which[:, :, None].expand(-1, -1, 3))
