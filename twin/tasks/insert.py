"""Push a round plug over a table into its socket."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from twin.soft.scene import Part, Sight, Thing
from twin.tasks.task import Outcome, Task, Track, block, table

TOP = 0.105  # m
PLUG = (0.010, 0.018)  # m, radius and half height
MOUTH, DEEP = 0.016, 0.018  # m: where the socket begins, and how deep it is
FIT, TALL = 1.5e-3, 0.010  # m: play on either side; half the height of its walls
WALL, FLARE, YAW = 2e-3, 8e-3, np.radians(40.0)  # m, m, rad: half its thickness; half the length of what leads in, and its angle
WANTED, TILTED = 0.012, np.radians(15.0)  # m, rad


class Insert(Task):
    about = "push a round plug of 20 mm over a table into a socket 23 mm wide"
    success = "in the last 0.4 s the plug is 12 mm deep in the socket (of 18), and tilted by less than 15 degrees"
    seconds: ClassVar[float] = 2.6
    strength: ClassVar[float | tuple[float, ...]] = (0.7, 0.0, 0.0)

    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        slick = rng.uniform(0.25, 0.4)
        plug = Thing(
            "object", "cylinder", PLUG, rng.uniform(0.03, 0.05),
            (rng.uniform(0.027, 0.029), rng.uniform(-2e-3, 2e-3), TOP - PLUG[1]), friction=slick,
        )  # fmt: skip
        return plug, table(TOP, *socket(slick), friction=slick)

    def sideways(self, before: float, seen: Sight, start: Sight) -> float:
        """None: what is round may turn, and two walls lead it in."""
        return 0.0

    def judge(self, track: Track) -> Outcome:
        deep = MOUTH - (track.place[:, 0] - PLUG[0])
        inside = (deep > WANTED) & (np.abs(track.place[:, 1]) < PLUG[0])
        if not track.reached:
            return Outcome.NOT_REACHED
        if track.upright()[-1] < np.cos(2.0 * TILTED):
            return Outcome.DROPPED
        if (inside & (track.upright() > np.cos(TILTED)))[track.last].all():
            return Outcome.SUCCESS
        return Outcome.NOT_REACHED if deep[-1] < WANTED else Outcome.SLIPPED


def socket(slick: float) -> tuple[Part, ...]:
    """Two walls, one behind them, and two that lead in."""
    side, half = PLUG[0] + FIT + WALL, 0.5 * DEEP
    parts = [block((WALL, side + WALL, TALL), MOUTH - DEEP - WALL, 0.0, friction=slick)]
    for sign in (-1.0, 1.0):
        lead = MOUTH + FLARE * np.cos(YAW), sign * (side + FLARE * np.sin(YAW))
        parts.append(block((half, WALL, TALL), MOUTH - half, sign * side, friction=slick))
        parts.append(block((FLARE, WALL, TALL), *lead, yaw=sign * YAW, friction=slick))
    return tuple(parts)
