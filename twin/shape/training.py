"""Training of an estimator on the factory's shards (torch).

Each epoch draws from a stream of its own, so that what is left after a kill is the last epoch's checkpoint and nothing else. The
rate falls by a cosine; the weights kept are those of the epoch with the least error on held-out fingers, and where a quarter of the
epochs has brought no better ones, training ends.
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

from twin.errors import DataError, TwinError
from twin.robots import Robot
from twin.shape.estimator import estimator, estimators
from twin.shape.judge import card_of, judged
from twin.shape.learned import Learned
from twin.shape.lesson import Lesson, load
from twin.shape.weights import write_weights

if TYPE_CHECKING:
    import torch

PATIENCE = 4  # one part in so many of all epochs
JUDGED = 4096  # held-out samples that stop the training, at most


@dataclass(frozen=True)
class Way:
    """What, with the code, decides every weight: estimator, data (a hash of the shards), epochs at most, seed."""

    estimator: str
    data: str
    epochs: int
    seed: int


def write_trained(
    way: Way, robot: Robot, folder: Path, path: Path, progress: Callable[[str], None] = lambda words: None
) -> dict[str, Any]:
    """Train on the shards in `folder` and write weights to `path` and a card beside them, which is returned.

    Goes on from `path`.checkpoint where a training of the same way left one. Raises DataError for shards that cannot be read or are
    of another robot, or another way's checkpoint, TwinError without torch, UnknownNameError for an estimator that does not exist.
    """
    law = taught(way.estimator)
    if importlib.util.find_spec("torch") is None:
        raise TwinError("training needs torch, which is not installed; pip install 'tendon-twin[learn]'")
    if not path.absolute().parent.is_dir():
        raise DataError(f"{path.absolute().parent} is no folder; make it, or give another file with --out")
    with threadpool_limits(limits=1):
        data = load(folder, robot)
        lesson = law.lesson(data)
        checkpoint = Checkpoint(path.with_name(path.name + ".checkpoint"), way)
        arrays, done = train(lesson, checkpoint, progress)
        arrays, errors = judged(law, arrays, data, robot)
    card = card_of(law, robot, data, errors) | asdict(way) | {"epochs_done": done}
    write_weights(path, arrays)
    part = path.with_suffix(".json.part")
    part.write_text(json.dumps(card, indent=1) + "\n", "utf-8")
    part.replace(path.with_suffix(".json"))
    checkpoint.path.unlink(missing_ok=True)
    return card


def taught(name: str) -> type[Learned]:
    """The estimator of this name. Raises DataError for one that has nothing to learn."""
    law = estimator(name)
    if not issubclass(law, Learned):
        which = [n for n, each in estimators().items() if issubclass(each, Learned)]
        raise DataError(f"estimator {name!r} has nothing to learn; those that have are {', '.join(sorted(which))}")
    return law


@dataclass(frozen=True)
class Checkpoint:
    """A training after some whole epoch, on disk."""

    path: Path
    way: Way

    def read(self) -> dict[str, Any] | None:
        """What was written last; None where nothing was. Raises DataError for another way's, or a broken file."""
        import torch

        if not self.path.exists():
            return None
        try:
            found = torch.load(self.path, weights_only=True)
            way = found["way"]
        except Exception as fault:  # torch raises of many kinds for a broken file
            raise DataError(f"{self.path}: no checkpoint of this program ({type(fault).__name__}); delete it") from None
        if way != asdict(self.way):
            raise DataError(f"{self.path} is of another training ({way}); delete it, or give another file with --out")
        return found

    def write(self, state: dict[str, Any]) -> None:
        import torch

        part = self.path.with_name(self.path.name + ".part")
        torch.save({"way": asdict(self.way), **state}, part)
        part.replace(self.path)


def train(lesson: Lesson, checkpoint: Checkpoint, progress: Callable[[str], None]) -> tuple[dict[str, Any], int]:
    """The arrays of the best epoch, and how many were done."""
    import torch

    way, data = checkpoint.way, lesson.data
    torch.manual_seed(way.seed)
    torch.set_num_threads(1)  # so small a net gains nothing by two, and loses much on a busy machine
    net = lesson.network()
    optimizer = torch.optim.AdamW(net.parameters(), lr=lesson.rate, weight_decay=1e-5)
    chosen, held = np.flatnonzero(~data.held), np.flatnonzero(data.held)
    held = held[:: -(-len(held) // JUDGED)]
    seen = torch.from_numpy(lesson.asked(np.random.default_rng([way.seed, 2**31]), held))
    state: dict[str, Any] = {"epoch": 0, "best": math.inf, "at": 0, "weights": None}
    if (found := checkpoint.read()) is not None:
        state = {name: found[name] for name in state}
        net.load_state_dict(found["net"])
        optimizer.load_state_dict(found["optimizer"])
    while state["epoch"] < way.epochs and (state["epoch"] - state["at"]) * PATIENCE <= way.epochs:
        rng = np.random.default_rng([way.seed, state["epoch"]])
        _epoch(lesson, net, optimizer, rng, chosen, state["epoch"] / way.epochs, 1.0 / way.epochs)
        with torch.no_grad():
            parts = np.array_split(np.arange(len(held)), -(-len(held) // lesson.batch))
            error = float(np.concatenate([lesson.missed(net, seen[p], held[p]) for p in parts]).mean())
        state["epoch"] += 1
        if error < state["best"]:
            weights = {name: value.clone() for name, value in net.state_dict().items()}
            state |= {"best": error, "at": state["epoch"], "weights": weights}
        checkpoint.write(state | {"net": net.state_dict(), "optimizer": optimizer.state_dict()})
        progress(f"epoch {state['epoch']} of {way.epochs}: {1e3 * error:.3f} mm on held-out fingers")
    net.load_state_dict(state["weights"])
    return lesson.arrays(net), state["epoch"]


def _epoch(
    lesson: Lesson, net: torch.nn.Module, optimizer: torch.optim.Optimizer, rng: np.random.Generator, chosen: np.ndarray,
    begun: float, share: float,
) -> None:  # fmt: skip
    """One pass over the samples `chosen`, from `begun` of the training on, which is `share` of it."""
    import torch

    order, size = rng.permutation(chosen), min(lesson.batch, len(chosen))
    steps = len(chosen) // size
    for b in range(steps):
        pick = order[b * size : (b + 1) * size]
        optimizer.param_groups[0]["lr"] = lesson.rate * 0.5 * (1.0 + math.cos(math.pi * (begun + share * b / steps)))
        loss = lesson.loss(net, torch.from_numpy(lesson.shown(rng, pick)), pick, rng)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


def digest(folder: Path) -> str:
    """SHA-256 of the shards, in order."""
    total = hashlib.sha256()
    for path in sorted(folder.glob("samples-*.parquet")):
        total.update(path.read_bytes())
    return total.hexdigest()
