"""What training needs to know of an estimator, and the factory's samples as it is given them (torch inside).

Every chain of samples is a finger of its own, with its own E; one chain in ten is held out. What is felt is disturbed by the errors
that sensors and their alignment leave, anew whenever a sample is shown.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import DataError
from twin.factory import Points, named_points, shard
from twin.factory.draw import LENGTH as CHAIN
from twin.factory.solve import hang, weight_of
from twin.robots import Robot
from twin.shape.features import features
from twin.shape.weights import Layers
from twin.soft import SoftBody, SoftStatics
from twin.soft.skin import Skin
from twin.soft.solid import Solid

if TYPE_CHECKING:
    import torch

HELD_OUT = 10  # one chain in so many
STRAIN_NOISE, GAIN_NOISE, OFFSET_NOISE = 1.5e-4, 0.01, 2e-4  # what sensors and their alignment leave
LENGTH_NOISE = 2e-5  # m
DEAD = 0.15  # of the samples have one sensor missing
DOUBT = 0.3  # of the free motions are shown as if something might press


@dataclass(frozen=True)
class Data:
    """Converged samples: strain (n, s), displacement (n, t) m, free nodes' displacements (n, 3 n_free) m, whether a hand is on the
    finger (n,), which are held out (n,); and of the finger its points, their weights (P, n_free), its skin, and the strains (s,) of
    its hanging rest. tension (n, t) N of the tendons. `before` (n,): the sample before in its chain, of the first itself."""

    strain: np.ndarray
    displacement: np.ndarray
    tension: np.ndarray
    nodes: np.ndarray
    kind: np.ndarray
    held: np.ndarray
    points: Points
    weights: np.ndarray
    skin: Skin
    hanging: np.ndarray
    before: np.ndarray

    @property
    def pushed(self) -> np.ndarray:
        return self.kind != "free"


def load(folder: Path, robot: Robot) -> Data:
    """From the shards in `folder`. Raises DataError where they cannot be read, are too few, or the robot is no finger."""
    body = robot.silicone(robot.build())
    points = named_points(robot)
    weights = body.lattice.weights(points.rest)
    d = shard.read(folder, ["sample", "converged", "nodes", "strain", "command", "tension", "kind"])
    if d["nodes"].shape[1] != 3 * weights.shape[1]:
        raise DataError(f"{folder}: shapes of another body than robot {robot.name!r}; make them with twin generate")
    good = d["converged"].astype(bool)
    held = (d["sample"] // CHAIN)[good] % HELD_OUT == HELD_OUT - 1
    if not held.any():
        raise DataError(f"{folder}: fewer than {HELD_OUT} fingers of {CHAIN} samples; none can be held out, ask for more samples")
    nodes, kind = d["nodes"][good].astype(np.float32), d["kind"][good].astype(str)
    felt = d["strain"][good], d["command"][good], d["tension"][good]
    sample, here = d["sample"][good], np.arange(len(held))
    goes_on = (np.diff(sample, prepend=-2) == 1) & (sample % CHAIN > 0)  # one that did not converge breaks its chain
    before = np.where(goes_on, here - 1, here)
    return Data(*felt, nodes, kind, held, points, weights, Skin.of(body), _hanging(robot, body), before)


def _hanging(robot: Robot, body: SoftBody) -> np.ndarray:
    statics = SoftStatics(body)
    solid = Solid(statics.parts)
    shape = solid.rest()
    hang(solid, shape, weight_of(body, robot.gravity))
    return statics.sensed(shape.u[None])["strain"][0]


def disturbed(rng: np.random.Generator, data: Data, pick: np.ndarray, dead: float = DEAD) -> tuple[np.ndarray, np.ndarray]:
    """Strains (b, s) and displacements (b, t) m of samples as they would be felt, some sensors missing."""
    strain = misread(rng, data.strain[pick])
    strain = strain + STRAIN_NOISE * rng.normal(size=strain.shape)
    return with_dead(rng, strain, dead), displaced(rng, data, pick)


def misread(rng: np.random.Generator, strain: np.ndarray) -> np.ndarray:
    """Strains (b, s) by sensors whose gain and zero are not quite known."""
    return strain * (1.0 + GAIN_NOISE * rng.normal(size=strain.shape)) + OFFSET_NOISE * rng.normal(size=strain.shape)


def with_dead(rng: np.random.Generator, strain: np.ndarray, share: float) -> np.ndarray:
    """Strains (b, s), one of them missing in a share of the rows; changed in place."""
    lost = rng.uniform(size=len(strain)) < share
    strain[lost, rng.integers(0, strain.shape[1], int(lost.sum()))] = np.nan
    return strain


def displaced(rng: np.random.Generator, data: Data, pick: np.ndarray) -> np.ndarray:
    """Displacements (b, t) m of samples as motors read them."""
    return data.displacement[pick] + LENGTH_NOISE * rng.normal(size=data.displacement[pick].shape)


def shown(rng: np.random.Generator, data: Data, pick: np.ndarray) -> np.ndarray:
    """Features (b, f) of samples to learn from, in single precision."""
    pressed = data.pushed[pick] | (rng.uniform(size=len(pick)) < DOUBT)
    return features(*disturbed(rng, data, pick), pressed).astype(np.float32)


class Lesson(ABC):
    """How one estimator's network is trained on `data`."""

    batch: int
    rate: float  # of the first steps; it falls to nothing by a cosine

    def __init__(self, data: Data) -> None:
        self.data = data
        self.inputs = 2 * data.strain.shape[1] + data.displacement.shape[1] + 1

    def shown(self, rng: np.random.Generator, pick: np.ndarray) -> np.ndarray:
        """Features (b, f) of samples to learn from, in single precision."""
        return shown(rng, self.data, pick)

    def asked(self, rng: np.random.Generator, held: np.ndarray) -> np.ndarray:
        """Features (b, f) of held-out samples, each disturbed once and for all."""
        felt = disturbed(rng, self.data, held, dead=0.0)
        return features(*felt, self.data.pushed[held]).astype(np.float32)

    @abstractmethod
    def network(self) -> torch.nn.Module:
        """With its first weights, from torch's generator."""

    @abstractmethod
    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        """Of features x (b, f) of samples `pick` (b,)."""

    @abstractmethod
    def missed(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        """(b,) m: the error by which training is stopped, of each sample."""

    @abstractmethod
    def arrays(self, net: torch.nn.Module) -> dict[str, Any]:
        """The network as its estimator reads it."""


def torch_perceptron(sizes: Sequence[int], bend: type[torch.nn.Module]) -> torch.nn.Sequential:
    """Linear layers of these sizes with `bend` between them."""
    import torch

    parts: list[torch.nn.Module] = []
    for a, b in pairwise(sizes):
        parts += [torch.nn.Linear(a, b), bend()]
    return torch.nn.Sequential(*parts[:-1])


def layers_of(net: torch.nn.Module) -> Layers:
    import torch

    linear = (m for m in net.modules() if isinstance(m, torch.nn.Linear))
    return [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in linear]
