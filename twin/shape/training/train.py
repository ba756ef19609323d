"""Train an estimator on shards (torch), resumable after any interruption.

Each epoch has a random stream of its own, so that a resumed training needs only the last epoch's checkpoint. The learning rate
falls by a cosine. The weights kept are those of the epoch with the least error on held-out fingers; training ends where a quarter
of the epochs has brought no better ones.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError, TwinError
from twin.robots import Robot
from twin.shape.estimators.estimator import estimator_class, estimators
from twin.shape.estimators.learned import LearnedEstimator
from twin.shape.estimators.weights import write_weights
from twin.shape.training.held_out_evaluation import evaluate_held_out, model_card
from twin.shape.training.samples import load_samples
from twin.shape.training.training_spec import TrainingSpec

if TYPE_CHECKING:
    import torch

PATIENCE_DIVISOR = 4  # training ends after this fraction of all epochs without a better one
MOST_VALIDATION_SAMPLES = 4096  # held-out samples that stop the training, at most


@dataclass(frozen=True)
class TrainingConfig:
    """Settings that, with the code, determine every weight: estimator, data (a hash of the shards), most epochs, seed."""

    estimator: str
    data: str
    epochs: int
    seed: int


def train_and_write(
    config: TrainingConfig, robot: Robot, folder: Path, path: Path, progress: Callable[[str], None] = lambda words: None
) -> dict[str, Any]:
    """Train on the shards in `folder`, write weights to `path` and a card beside them, and return the card.

    Resumes from `path`.checkpoint where a training with the same settings left one. Raises DataError for shards that cannot be read
    or are of another robot, or a checkpoint of other settings, TwinError without torch, UnknownNameError for an unknown estimator.
    """
    estimator = trainable_estimator(config.estimator)
    if importlib.util.find_spec("torch") is None:
        raise TwinError("training needs torch, which is not installed; pip install 'tendon-twin[learn]'")
    if not path.absolute().parent.is_dir():
        raise DataError(f"{path.absolute().parent} is no folder; make it, or give another file with --out")
    with threadpool_limits(limits=1):
        samples = load_samples(folder, robot)
        spec = estimator.training_spec(samples)
        checkpoint = Checkpoint(path.with_name(path.name + ".checkpoint"), config)
        arrays, epochs_done = train(spec, checkpoint, progress)
        arrays, errors = evaluate_held_out(estimator, arrays, samples, robot)
    card = model_card(estimator, robot, samples, errors) | asdict(config) | {"epochs_done": epochs_done}
    write_weights(path, arrays)
    write_atomically(path.with_suffix(".json"), (json.dumps(card, indent=1) + "\n").encode())
    checkpoint.path.unlink(missing_ok=True)
    return card


def trainable_estimator(name: str) -> type[LearnedEstimator]:
    """Return the estimator of this name. Raises DataError for one without weights."""
    estimator = estimator_class(name)
    if not issubclass(estimator, LearnedEstimator):
        which = [n for n, each in estimators().items() if issubclass(each, LearnedEstimator)]
        raise DataError(f"estimator {name!r} has no weights to train; those with weights are {', '.join(sorted(which))}")
    return estimator


@dataclass(frozen=True)
class Checkpoint:
    """A training after a whole epoch, on disk."""

    path: Path
    config: TrainingConfig

    def read(self) -> dict[str, Any] | None:
        """Return the last checkpoint, or None. Raises DataError for other settings or a broken file."""
        import torch

        if not self.path.exists():
            return None
        try:
            state = torch.load(self.path, weights_only=True)
            way = state["way"]
        except Exception as fault:  # torch raises of many kinds for a broken file
            raise DataError(f"{self.path}: no checkpoint of this program ({type(fault).__name__}); delete it") from None
        if way != asdict(self.config):
            raise DataError(f"{self.path} is of another training ({way}); delete it, or give another file with --out")
        return state

    def write(self, state: dict[str, Any]) -> None:
        """Write a checkpoint, whole or not at all."""
        import torch

        write_atomically(self.path, lambda file: torch.save({"way": asdict(self.config), **state}, file))


def train(spec: TrainingSpec, checkpoint: Checkpoint, progress: Callable[[str], None]) -> tuple[dict[str, Any], int]:
    """Return the arrays of the best epoch, and how many epochs were done."""
    import torch

    config, samples = checkpoint.config, spec.samples
    torch.manual_seed(config.seed)
    torch.set_num_threads(1)  # a network this small gains nothing by two threads
    net = spec.build_network()
    optimizer = torch.optim.AdamW(net.parameters(), lr=spec.learning_rate, weight_decay=1e-5)
    training, validation = np.flatnonzero(~samples.held_out), np.flatnonzero(samples.held_out)
    validation = validation[:: -(-len(validation) // MOST_VALIDATION_SAMPLES)]
    features = torch.from_numpy(spec.validation_features(np.random.default_rng([config.seed, 2**31]), validation))
    state: dict[str, Any] = {"epoch": 0, "best": math.inf, "at": 0, "weights": None}
    if (checkpointed := checkpoint.read()) is not None:
        state = {name: checkpointed[name] for name in state}
        net.load_state_dict(checkpointed["net"])
        optimizer.load_state_dict(checkpointed["optimizer"])
    while state["epoch"] < config.epochs and (state["epoch"] - state["at"]) * PATIENCE_DIVISOR <= config.epochs:
        rng = np.random.default_rng([config.seed, state["epoch"]])
        _run_epoch(spec, net, optimizer, rng, training, state["epoch"] / config.epochs, 1.0 / config.epochs)
        with torch.no_grad():
            parts = np.array_split(np.arange(len(validation)), -(-len(validation) // spec.batch))
            error = float(np.concatenate([spec.validation_error(net, features[p], validation[p]) for p in parts]).mean())
        state["epoch"] += 1
        if error < state["best"]:
            weights = {name: value.clone() for name, value in net.state_dict().items()}
            state |= {"best": error, "at": state["epoch"], "weights": weights}
        checkpoint.write(state | {"net": net.state_dict(), "optimizer": optimizer.state_dict()})
        progress(f"epoch {state['epoch']} of {config.epochs}: {1e3 * error:.3f} mm on held-out fingers")
    net.load_state_dict(state["weights"])
    return spec.export_arrays(net), state["epoch"]


def _run_epoch(
    spec: TrainingSpec, net: torch.nn.Module, optimizer: torch.optim.Optimizer, rng: np.random.Generator, training: np.ndarray,
    start: float, share: float,
) -> None:  # fmt: skip
    """Pass once over the samples `training`, from the fraction `start` of all training on, which is `share` of it."""
    import torch

    order, size = rng.permutation(training), min(spec.batch, len(training))
    steps = len(training) // size
    for b in range(steps):
        pick = order[b * size : (b + 1) * size]
        optimizer.param_groups[0]["lr"] = spec.learning_rate * 0.5 * (1.0 + math.cos(math.pi * (start + share * b / steps)))
        loss = spec.loss(net, torch.from_numpy(spec.training_features(rng, pick)), pick, rng)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


def hash_shards(folder: Path) -> str:
    """Return the SHA-256 of the shards, in order."""
    total = hashlib.sha256()
    for path in sorted(folder.glob("samples-*.parquet")):
        total.update(path.read_bytes())
    return total.hexdigest()
