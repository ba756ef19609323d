"""Base of all shape estimators: strains and tendon displacements in, named points with their uncertainty out, batch first.

A new estimator is one module in this folder with one subclass of `Estimator`; it is found by its file's name.
"""

import importlib
import inspect
import pkgutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from twin.foundation.errors import UnknownNameError
from twin.prediction.twin import Twin
from twin.robots.named_points import NamedPoints, named_points
from twin.shape.sensing import sensing_finger

Z90 = 1.645  # standard deviations: the band is 1.645 std wide
# m, and of its way: the twin's error at a point, against `tools/simulators/finger` under shortenings
TWIN_ERROR_FLOOR, TWIN_ERROR_SHARE = 5e-5, 0.013


@dataclass(frozen=True)
class SensorReadings:
    """Readings of the sensors, a row a sample.

    `strain` (n, s) of the cords, NaN where a sensor is missing; `displacement` (n, t) m of the tendons, from the hanging rest;
    `pushed`: whether something may press; `follows` (n,): whether a row comes right after the one above it, for estimators with a
    memory (None: no row does).
    """

    strain: np.ndarray
    displacement: np.ndarray
    pushed: bool = True
    follows: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.strain)


@dataclass(frozen=True)
class ShapeEstimates:
    """Estimated shapes.

    `displacements` (n, P, 3) m of the named points in the finger's own frame; `std` (n, P) m, of which 1.645 hold the point with a
    probability of 90 %; `outside` (n,): whether the readings are unlike all that the estimator was made for; `pressed` (n,):
    whether tendons alone do not make these readings (None: not determined).
    """

    displacements: np.ndarray
    std: np.ndarray
    outside: np.ndarray
    pressed: np.ndarray | None = None


def twin_error(displacements: np.ndarray) -> np.ndarray:
    """Return the standard deviation (..., P) m of the twin's own error at points displaced by (..., P, 3) m.

    No estimator made from the twin does better.
    """
    return np.hypot(TWIN_ERROR_FLOOR, TWIN_ERROR_SHARE * np.linalg.norm(displacements, axis=-1))


class Estimator(ABC):
    """Base of all estimators.

    One is made for a twin (a robot with its calibrated numbers) and keeps nothing between calls: memory uses the rows above
    (`SensorReadings.follows`), and a row that follows none starts anew.
    """

    description: ClassVar[str]

    def __init__(self, twin: Twin) -> None:
        """Raises DataError for a robot that is no soft finger with strain sensors and named points."""
        self.twin, self.body = twin, sensing_finger(twin)
        self.points: NamedPoints = named_points(twin.robot)

    @classmethod
    def name(cls) -> str:
        """Return the name of its file."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def estimate(self, readings: SensorReadings) -> ShapeEstimates:
        """Estimate the shapes behind the readings."""

    def estimate_displacements(self, readings: SensorReadings) -> np.ndarray:
        """Return the points' displacements (n, P, 3) m alone, for a control loop."""
        return self.estimate(readings).displacements


_packages = ["twin.shape.estimators"]


def register_package(name: str) -> None:
    """Add the estimators of another importable package, one a module."""
    if name not in _packages:
        _packages.append(name)
        estimators.cache_clear()


@cache
def estimators() -> dict[str, type[Estimator]]:
    """Return all estimators by name."""
    found = {}
    for package in map(importlib.import_module, _packages):
        for module in pkgutil.iter_modules(package.__path__):
            path = f"{package.__name__}.{module.name}"
            members = vars(importlib.import_module(path)).values()
            own = (m for m in members if isinstance(m, type) and issubclass(m, Estimator) and m.__module__ == path)
            estimator = next(own, None)
            if estimator is not None and not inspect.isabstract(estimator):
                found[module.name] = estimator
    return found


def estimator_class(name: str) -> type[Estimator]:
    """Return the estimator of this name. Raises UnknownNameError, listing those that exist."""
    try:
        return estimators()[name]
    except KeyError:
        raise UnknownNameError("estimator", name, list(estimators())) from None
