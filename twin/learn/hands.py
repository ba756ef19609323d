"""Hands as they are built, as an alignment knows them, and the shape of all their fingers as a policy sees it.

A hand's shape is z (f, k) m: of each finger the coordinates of the estimator's deformation modes, for displacements turned by the
finger's mounting angle, so that alike shapes in the palm have alike coordinates whatever the angle at which fingers are clamped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.robots import Robot, load
from twin.sensors import strain
from twin.shape.estimator import Felt
from twin.shape.modal import Modal
from twin.soft.statics import turned
from twin.twin import Twin

FINGER = "finger"  # whose description, points and weights serve each finger of a hand
LEFT = {  # what an alignment leaves, one standard deviation (relative; the angle in rad): half its largest errors (twin/shape)
    "sensors.resistance": 5e-4, "sensors.stretch": 0.018, "sensors.compression": 3.5e-3, "mounting.angle": 1e-3,
}  # fmt: skip


def built(robot: Robot, seed: int) -> dict[str, float]:
    """Values (SI) of one built hand: those that are uncertain, normal with their std inside their bounds."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    return {p.name: float(np.clip(rng.normal(p.value, p.std or 0.0), p.low, p.high)) for p in robot.nuisance}


def aligned(robot: Robot, values: dict[str, float], seed: int) -> dict[str, float]:
    """What an alignment of that hand would find, drawn: cords and mounting angles with the errors LEFT; else as described."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    found = {}
    for p in robot.nuisance:
        kind = next((k for k in LEFT if p.name.startswith(k)), None)
        if kind is not None:
            size = 1.0 if kind == "mounting.angle" else values[p.name]
            found[p.name] = float(np.clip(values[p.name] + LEFT[kind] * size * rng.normal(), p.low, p.high))
    return found


def fingers(robot: Robot, values: dict[str, float]) -> list[Twin]:
    """A twin of each finger of a hand. Raises DataError for a robot that is no hand."""
    hand, one = robot.hand(robot.build(values)), load(FINGER)
    known = {p.name for p in one.parameters}
    return [Twin(one, {n: v for n, v in own.items() if n in known}, ()) for own in hand.numbers]


class Eye:
    """Shapes of all fingers from what their cords read."""

    def __init__(self, twins: Sequence[Twin]) -> None:
        self.eyes = [Modal(twin) for twin in twins]
        self.turns = [turned(eye.body.turn) for eye in self.eyes]

    def look(self, resistance: np.ndarray, shortening: np.ndarray) -> np.ndarray:
        """z (f, k) m of resistances (f, s) ohm and tendons shortened by (f, t) m."""
        z = []
        for eye, turn, r, d in zip(self.eyes, self.turns, resistance, shortening, strict=True):
            moved = eye.displaced(Felt(strain(r, eye.body.cords)[None], d[None]))[0] @ turn.T
            z.append(np.tensordot(eye.basis, moved - eye.mean, 2))
        return np.stack(z)

    def points(self, z: np.ndarray) -> np.ndarray:
        """(f, P, 3) m of z (f, k), in each finger's base frame."""
        rest = self.eyes[0].points.rest
        return np.stack(
            [rest @ t.T + e.mean + np.tensordot(one, e.basis, 1) for e, t, one in zip(self.eyes, self.turns, z, strict=True)]
        )
