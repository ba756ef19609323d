"""Draw built hands and their alignments, and estimate the shape of all their fingers for a policy.

A hand's shape is z (f, k) m: for each finger the coordinates of the estimator's deformation modes, for displacements turned by the
finger's mounting angle, so that equal shapes in the palm have equal coordinates at any angle of clamping.
"""

from collections.abc import Sequence

import numpy as np

from twin.body.strain_cords import strain
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin
from twin.robots import Robot, load
from twin.shape.estimators.estimator import SensorReadings
from twin.shape.estimators.modal import ModalEstimator

FINGER_ROBOT = "finger"  # the robot whose description, points and weights serve each finger of a hand
# One standard deviation (relative; the angle in rad): half the largest errors of an alignment (twin/shape).
ALIGNMENT_ERRORS = {
    "sensors.resistance": 5e-4, "sensors.stretch": 0.018, "sensors.compression": 3.5e-3, "mounting.angle": 1e-3,
}  # fmt: skip


def draw_built_hand(robot: Robot, seed: int) -> dict[str, float]:
    """Return values (SI) of one built hand: the uncertain ones, normal with their std inside their bounds."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    return {p.name: float(np.clip(rng.normal(p.value, p.std or 0.0), p.low, p.high)) for p in robot.nuisance}


def draw_alignment(robot: Robot, values: dict[str, float], seed: int) -> dict[str, float]:
    """Return the values of that hand as an alignment would find them: cords and mounting angles with drawn errors."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    found = {}
    for p in robot.nuisance:
        kind = next((k for k in ALIGNMENT_ERRORS if p.name.startswith(k)), None)
        if kind is not None:
            size = 1.0 if kind == "mounting.angle" else values[p.name]
            found[p.name] = float(np.clip(values[p.name] + ALIGNMENT_ERRORS[kind] * size * rng.normal(), p.low, p.high))
    return found


def finger_twins(robot: Robot, values: dict[str, float]) -> list[Twin]:
    """Return a twin of each finger of a hand. Raises DataError for a robot that is no hand."""
    hand, one = robot.hand(robot.build(values)), load(FINGER_ROBOT)
    known = {p.name for p in one.parameters}
    return [Twin(one, {n: v for n, v in own.items() if n in known}, ()) for own in hand.numbers]


class HandShapeEstimator:
    """Estimator of the shapes of all fingers."""

    def __init__(self, twins: Sequence[Twin]) -> None:
        self.estimators = [ModalEstimator(twin) for twin in twins]
        self.rotations = [rotation_about_z(eye.body.turn) for eye in self.estimators]

    def estimate(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        """Return z (f, k) m for resistances (f, s) ohm and tendons shortened by (f, t) m."""
        z = []
        for estimator, turn, r, d in zip(self.estimators, self.rotations, resistance, shortening, strict=True):
            displacements = (
                estimator.estimate_displacements(SensorReadings(strain(r, estimator.body.cords)[None], d[None]))[0] @ turn.T
            )
            z.append(np.tensordot(estimator.basis, displacements - estimator.mean, 2))
        return np.stack(z)

    def points(self, z: np.ndarray) -> np.ndarray:
        """Return the points (f, P, 3) m of z (f, k), in each finger's base frame."""
        rest = self.estimators[0].points.rest
        return np.stack(
            [
                rest @ t.T + e.mean + np.tensordot(one, e.basis, 1)
                for e, t, one in zip(self.estimators, self.rotations, z, strict=True)
            ]
        )
