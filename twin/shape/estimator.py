"""What an estimator is: strains and tendon displacements in; named points, their uncertainty and a doubt out; batch first.

A new estimator is one file in this folder with one subclass of `Estimator`; it is found by itself, by its file's name.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from twin.errors import UnknownNameError
from twin.factory import Points, named_points
from twin.shape.sensing import feeling
from twin.twin import Twin

Z90 = 1.645  # standard deviations: the band is 1.645 std wide
OWN, SHARE = 5e-5, 0.013  # m, and of its way: the twin's error at a point, against `tools/bench/finger` under shortenings


@dataclass(frozen=True)
class Felt:
    """What is felt: strain (n, s) of the cords, NaN where a sensor is missing; displacement (n, t) m of the tendons, of the hanging
    finger; `pushed`: something may be pressing; `follows` (n,): whether a row comes right after the one above it, for estimators
    that remember (None: no row does)."""

    strain: np.ndarray
    displacement: np.ndarray
    pushed: bool = True
    follows: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.strain)


@dataclass(frozen=True)
class Shapes:
    """Displacements (n, P, 3) m of the named points in the finger's own frame; `std` (n, P) m, of
    which 1.645 hold the point with a probability of 90 %; `outside` (n,): what was felt is unlike all that the estimator knows;
    `pressed` (n,): tendons alone do not make it (None: not told)."""

    moved: np.ndarray
    std: np.ndarray
    outside: np.ndarray
    pressed: np.ndarray | None = None


def own_error(moved: np.ndarray) -> np.ndarray:
    """Standard deviation (..., P) m of the twin itself at points moved by (..., P, 3) m: no estimator made of it does better."""
    return np.hypot(OWN, SHARE * np.linalg.norm(moved, axis=-1))


class Estimator(ABC):
    """Base of all estimators. One is made for a twin (a robot with its calibrated numbers) and remembers nothing between calls:
    what is to be remembered stands in the rows above (`Felt.follows`), and a row that follows none starts anew."""

    about: ClassVar[str]

    def __init__(self, twin: Twin) -> None:
        """Raises DataError for a robot that no estimator knows."""
        self.twin, self.body = twin, feeling(twin)
        self.points: Points = named_points(twin.robot)

    @classmethod
    def name(cls) -> str:
        """Its file's."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def estimate(self, felt: Felt) -> Shapes:
        """The shapes behind what is felt."""

    def displaced(self, felt: Felt) -> np.ndarray:
        """Their points' displacements (n, P, 3) m alone, for a control loop that asks for nothing else."""
        return self.estimate(felt).moved


@cache
def estimators() -> dict[str, type[Estimator]]:
    """All estimators by name."""
    found = {}
    package = importlib.import_module(__package__ or "twin.shape")
    for module in pkgutil.iter_modules(package.__path__):
        members = vars(importlib.import_module(f"{package.__name__}.{module.name}")).values()
        law = next(
            (m for m in members if isinstance(m, type) and issubclass(m, Estimator) and m.__module__.endswith(f".{module.name}")),
            None,
        )
        if law is not None and not inspect.isabstract(law):
            found[module.name] = law
    return found


def estimator(name: str) -> type[Estimator]:
    """The estimator of this name. Raises UnknownNameError, listing those that exist."""
    try:
        return estimators()[name]
    except KeyError:
        raise UnknownNameError("estimator", name, list(estimators())) from None
