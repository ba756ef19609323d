"""Representations of a hand for a policy: the shape of its fingers, raw strains, or differences of opposite cords.

    x: the shape of all fingers, or their cords' readings, tared

A person's hand pushes where no tendon pulls; a policy therefore learns where the fingers were, not what moved them, and the
controllers of `twin/control` find the shortenings. Strains are handled alike: x = sqrt(R/R_0) - 1 of all cords, R_0 read while the
hand hung before the trial, followed by strain tracking with the twin as described. A shape is estimated with the twin of an
alignment, strains need none: this is the difference in information between the two.
"""

from abc import ABC, abstractmethod

import numpy as np

from twin.control.shape_controller import ShapeController, TensionLimits
from twin.control.strain_tracking import BendTracking, StrainTracking
from twin.foundation.errors import UnknownNameError
from twin.robots import Robot
from twin.tasks import CONTROL_STEP
from twin.tasks.imitation.hand_model import HandShapeEstimator, finger_twins

CORDS_PER_FINGER = 4  # of a finger
# Between 2.5 N, which turns every cylinder (2 N did not), and 2 N, which lifts a disc by 6 mm in place of 10: tendons that pull
# harder shorten the fingers more, which move the object.
GRIP_LIMITS = TensionLimits(most=2.25)


class Representation(ABC):
    """Observation and control of a hand. One is made for a trial."""

    columns: tuple[str, ...]

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        """`known`: the hand's values by an alignment; `hanging` (f, s) ohm: the cords' readings before the trial."""
        self.hanging = hanging

    @staticmethod
    @abstractmethod
    def from_demonstration(episode: dict[str, np.ndarray]) -> np.ndarray:
        """Return x (n, d) of a demonstration's columns."""

    @abstractmethod
    def observe(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        """Return x (d,) of cords' readings (f, s) ohm and encoders' (f, t) m."""

    @abstractmethod
    def track(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        """Return shortenings (f, t) m for the next CONTROL_STEP s, towards x (d,)."""


class ShapeRepresentation(Representation):
    """The shape of all fingers, followed by shape control."""

    columns = ("observation.state",)

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        twins = finger_twins(robot, known)
        self.estimator, self.controllers = HandShapeEstimator(twins), [ShapeController(twin, limits=GRIP_LIMITS) for twin in twins]

    @staticmethod
    def from_demonstration(episode: dict[str, np.ndarray]) -> np.ndarray:
        return episode["observation.state"]

    def observe(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return self.estimator.estimate(resistance, shortening).ravel()

    def track(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        points = self.estimator.points(wanted.reshape(len(self.controllers), -1))
        each = zip(self.controllers, points, resistance, strict=True)
        return np.stack([controller.step(p, r, CONTROL_STEP).shortening for controller, p, r in each])


class StrainRepresentation(Representation):
    """Raw strains, tared, followed by strain tracking."""

    columns = ("observation.resistance",)
    controller_class = StrainTracking

    def __init__(self, robot: Robot, known: dict[str, float], hanging: np.ndarray) -> None:
        super().__init__(robot, known, hanging)
        self.controllers = [self.controller_class(twin, limits=GRIP_LIMITS) for twin in finger_twins(robot, {})]
        self.rest = np.stack([c.finger.strain() for c in self.controllers])

    @staticmethod
    def from_demonstration(episode: dict[str, np.ndarray]) -> np.ndarray:
        R = episode["observation.resistance"]
        return np.sqrt(R / R[0]) - 1.0

    def observe(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return (np.sqrt(resistance / self.hanging) - 1.0).ravel()

    def track(self, wanted: np.ndarray, resistance: np.ndarray) -> np.ndarray:
        now = self.rest + np.sqrt(resistance / self.hanging) - 1.0
        goal = self.rest + wanted.reshape(self.rest.shape)
        each = zip(self.controllers, goal, now, strict=True)
        return np.stack([c.step(g, c.cords.rest * (1.0 + x) ** 2, CONTROL_STEP).shortening for c, g, x in each])


class BendRepresentation(StrainRepresentation):
    """Differences of opposite cords alone, half in the one cord and half in the other: tendons compress a finger, a hand does
    not."""

    controller_class = BendTracking

    @staticmethod
    def from_demonstration(episode: dict[str, np.ndarray]) -> np.ndarray:
        return _antisymmetric_part(StrainRepresentation.from_demonstration(episode))

    def observe(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        return _antisymmetric_part(super().observe(resistance, shortening))


def _antisymmetric_part(x: np.ndarray) -> np.ndarray:
    """Return the differences of x (..., f s), fingers of CORDS_PER_FINGER cords each, the second half opposite to the first."""
    cords = x.reshape(*x.shape[:-1], -1, 2, CORDS_PER_FINGER // 2)
    return 0.5 * (cords - cords[..., ::-1, :]).reshape(x.shape)


REPRESENTATIONS: dict[str, type[Representation]] = {
    "shape": ShapeRepresentation,
    "strain": StrainRepresentation,
    "bend": BendRepresentation,
}


def representation_class(name: str) -> type[Representation]:
    """Return the representation of this name. Raises UnknownNameError for others than shape, strain and bend."""
    if name not in REPRESENTATIONS:
        raise UnknownNameError("way", name, list(REPRESENTATIONS))
    return REPRESENTATIONS[name]
