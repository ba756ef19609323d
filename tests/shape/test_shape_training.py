"""Training of shape estimators: the same from any stop, stopped by held-out fingers, refused where data or files are not what they
should be. The shapes to learn from are smooth bends without any mechanics: what is learned of them does not matter here."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tools.benchmarks.shape.baselines.folding import (
    LARGEST_LAG_SHARE,
    POINT_DISPLACEMENT_SCALE,
    ROWS_BACK,
    FoldingTrainingSpec,
    history_features,
    previous_strains,
)
from twin.foundation.errors import DataError, UnknownNameError
from twin.mechanics.silicone import SoftBody, SoftStatics
from twin.mechanics.silicone.material.lattice import LEVELS_ACROSS
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.estimators.estimator import Z90, SensorReadings, estimators
from twin.shape.estimators.features import STRAIN_SCALE, network_features
from twin.shape.estimators.learned import LearnedEstimator
from twin.shape.estimators.weights import read_weights
from twin.shape.training.samples import disturb
from twin.shape.training.samples import load_samples as samples
from twin.shape.training.train import Checkpoint, TrainingConfig, hash_shards, train, train_and_write, trainable_estimator
from twin.shape.training.training_spec import TrainingSpec
from twin.shape.training_data.draw import CHAIN_LENGTH

CHAINS, EPOCHS = 30, 3
LEARNED = sorted(n for n, law in estimators().items() if issubclass(law, LearnedEstimator))
LAWS = pytest.mark.parametrize("name", LEARNED)


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of shards as the factory writes them."""
    folder, rng, n = tmp_path_factory.mktemp("shapes"), np.random.default_rng(0), CHAINS * CHAIN_LENGTH
    body = load("finger").build()
    assert isinstance(body, SoftBody)
    up = (body.lattice.nodes[LEVELS_ACROSS**2 :, 2] - body.cone.clamp) / body.cone.length
    bend = rng.normal(size=(n, 2)) * 8e-3
    nodes = np.einsum("nc,k->nkc", np.c_[bend, -20.0 * (bend**2).sum(axis=1)], up**2)
    nodes += 2e-4 * rng.normal(size=(n, 1, 3)) * up[:, None]
    kind = np.array(["free", "pushed", "both"])[np.arange(n) // CHAIN_LENGTH % 3]
    table = pa.table({"sample": np.arange(n), "converged": np.ones(n, bool), "kind": kind})
    lists = {"nodes": nodes.astype(np.float32), "strain": SoftStatics(body).sensor_signals(nodes)["strain"]}
    lists |= {"command": np.zeros((n, 4)), "tension": np.zeros((n, 4))}
    for name, values in lists.items():
        flat = values.reshape(n, -1)
        table = table.append_column(name, pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1]))
    pq.write_table(table, folder / "samples-00000.parquet")
    return folder


@LAWS
def test_a_killed_training_goes_on_to_the_same_weights(name: str, shapes: Path, tmp_path: Path) -> None:
    way, robot = TrainingConfig(name, hash_shards(shapes), EPOCHS, 7), load("finger")
    card = train_and_write(way, robot, shapes, tmp_path / "whole.npz")

    def kill(words: str) -> None:
        if words.startswith("epoch 2 "):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_and_write(way, robot, shapes, tmp_path / "killed.npz", kill)
    assert not (tmp_path / "killed.npz").exists()
    heard: list[str] = []
    again = train_and_write(way, robot, shapes, tmp_path / "killed.npz", heard.append)
    assert heard[0].startswith("epoch 3 ")
    assert again == card
    whole, killed = (read_weights(tmp_path / f"{n}.npz", trainable_estimator(name).weights_format()) for n in ("whole", "killed"))
    assert whole.keys() == killed.keys()
    assert all(np.array_equal(whole[k], killed[k]) for k in whole)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["killed.json", "killed.npz", "whole.json", "whole.npz"]


@LAWS
def test_the_card_says_what_was_done_and_the_band_holds_held_out_fingers(name: str, shapes: Path, tmp_path: Path) -> None:
    way = TrainingConfig(name, hash_shards(shapes), 2, 0)
    train_and_write(way, load("finger"), shapes, tmp_path / "w.npz")
    card = json.loads((tmp_path / "w.json").read_text())
    assert (card["data"], card["epochs"], card["estimator"]) == (hash_shards(shapes), 2, name)
    assert card["versions"]["torch"]
    assert "friction" in card["does_not_know"]
    assert set(card["by_kind_mm"]) == {"free", "pushed", "both"}
    data = samples(shapes, load("finger"))
    law = trainable_estimator(name)(
        Twin.of(load("finger")), read_weights(tmp_path / "w.npz", trainable_estimator(name).weights_format())
    )
    held = np.flatnonzero(data.held_out & ~data.pushed)
    strain, displacement = disturb(np.random.default_rng(1), data, held, dead=0.0)
    found = law.estimate(SensorReadings(strain, displacement, pushed=False))
    true = np.einsum("pn,bnc->bpc", data.point_weights, data.nodes[held].reshape(len(held), -1, 3))
    inside = np.linalg.norm(found.displacements - true, axis=2) < Z90 * found.std
    assert inside.mean() > 0.85  # 90 % by construction but for another draw of the noise


def test_rows_before_are_those_of_the_chain() -> None:
    """Two runs of rows; the first row of a run stands for what was before it."""
    x = np.arange(6.0)[:, None]
    follows = np.array([False, True, True, False, True, True])
    np.testing.assert_array_equal(previous_strains(x, follows, 2)[..., 0], [[0, 0, 1, 3, 3, 4], [0, 0, 0, 3, 3, 3]])
    np.testing.assert_array_equal(previous_strains(x, None, 2)[..., 0], [range(6), range(6)])


def test_a_history_is_felt_along_the_chain(shapes: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With no errors of sensors and rows half a sample apart, before are half-way points and the sample before; a lagging sensor
    differs from them by the recursion's own share."""
    data = samples(shapes, load("finger"))
    lesson = FoldingTrainingSpec(data)
    first = np.flatnonzero(data.previous == np.arange(len(data.previous)))
    assert (first % CHAIN_LENGTH == 0).all()
    assert len(first) == CHAINS
    way = lesson._way(np.array([5, 1, 0]), np.array([0.5, 1.0, 0.7]))
    s = data.strain
    np.testing.assert_allclose(way[:, 0], [s[5], (s[5] + s[4]) / 2, s[4], (s[4] + s[3]) / 2], atol=1e-12)
    np.testing.assert_allclose(way[:, 1], [s[1], s[0], s[0], s[0]], atol=1e-12)
    np.testing.assert_allclose(way[:, 2], np.tile(s[0], (4, 1)), atol=1e-12)
    for name in ("GAIN_ERROR_STD", "ZERO_ERROR_STD"):
        monkeypatch.setattr(f"twin.shape.training.samples.{name}", 0.0)
    monkeypatch.setattr("tools.benchmarks.shape.baselines.folding.STRAIN_NOISE_STD", 0.0)
    pick = np.arange(CHAIN_LENGTH - 4, CHAIN_LENGTH).repeat(50)
    monkeypatch.setattr("tools.benchmarks.shape.baselines.folding.FRESH_SHARE", 1.0)
    shown = lesson._felt(np.random.default_rng(0), pick, data.pushed[pick], 0.0)
    np.testing.assert_allclose(shown[:, :4] * STRAIN_SCALE, s[pick], atol=1e-8)  # single precision
    assert not shown[:, -4 * ROWS_BACK :].any()  # nothing before: no row differs
    monkeypatch.setattr("tools.benchmarks.shape.baselines.folding.FRESH_SHARE", 0.0)
    shown = lesson._felt(np.random.default_rng(0), pick, data.pushed[pick], 0.0)
    short = np.abs(shown[:, :4] * STRAIN_SCALE - s[pick])
    furthest = np.abs(s[pick] - lesson._way(pick, np.ones(len(pick)))).max(axis=0)  # a lagging strain lies among those passed
    assert (short <= LARGEST_LAG_SHARE * furthest + 1e-8).all()
    assert np.quantile(short / furthest, 0.9) > 0.05 * LARGEST_LAG_SHARE  # the way of a step, not of all three, is most of it


def lively(lesson: TrainingSpec) -> Any:
    """A network with weights of which every layer and input matters."""
    import torch

    torch.manual_seed(3)
    net = lesson.build_network()
    with torch.no_grad():
        for p in net.parameters():
            p.mul_(2.0)
    return net


def felt_as_learned(shapes: Path, name: str) -> tuple[Any, Any, np.ndarray, Any, np.ndarray]:
    """A lesson, its network, samples (b,) of one chain, the features by which the network is taught them, no sensor misread, and
    where (b, P, 3) m the estimator of the same weights sees the points move that feels them one after the other."""
    import torch

    robot = load("finger")
    data = samples(shapes, robot)
    law = trainable_estimator(name)
    lesson = law.training_spec(data)
    net, pick = lively(lesson), np.arange(CHAIN_LENGTH, CHAIN_LENGTH + 6)
    strain, displacement = data.strain[pick], 1e-3 * np.random.default_rng(0).normal(size=(len(pick), data.displacement.shape[1]))
    follows = np.arange(len(pick)) > 0
    seen = law(Twin.of(robot), lesson.export_arrays(net)).folded(SensorReadings(strain, displacement, False, follows))  # type: ignore[attr-defined]
    past = history_features(strain, previous_strains(strain, follows, ROWS_BACK), displacement, False)
    x = past if name == "folding" else network_features(strain, displacement, False)
    return lesson, net, pick, torch.from_numpy(x.astype(np.float32)), seen


def true_of(data: Any, weights: np.ndarray, pick: np.ndarray) -> np.ndarray:
    return np.einsum("pn,bnc->bpc", weights, data.nodes[pick].reshape(len(pick), -1, 3))


def test_what_is_taught_to_fold_is_what_folds(shapes: Path) -> None:
    """The error that training lessens is that of the estimator with the same weights. To 1e-6 m in single precision, of folds of
    some millimetres."""
    import torch

    lesson, net, pick, x, seen = felt_as_learned(shapes, "folding")
    data, points = lesson.samples, np.arange(0, len(lesson.samples.point_weights), 7)
    away = seen[:, points] - true_of(data, data.point_weights[points], pick)
    assert np.ptp(seen, axis=(0, 1)).min() > 1e-3, "a fold that depends on neither would hide where it is made"
    with torch.no_grad():
        np.testing.assert_allclose(POINT_DISPLACEMENT_SCALE * lesson._away(net, x, pick, points).numpy(), away, atol=1e-6)
        every = np.arange(0, len(data.point_weights), 5)
        error = np.linalg.norm(seen[:, every] - true_of(data, data.point_weights[every], pick), axis=2).mean(axis=1)
        np.testing.assert_allclose(lesson.validation_error(net, x, pick), error, atol=1e-6)


class Overlearned(TrainingSpec):
    """Errors on held-out fingers as given; the network is one number, which grows by the epoch."""

    batch, learning_rate = 512, 1.0

    def __init__(self, data: object, errors: list[float]) -> None:
        super().__init__(data)  # type: ignore[arg-type]
        self.errors = errors

    def build_network(self) -> object:  # type: ignore[override]
        import torch

        return torch.nn.Linear(1, 1, bias=False)

    def loss(self, net: object, x: object, pick: np.ndarray, rng: np.random.Generator) -> object:  # type: ignore[override]
        return -net.weight.sum()  # type: ignore[attr-defined]

    def validation_error(self, net: object, x: object, pick: np.ndarray) -> np.ndarray:
        return np.full(len(pick), self.errors.pop(0))

    def export_arrays(self, net: object) -> dict[str, np.ndarray]:
        return {"weight": net.weight.detach().numpy()}  # type: ignore[attr-defined]


def test_training_stops_by_held_out_fingers_and_keeps_the_best(shapes: Path, tmp_path: Path) -> None:
    """Of eight epochs the second is the best; a quarter of all, two, and one more bring nothing better."""
    data = samples(shapes, load("finger"))

    def result(name: str, errors: list[float], epochs: int) -> tuple[float, int]:
        checkpoint = Checkpoint(tmp_path / name, TrainingConfig("modal", "", epochs, 0))
        arrays, done = train(Overlearned(data, errors), checkpoint, lambda words: None)
        return float(arrays["weight"][0, 0]), done

    stopped, done = result("a", [3.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0], 8)
    assert done == 5
    best, _ = result("b", [3.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0], 8)
    later, _ = result("c", [3.0, 2.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0], 8)
    assert stopped == best < later


def test_whole_fingers_are_held_out(shapes: Path) -> None:
    held = samples(shapes, load("finger")).held_out.reshape(CHAINS, CHAIN_LENGTH)
    assert (held.all(axis=1) | ~held.any(axis=1)).all()
    assert held.any(axis=1).sum() == CHAINS // 10


def test_bad_orders_are_refused(shapes: Path, tmp_path: Path) -> None:
    robot, path = load("finger"), tmp_path / "w.npz"
    with pytest.raises(DataError, match="no weights to train"):
        train_and_write(TrainingConfig("physics", "", 1, 0), robot, shapes, path)
    with pytest.raises(UnknownNameError, match="modal"):
        train_and_write(TrainingConfig("modul", "", 1, 0), robot, shapes, path)
    with pytest.raises(DataError, match="twin generate"):
        train_and_write(TrainingConfig("modal", "", 1, 0), robot, tmp_path, path)
    with pytest.raises(DataError, match="no soft body"):
        train_and_write(TrainingConfig("modal", "", 1, 0), load("continuum"), shapes, path)
    with pytest.raises(DataError, match="no folder"):
        train_and_write(TrainingConfig("modal", "", 1, 0), robot, shapes, tmp_path / "nowhere/w.npz")
    checkpoint = Checkpoint(tmp_path / "w.npz.checkpoint", TrainingConfig("modal", "", 1, 1))
    checkpoint.write({})
    with pytest.raises(DataError, match="another training"):
        train_and_write(TrainingConfig("modal", "", 1, 0), robot, shapes, path)
    checkpoint.path.write_bytes(b"half")
    with pytest.raises(DataError, match="delete it"):
        train_and_write(TrainingConfig("modal", "", 1, 0), robot, shapes, path)
    assert not path.exists()
