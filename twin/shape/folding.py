"""A baseline: KineSoft's estimator, strains to the displacement of every vertex by a decoder after FoldingNet.

    c = MLP(features),      f_1 = MLP(c, g),      displacement = MLP(c, f_1),      g the vertex's place at rest

Two folds (Yang et al. 2018, arXiv 1712.07262), the grid in place of which the finger's own points are folded; trained by the mean
squared displacement error, correspondence known (Yoo et al. 2025, arXiv 2503.01078; layer sizes are not published, these are ours).
As in the paper it is fed a history of strains, those of the `BACK` rows before too. An elastic body's shape follows from what acts
on it now; what history tells is the sensors' share, their noise and how they lag. The factory's shapes have no clock, so rows
before lie anywhere from here to one sample further back a row on the chain's way, and of strains a share lags,

    z_k = z_(k-1) + a (eps_k - z_(k-1)),        felt_k = eps_k - share (eps_k - z_k),        share up to LAG, a from SLOW to 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.shape.estimator import Felt
from twin.shape.features import features, recalled
from twin.shape.learned import Pointwise
from twin.shape.lesson import (
    DEAD,
    DOUBT,
    STRAIN_NOISE,
    Data,
    Lesson,
    displaced,
    layers_of,
    misread,
    torch_perceptron,
    with_dead,
)  # fmt: skip
from twin.shape.weights import pack, perceptron, relu, unpack

if TYPE_CHECKING:
    import torch

CODE, WIDTH = 64, 64
PLACE, MOVE = 0.05, 0.01  # m: sizes that count as one
POINTS = 96  # of a sample that a step of training sees
BACK = 3  # rows remembered
CHANGE = 0.01  # strain that counts as one, of what differs from a row to those before
LAG, SLOW = 0.1, 0.2  # the largest share of a strain that lags, and the least of its way that it goes from row to row
FRESH = 0.2  # of the samples are shown as if nothing had been before


class Folding(Pointwise):
    """Remembers the `BACK` rows before, where rows follow each other; a row that follows none starts anew, as if at rest there."""

    about = "KineSoft's way: a decoder that folds the rest shape, vertex by vertex"

    @classmethod
    def form(cls) -> str:
        return f"twin-{cls.name()}/4"  # 3 had no history

    def moved(self, felt: Felt) -> np.ndarray:
        code, first, second = (unpack(name, self.arrays) for name in ("code", "first", "second"))
        x = with_history(felt.strain, recalled(felt.strain, felt.follows, BACK), felt.displacement, felt.pushed)
        c = perceptron(x, code, relu)
        place = np.broadcast_to(self.points.rest / PLACE, (len(c), *self.points.rest.shape))
        return MOVE * _fold(c, _fold(c, place, first), second)

    @classmethod
    def lesson(cls, data: Data) -> Lesson:
        return FoldingLesson(data)


def with_history(strain: np.ndarray, before: np.ndarray, displacement: np.ndarray, pushed: np.ndarray | bool) -> np.ndarray:
    """Features (n, f) of strains (n, s), by how much those before (BACK, n, s) differed, zero where either is missing, and the
    rest."""
    change = np.where(np.isfinite(before - strain), before - strain, 0.0) / CHANGE
    return np.concatenate([features(strain, displacement, pushed), *change], axis=1)


def _fold(c: np.ndarray, places: np.ndarray, layers: Any) -> np.ndarray:
    """(n, P, 3) of codes (n, CODE) and places (n, P, 3): the perceptron of both, the code's share reckoned once a sample."""
    (weight, bias), *rest = layers
    first = (c @ weight[:, :CODE].T + bias)[:, None] + places @ weight[:, CODE:].T
    return perceptron(relu(first), rest, relu)


class FoldingLesson(Lesson):
    """Mean squared error of the vertices' displacements, by some of the vertices at a time."""

    batch, rate = 512, 2e-3

    def __init__(self, data: Data) -> None:
        super().__init__(data)
        self.inputs += BACK * data.strain.shape[1]

    def shown(self, rng: np.random.Generator, pick: np.ndarray) -> np.ndarray:
        pressed = self.data.pushed[pick] | (rng.uniform(size=len(pick)) < DOUBT)
        return self._felt(rng, pick, pressed, DEAD)

    def asked(self, rng: np.random.Generator, held: np.ndarray) -> np.ndarray:
        return self._felt(rng, held, self.data.pushed[held], 0.0)

    def _felt(self, rng: np.random.Generator, pick: np.ndarray, pressed: np.ndarray, dead: float) -> np.ndarray:
        """Features (b, f) of samples and of what was before them, as they would be felt."""
        fresh = rng.uniform(size=len(pick)) < FRESH
        way = self._way(pick, np.where(fresh, 0.0, rng.uniform(size=len(pick))))
        share, pace = LAG * rng.uniform(size=(len(pick), 1)), rng.uniform(SLOW, 1.0, (len(pick), 1))
        late, lagging = way[-1].copy(), []
        for strain in way[::-1]:
            late += pace * (strain - late)
            lagging.append(strain - share * (strain - late))
        here = self.data.strain[pick]
        off = misread(rng, here) - here  # alike in all rows
        noise = STRAIN_NOISE * rng.normal(size=(BACK + 1, *here.shape))
        noise = np.where(fresh[:, None], noise[0], noise)
        now, *before = np.stack(lagging[::-1]) + off + noise
        return with_history(with_dead(rng, now, dead), np.stack(before), displaced(rng, self.data, pick), pressed).astype(
            np.float32
        )

    def _way(self, pick: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Strains (BACK + 1, b, s) at and before samples (b,), rows a part `step` (b,) of the way from sample to sample apart."""
        strain, before, nearer, done, found = self.data.strain, self.data.before, pick, np.zeros(len(pick), int), []
        for k in range(BACK + 1):
            while (further := k * step - done >= 1.0).any():
                nearer, done = np.where(further, before[nearer], nearer), done + further
            part = (k * step - done)[:, None]
            found.append((1.0 - part) * strain[nearer] + part * strain[before[nearer]])
        return np.stack(found)

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
