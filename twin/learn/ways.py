"""How a hand is seen and moved: by the shape of its fingers, by raw strains, or by what opposite cords differ by.

    x: the shape of all fingers, or what their cords read, tared

A person's hand pushes where no tendon pulls; what is learned is therefore where the fingers were, not what moved them, and the
controllers of `twin/control` find the shortenings. The same is done with strains: x = sqrt(R/R_0) - 1 of all cords, R_0 what they
read while the hand hung before the trial, followed by strain tracking with the twin as described. A shape is estimated with the
twin as an alignment knows it, strains need none; that is the difference in what the two are told.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from twin.control.shape import Limits, ShapeController
from twin.control.shape_baselines import BendTracking, StrainTracking
from twin.errors import UnknownNameError
from twin.learn.hands import Eye, fingers
from twin.robots import Robot
from twin.tasks import STEP

CORDS = 4  # of a finger
# Chosen on trials of seed 100, between what turns every cylinder (2.5 N; 2 N did not) and what lifts a disc by 6 mm, not 10
# (2 N; 2.5 did): the harder tendons pull the more fingers shorten and drag along what they hold.
GRIP = Limits(most=2.25)


class Way(ABC):
    """How a hand is seen and moved. One is made for a trial."""

    columns: tuple[str, ...]

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        """`known`: the hand's values by an alignment; `hanging` (f, s) ohm: what the cords read before the trial."""
        self.hanging = hanging

    @staticmethod
    @abstractmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        """x (n, d) of a demonstration's columns."""

    @abstractmethod
    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        """x (d,) of what cords (f, s) ohm and encoders (f, t) m read."""

    @abstractmethod
    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        """Shortenings (f, t) m for the next STEP s, towards x (d,)."""


class ByShape(Way):
    columns = ("observation.state",)

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        twins = fingers(robot, known)
        self.eye, self.controllers = Eye(twins), [ShapeController(twin, limits=GRIP) for twin in twins]

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        return episode["observation.state"]

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return self.eye.look(resistance, shortening).ravel()

    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        points = self.eye.points(wanted.reshape(len(self.controllers), -1))
        each = zip(self.controllers, points, resistance, strict=True)
        return np.stack([controller.step(p, r, STEP).shortening for controller, p, r in each])


class ByStrain(Way):
    columns = ("observation.resistance",)
    tracking = StrainTracking

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        self.controllers = [self.tracking(twin, limits=GRIP) for twin in fingers(robot, {})]
        self.rest = np.stack([c.finger.strain() for c in self.controllers])

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        R = episode["observation.resistance"]
        return np.sqrt(R / R[0]) - 1.0

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return (np.sqrt(resistance / self.hanging) - 1.0).ravel()

    def follow(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        now = self.rest + np.sqrt(resistance / self.hanging) - 1.0
        goal = self.rest + wanted.reshape(self.rest.shape)
        each = zip(self.controllers, goal, now, strict=True)
        return np.stack([c.step(g, c.cords.rest * (1.0 + x) ** 2, STEP).shortening for c, g, x in each])


class ByBend(ByStrain):
    """By what opposite cords of a finger differ by, alone: tendons compress a finger, a person's hand does not. x is that
    difference, half of it in the one cord and half in the other."""

    tracking = BendTracking

    @staticmethod
    def shown(episode: dict[str, np.ndarray]) -> np.ndarray:
        return _opposed(ByStrain.shown(episode))

    def see(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return _opposed(super().see(resistance, shortening))


def _opposed(x: np.ndarray) -> np.ndarray:
    """x (..., f s) of fingers with CORDS cords each, the second half opposite to the first."""
    cords = x.reshape(*x.shape[:-1], -1, 2, CORDS // 2)
    return 0.5 * (cords - cords[..., ::-1, :]).reshape(x.shape)


WAYS: dict[str, type[Way]] = {"shape": ByShape, "strain": ByStrain, "bend": ByBend}


def way(name: str) -> type[Way]:
    """Raises UnknownNameError for another way than shape, strain and bend."""
    if name not in WAYS:
        raise UnknownNameError("way", name, list(WAYS))
    return WAYS[name]
