"""Grasp a cylinder that stands on a table and turn it about its axis, without losing it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from twin.soft.scene import Thing
from twin.tasks.task import Outcome, Task, Track, eased, table

WANTED, WITHIN = np.radians(30.0), np.radians(10.0)
BEGINS, TAKES = 1.3, 1.0  # s
AWAY, TILTED = 10e-3, np.radians(20.0)


class Turn(Task):
    about = "turn a cylinder of 40 to 48 mm that stands on a table by 30 degrees about its axis"
    success = "in the last 0.4 s it stays turned by 20 to 40 degrees, within 10 mm of its place and tilted by less than 20 degrees"
    seconds: ClassVar[float] = 3.0
    strength: ClassVar[float] = 0.7

    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, y = rng.uniform(-2e-3, 2e-3, 2)
        thing = Thing(
            "object", "cylinder", (rng.uniform(0.020, 0.024), 0.025), rng.uniform(0.02, 0.04), (x, y, 0.085),
            friction=rng.uniform(0.8, 1.2),
        )  # fmt: skip
        return thing, table(0.110)

    def turns(self, t: float) -> float:
        return WANTED * eased((t - BEGINS) / TAKES)

    def judge(self, track: Track) -> Outcome:
        yaw, last, upright = track.yaw(), track.last, track.upright()
        away = np.linalg.norm(track.place - track.place[0], axis=1)
        if not track.reached:
            return Outcome.NOT_REACHED
        if away[-1] > 2.0 * AWAY or upright[-1] < np.cos(2.0 * TILTED):
            return Outcome.DROPPED
        stays = (np.abs(yaw - WANTED) < WITHIN) & (away < AWAY) & (upright > np.cos(TILTED))
        if stays[last].all():
            return Outcome.SUCCESS
        return Outcome.NOT_REACHED if yaw[-1] < WANTED - WITHIN else Outcome.SLIPPED
