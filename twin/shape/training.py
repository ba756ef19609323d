"""Training of the modal network on the factory's shards (torch). Every chain is a finger of its own; one in ten is held out."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from twin.errors import DataError, TwinError
from twin.factory import named_points, shard
from twin.factory.draw import LENGTH as CHAIN
from twin.robots import Robot
from twin.shape.estimator import Z90, Felt
from twin.shape.features import features
from twin.shape.modal import FORMAT, Network
from twin.shape.modes import COUNT, Habit, Modes
from twin.soft import SoftBody

WIDTH, LAYERS = 192, 3
BATCH = 1024
RATE = 2e-3
HELD_OUT = 10  # one chain in so many
STRAIN_NOISE, GAIN_NOISE, OFFSET_NOISE = 1.5e-4, 0.01, 2e-4  # what sensors and their alignment leave
LENGTH_NOISE = 2e-5  # m
DEAD = 0.15  # of the samples have one sensor missing


@dataclass(frozen=True)
class Data:
    """Converged samples: strain (n, s), displacement (n, t) m, coordinates z (n, k) m, which are held out (n,), kind (n,)."""

    strain: np.ndarray
    displacement: np.ndarray
    z: np.ndarray
    held: np.ndarray
    kind: np.ndarray
    modes: Modes


def load(folder: Path, weights: np.ndarray) -> Data:
    """From the shards in `folder`; `weights` (P, n_free) of the named points."""
    d = shard.read(folder, ["sample", "converged", "nodes", "strain", "command", "kind"])
    held = (d["sample"] // CHAIN) % HELD_OUT == HELD_OUT - 1
    good = d["converged"].astype(bool)
    nodes = d["nodes"].astype(float)
    modes = Modes.of(nodes[good & ~held], weights, COUNT)
    z = modes.coordinates(nodes[good], weights)
    return Data(d["strain"][good], d["command"][good], z, held[good], d["kind"][good], modes)


def train(data: Data, epochs: int, seed: int, progress: Callable[[int, float, float], None] = lambda *now: None) -> dict[str, Any]:
    """The weights as arrays, as `modal.read_weights` takes them. `progress` hears epoch, training loss and held-out error (m)."""
    import torch

    torch.manual_seed(seed)
    torch.set_num_threads(1)  # so small a net gains nothing by two, and loses much on a busy machine
    rng = np.random.default_rng(seed)
    k, inputs = data.z.shape[1], 2 * data.strain.shape[1] + data.displacement.shape[1]
    sizes = [inputs, *[WIDTH] * LAYERS]
    parts: list[Any] = []
    for a, b in pairwise(sizes):
        parts += [torch.nn.Linear(a, b), torch.nn.SiLU()]
    net = torch.nn.Sequential(*parts, torch.nn.Linear(WIDTH, 2 * k))
    optimizer = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=1e-5)
    chosen, held = np.flatnonzero(~data.held), np.flatnonzero(data.held)
    spread = torch.tensor(data.modes.spread, dtype=torch.float32)
    metric = (spread / spread[0]) ** 2
    steps = epochs * (len(chosen) // BATCH)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=steps)
    target = (data.z / data.modes.spread).astype(np.float32)
    for epoch in range(epochs):
        order, total = rng.permutation(chosen), 0.0
        for b in range(len(chosen) // BATCH):
            pick = order[b * BATCH : (b + 1) * BATCH]
            x, y = torch.from_numpy(_disturbed(rng, data, pick)), torch.from_numpy(target[pick])
            mean, log_std = net(x).split(k, dim=1)
            error = (mean - y) ** 2
            log_std = log_std.clamp(-8.0, 3.0)
            spread_loss = (0.5 * error.detach() * torch.exp(-2.0 * log_std) + log_std).mean()
            loss = 100.0 * (error * metric).sum(dim=1).mean() + 0.02 * spread_loss
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            total += float(loss.detach())
        with torch.no_grad():
            mean = net(torch.from_numpy(_disturbed(rng, data, held, dead=0.0)))[:, :k].numpy()
        missed = (mean - target[held]) * data.modes.spread
        progress(epoch, total / max(len(chosen) // BATCH, 1), float(np.sqrt((missed**2).sum(axis=1)).mean()))
    layers = [m for m in net if isinstance(m, torch.nn.Linear)]
    arrays: dict[str, Any] = {"format": np.array(FORMAT), "layers": np.array(len(layers))}
    for i, layer in enumerate(layers):
        arrays[f"weight_{i}"], arrays[f"bias_{i}"] = layer.weight.detach().numpy(), layer.bias.detach().numpy()
    return arrays | _known(data) | {"widen": np.ones(k), "rest": np.array(1e-4)}


def judged(arrays: dict[str, Any], data: Data, weights: np.ndarray) -> tuple[dict[str, Any], dict[str, Any]]:
    """The weights with their error bar widened until it holds 90 % of the held-out points, and a card of held-out errors (mm)."""
    rng, held = np.random.default_rng(1), np.flatnonzero(data.held)
    noise = 1.0 + GAIN_NOISE * rng.normal(size=(len(held), data.strain.shape[1]))
    felt = Felt(data.strain[held] * noise, data.displacement[held])
    z, std = Network({n: np.asarray(a, float) if np.asarray(a).dtype.kind == "f" else a for n, a in arrays.items()})(felt)
    basis = np.einsum("pn,knc->kpc", weights, data.modes.basis.reshape(z.shape[1], -1, 3))
    error = np.linalg.norm(np.einsum("sk,kpc->spc", z - data.z[held], basis), axis=2)
    bar = np.sqrt(std**2 @ (basis**2).sum(axis=2) + float(arrays["rest"]) ** 2)
    widen = float(np.quantile(error / bar, 0.9)) / Z90
    arrays = arrays | {"widen": np.full(z.shape[1], widen)}
    size = np.linalg.norm(np.einsum("sk,kpc->spc", data.z[held], basis) + _mean(data, weights), axis=2).mean(axis=1)
    each, kinds = 1e3 * error.mean(axis=1), data.kind[held]
    card = {
        "held_out_mm": float(each.mean()),
        "by_kind_mm": {str(k): float(each[kinds == k].mean()) for k in np.unique(kinds)},
        "by_mean_displacement_mm": {
            f"{a}-{b}": float(each[(size >= 1e-3 * a) & (size < 1e-3 * b)].mean()) for a, b in ((0, 2), (2, 5), (5, 10), (10, 30))
        },
        "band_widened_by": widen,
        "does_not_know": "friction, creep, contact with edges sharper than 6 mm, pushes beyond those of twin/factory/draw.py",
    }  # fmt: skip
    return arrays, card


def _mean(data: Data, weights: np.ndarray) -> np.ndarray:
    return weights @ data.modes.mean.reshape(-1, 3)


def digest(folder: Path) -> str:
    """SHA-256 of the shards, in order."""
    total = hashlib.sha256()
    for path in sorted(folder.glob("samples-*.parquet")):
        total.update(path.read_bytes())
    return total.hexdigest()


def write_trained(
    robot: Robot, folder: Path, path: Path, epochs: int, seed: int, progress: Callable[[str], None] = lambda words: None
) -> dict[str, Any]:
    """Train on the shards in `folder` and write the weights, whole or not at all, and a card beside them, which is returned.

    Raises DataError for shards that cannot be read or are of another robot, TwinError without torch.
    """
    if importlib.util.find_spec("torch") is None:
        raise TwinError("training needs torch, which is not installed; pip install 'tendon-twin[learn]'")
    body = robot.build()
    if not isinstance(body, SoftBody):
        raise DataError(f"robot {robot.name!r} is no soft body; shape is learned of fingers")
    with threadpool_limits(limits=1):
        return _write_trained(robot, body, folder, path, (epochs, seed), progress)


def _write_trained(
    robot: Robot, body: SoftBody, folder: Path, path: Path, way: tuple[int, int], progress: Callable[[str], None]
) -> dict[str, Any]:
    epochs, seed = way
    data = load(folder, body.lattice.weights(named_points(robot).rest))
    arrays = train(data, epochs, seed, lambda e, loss, mm: progress(f"epoch {e + 1} of {epochs}: {mm:.3f} mm on held-out fingers"))
    arrays, card = judged(arrays, data, body.lattice.weights(named_points(robot).rest))
    card |= {"robot": robot.name, "samples": len(data.z), "epochs": epochs, "seed": seed, "data": digest(folder)}
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)
    part.replace(path)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", "utf-8")
    return card


def _disturbed(rng: np.random.Generator, data: Data, pick: np.ndarray, dead: float = DEAD) -> np.ndarray:
    """Features of samples, with the errors that sensors and their alignment make, and some sensors missing."""
    strain, s = data.strain[pick], data.strain.shape[1]
    strain = strain * (1.0 + GAIN_NOISE * rng.normal(size=strain.shape)) + OFFSET_NOISE * rng.normal(size=strain.shape)
    strain = strain + STRAIN_NOISE * rng.normal(size=strain.shape)
    lost = rng.uniform(size=len(pick)) < dead
    strain[lost, rng.integers(0, s, int(lost.sum()))] = np.nan
    displacement = data.displacement[pick] + LENGTH_NOISE * rng.normal(size=data.displacement[pick].shape)
    return features(strain, displacement).astype(np.float32)


def _known(data: Data) -> dict[str, Any]:
    """Where the strains that were trained on lie."""
    centre = data.strain.mean(axis=0)
    inverse = np.linalg.inv(np.cov(data.strain.T))
    x = data.strain - centre
    far = np.quantile(np.einsum("ni,ij,nj->n", x, inverse, x), 0.999)
    m, slack = data.modes, data.kind == "pushed"
    known = {"known_mean": centre, "known_inverse": inverse, "known_far": np.array(far)}
    coefficient, inverse_habit = Habit.fit(data.z[slack], m.spread)
    known |= {"habit": coefficient, "habit_inverse": inverse_habit}
    return known | {"mean": m.mean, "basis": m.basis.astype(np.float32), "spread": m.spread}
