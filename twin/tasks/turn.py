"""Grasp a cylinder that stands on a table and turn it about its axis, without losing it."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, smooth_step

TURN_ANGLE, TURN_TOLERANCE = np.radians(30.0), np.radians(10.0)  # rad
TURN_START, TURN_DURATION = 1.3, 1.0  # s
LARGEST_SHIFT, LARGEST_TILT = 10e-3, np.radians(20.0)  # m, rad


class Turn(Task):
    """A standing cylinder."""

    description = "turn a cylinder of 40 to 48 mm that stands on a table by 30 degrees about its axis"
    success_criterion = (
        "in the last 0.4 s it stays turned by 20 to 40 degrees, within 10 mm of its place and tilted by less than 20 degrees"
    )
    duration: ClassVar[float] = 3.0
    push_strength: ClassVar[float] = 0.7

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, y = rng.uniform(-2e-3, 2e-3, 2)
        thing = Thing(
            "object", "cylinder", (rng.uniform(0.020, 0.024), 0.025), rng.uniform(0.02, 0.04), (x, y, 0.085),
            friction=rng.uniform(0.8, 1.2),
        )  # fmt: skip
        return thing, build_table(0.110)

    def wanted_turn(self, t: float) -> float:
        return TURN_ANGLE * smooth_step((t - TURN_START) / TURN_DURATION)

    def judge(self, track: ObjectTrack) -> Outcome:
        yaw, last, upright = track.yaw(), track.in_final_span, track.tilt_cosine()
        shift = np.linalg.norm(track.place - track.place[0], axis=1)
        if not track.was_touched:
            return Outcome.NOT_REACHED
        if shift[-1] > 2.0 * LARGEST_SHIFT or upright[-1] < np.cos(2.0 * LARGEST_TILT):
            return Outcome.DROPPED
        stays = (np.abs(yaw - TURN_ANGLE) < TURN_TOLERANCE) & (shift < LARGEST_SHIFT) & (upright > np.cos(LARGEST_TILT))
        if stays[last].all():
            return Outcome.SUCCESS
        return Outcome.NOT_REACHED if yaw[-1] < TURN_ANGLE - TURN_TOLERANCE else Outcome.SLIPPED
