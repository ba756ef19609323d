"""How an estimator's network is trained: its features, layers, loss and export (torch)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.shape.estimators.features import network_features
from twin.shape.estimators.weights import Layers
from twin.shape.training.samples import TrainingSamples, disturb, training_features

if TYPE_CHECKING:
    import torch


class TrainingSpec(ABC):
    """Base of the training of one estimator's network on `samples`."""

    batch: int
    learning_rate: float  # of the first steps; it falls to zero by a cosine

    def __init__(self, samples: TrainingSamples) -> None:
        self.samples = samples
        self.input_size = 2 * samples.strain.shape[1] + samples.displacement.shape[1] + 1

    def training_features(self, rng: np.random.Generator, pick: np.ndarray) -> np.ndarray:
        """Return features (b, f) of samples to train on, in single precision."""
        return training_features(rng, self.samples, pick)

    def validation_features(self, rng: np.random.Generator, held_out: np.ndarray) -> np.ndarray:
        """Return features (b, f) of held-out samples, each disturbed once."""
        readings = disturb(rng, self.samples, held_out, dead=0.0)
        return network_features(*readings, self.samples.pushed[held_out]).astype(np.float32)

    @abstractmethod
    def build_network(self) -> torch.nn.Module:
        """Return the network with its first weights, from torch's generator."""

    @abstractmethod
    def loss(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray, rng: np.random.Generator) -> torch.Tensor:
        """Return the loss for features x (b, f) of samples `pick` (b,)."""

    @abstractmethod
    def validation_error(self, net: torch.nn.Module, x: torch.Tensor, pick: np.ndarray) -> np.ndarray:
        """Return the error (b,) m of each sample by which training is stopped."""

    @abstractmethod
    def export_arrays(self, net: torch.nn.Module) -> dict[str, Any]:
        """Return the network's arrays as its estimator reads them."""


def build_perceptron(sizes: Sequence[int], activation: type[torch.nn.Module]) -> torch.nn.Sequential:
    """Return linear layers of these sizes with the activation between them."""
    import torch

    parts: list[torch.nn.Module] = []
    for a, b in pairwise(sizes):
        parts += [torch.nn.Linear(a, b), activation()]
    return torch.nn.Sequential(*parts[:-1])


def perceptron_layers(net: torch.nn.Module) -> Layers:
    """Return the layers of a torch perceptron as arrays."""
    import torch

    linear = (m for m in net.modules() if isinstance(m, torch.nn.Linear))
    return [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in linear]
