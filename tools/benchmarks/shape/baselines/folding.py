"""KineSoft's estimator: strains to the displacement of every vertex, by a decoder after FoldingNet.

    c = MLP(features),      f_1 = MLP(c, g),      displacement = MLP(c, f_1),      g the vertex's place at rest

Two folds (Yang et al. 2018, arXiv 1712.07262) of the finger's own points in place of a grid; trained by the mean squared
displacement error, correspondence known (Yoo et al. 2025, arXiv 2503.01078; layer sizes are not published, these are ours). As in
the paper it takes a history of strains, those of the `ROWS_BACK` rows before too. An elastic body's shape follows from its present
loads; history shows the sensors' noise and lag. The training shapes have no clock, so rows before lie anywhere from here to one
sample further back a row on the chain's way, and of strains a share lags,

    z_k = z_(k-1) + a (eps_k - z_(k-1)),        read_k = eps_k - share (eps_k - z_k)

with shares up to LARGEST_LAG_SHARE and a from SLOWEST_PACE to 1.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.robots import Robot
from twin.shape.estimators.estimator import SensorReadings
from twin.shape.estimators.features import network_features
from twin.shape.estimators.learned import LearnedEstimator
from twin.shape.estimators.weights import pack_layers, perceptron, relu, unpack_layers
from twin.shape.training.samples import (
    DEAD_SENSOR_SHARE,
    SHOWN_AS_PUSHED_SHARE,
    STRAIN_NOISE_STD,
    TrainingSamples,
    add_sensor_errors,
    drop_sensors,
    read_displacements,
)
from twin.shape.training.training_spec import TrainingSpec, build_perceptron, perceptron_layers

if TYPE_CHECKING:
    import torch

PLACE_SCALE, POINT_DISPLACEMENT_SCALE = 0.05, 0.01  # m: sizes that count as one
CODE_SIZE, FOLD_WIDTH = 64, 64
POINTS_PER_STEP = 96  # points of a sample in one training step
ROWS_BACK = 3  # rows of history
STRAIN_CHANGE_SCALE = 0.01  # strain that counts as one, of differences from earlier rows
LARGEST_LAG_SHARE, SLOWEST_PACE = 0.1, 0.2  # of a strain that lags, and the least part of its way from row to row
FRESH_SHARE = 0.2  # of the samples are shown without history


class FoldingEstimator(LearnedEstimator):
    """A decoder with a history of `ROWS_BACK` rows; a row that follows none starts anew, as if at rest there.

    It has no error of its own: (share (n, 1) |moved|)^2 + rest^2 of `error`, fitted to held-out fingers.
    """

    description = "KineSoft's way: a decoder that folds the rest shape, vertex by vertex"

    @classmethod
    def weights_format(cls) -> str:
        return f"twin-{cls.name()}/4"  # 3 had no history

    @classmethod
    def weights_path(cls, robot: Robot) -> Path:
        """Return the weights' file in this package."""
        return Path(__file__).parent / "weights" / f"{cls.name()}.npz"

    def decode(self, felt: SensorReadings) -> tuple[np.ndarray, np.ndarray]:
        moved = self.folded(felt)
        moved[:, self.points.rest[:, 2] <= self.body.cone.clamp] = 0.0
        share, rest = self.arrays["error"]
        return moved, np.hypot(share * np.linalg.norm(moved, axis=2), rest)

    def folded(self, felt: SensorReadings) -> np.ndarray:
        """Return displacements (n, P, 3) m of the points as the network has them, the clamped ones too."""
        code, first, second = (unpack_layers(name, self.arrays) for name in ("code", "first", "second"))
        x = history_features(felt.strain, previous_strains(felt.strain, felt.follows, ROWS_BACK), felt.displacement, felt.pushed)
        c = perceptron(x, code, relu)
        place = np.broadcast_to(self.points.rest / PLACE_SCALE, (len(c), *self.points.rest.shape))
        return POINT_DISPLACEMENT_SCALE * _fold(c, _fold(c, place, first), second)

    @classmethod
    def training_spec(cls, data: TrainingSamples) -> TrainingSpec:
        return FoldingTrainingSpec(data)


def previous_strains(strain: np.ndarray, follows: np.ndarray | None, back: int) -> np.ndarray:
    """Return the strains (back, n, s) of the 1 to `back` rows before each of (n, s); where nothing is before, those of the
    first."""
    row = np.arange(len(strain))
    started = np.ones(len(strain), bool) if follows is None else ~np.asarray(follows, bool)
    found = []
    for _ in range(back):
        row = np.where(started[row] | (row == 0), row, row - 1)
        found.append(strain[row])
    return np.stack(found)


def history_features(strain: np.ndarray, before: np.ndarray, displacement: np.ndarray, pushed: np.ndarray | bool) -> np.ndarray:
    """Return features (n, f) of strains (n, s) and of their differences from those before (ROWS_BACK, n, s), zero where missing."""
    change = np.where(np.isfinite(before - strain), before - strain, 0.0) / STRAIN_CHANGE_SCALE
    return np.concatenate([network_features(strain, displacement, pushed), *change], axis=1)


def _fold(c: np.ndarray, places: np.ndarray, layers: Any) -> np.ndarray:
    """Return (n, P, 3) of codes (n, CODE_SIZE) and places (n, P, 3): the perceptron of both, the code's part once a sample."""
    (weight, bias), *rest = layers
    first = (c @ weight[:, :CODE_SIZE].T + bias)[:, None] + places @ weight[:, CODE_SIZE:].T
    return perceptron(relu(first), rest, relu)


class FoldingTrainingSpec(TrainingSpec):
    """Training by the mean squared error of the vertices' displacements, some of the vertices at a time."""

    batch, learning_rate = 512, 2e-3

    def __init__(self, data: TrainingSamples) -> None:
        super().__init__(data)
        self.input_size += ROWS_BACK * data.strain.shape[1]

    def training_features(self, rng: np.random.Generator, pick: np.ndarray) -> np.ndarray:
        pressed = self.samples.pushed[pick] | (rng.uniform(size=len(pick)) < SHOWN_AS_PUSHED_SHARE)
        return self._felt(rng, pick, pressed, DEAD_SENSOR_SHARE)

    def validation_features(self, rng: np.random.Generator, held: np.ndarray) -> np.ndarray:
        return self._felt(rng, held, self.samples.pushed[held], 0.0)

    def _felt(self, rng: np.random.Generator, pick: np.ndarray, pressed: np.ndarray, dead: float) -> np.ndarray:
        """Return features (b, f) of samples with their history, as sensors read them."""
        fresh = rng.uniform(size=len(pick)) < FRESH_SHARE
        way = self._way(pick, np.where(fresh, 0.0, rng.uniform(size=len(pick))))
        share, pace = LARGEST_LAG_SHARE * rng.uniform(size=(len(pick), 1)), rng.uniform(SLOWEST_PACE, 1.0, (len(pick), 1))
        late, lagging = way[-1].copy(), []
        for strain in way[::-1]:
            late += pace * (strain - late)
            lagging.append(strain - share * (strain - late))
        here = self.samples.strain[pick]
        off = add_sensor_errors(rng, here) - here  # alike in all rows
        noise = STRAIN_NOISE_STD * rng.normal(size=(ROWS_BACK + 1, *here.shape))
        noise = np.where(fresh[:, None], noise[0], noise)
        now, *before = np.stack(lagging[::-1]) + off + noise
        return history_features(
            drop_sensors(rng, now, dead), np.stack(before), read_displacements(rng, self.samples, pick), pressed
        ).astype(np.float32)

    def _way(self, pick: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return strains (ROWS_BACK + 1, b, s) at and before samples (b,), rows a part `step` (b,) of a sample apart."""
        strain, before, nearer, done, found = self.samples.strain, self.samples.previous, pick, np.zeros(len(pick), int), []
        for k in range(ROWS_BACK + 1):
            while (further := k * step - done >= 1.0).any():
                nearer, done = np.where(further, before[nearer], nearer), done + further
            part = (k * step - done)[:, None]
            found.append((1.0 - part) * strain[nearer] + part * strain[before[nearer]])
        return np.stack(found)

    def build_network(self) -> torch.nn.Module:
        import torch

        def two() -> torch.nn.Module:
            return build_perceptron([CODE_SIZE + 3, FOLD_WIDTH, FOLD_WIDTH, 3], torch.nn.ReLU)

        code = build_perceptron([self.input_size, 128, 128, CODE_SIZE], torch.nn.ReLU)
        return torch.nn.ModuleDict({"code": code, "first": two(), "second": two()})

    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        return self._away(net, x, pick, rng.choice(len(self.samples.point_weights), POINTS_PER_STEP, replace=False)).square().mean()

    def validation_error(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        every = np.arange(0, len(self.samples.point_weights), 5)
        return POINT_DISPLACEMENT_SCALE * self._away(net, x, pick, every).norm(dim=2).mean(dim=1).numpy()

    def _away(self, net: Any, x: torch.Tensor, pick: np.ndarray, points: np.ndarray) -> torch.Tensor:
        """Return the errors (b, k, 3) of these points, in POINT_DISPLACEMENT_SCALE."""
        import torch

        true = np.einsum(
            "pn,bnc->bpc", self.samples.point_weights[points], self.samples.nodes[pick].reshape(len(pick), -1, 3), optimize=True
        )
        c = net["code"](x)[:, None].expand(-1, len(points), -1)
        place = torch.from_numpy((self.samples.points.rest[points] / PLACE_SCALE).astype(np.float32)).expand(len(x), -1, -1)
        folded = net["second"](torch.cat([c, net["first"](torch.cat([c, place], dim=2))], dim=2))
        return folded - torch.from_numpy((true / POINT_DISPLACEMENT_SCALE).astype(np.float32))

    def export_arrays(self, net: Any) -> dict[str, Any]:
        return {k: v for name in ("code", "first", "second") for k, v in pack_layers(name, perceptron_layers(net[name])).items()}
