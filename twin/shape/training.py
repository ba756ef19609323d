"""Training of the modal network on the factory's shards (torch). Every chain is a finger of its own; one in ten is held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twin.factory import shard
from twin.factory.draw import LENGTH as CHAIN
from twin.shape.features import features
from twin.shape.modal import FORMAT
from twin.shape.modes import COUNT, Habit, Modes

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
    rng = np.random.default_rng(seed)
    k, inputs = data.z.shape[1], 2 * data.strain.shape[1] + data.displacement.shape[1]
    sizes = [inputs, *[WIDTH] * LAYERS]
    parts: list[Any] = []
    for a, b in zip(sizes[:-1], sizes[1:], strict=True):
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
