"""Push a round plug over a table into its socket."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Part, SceneState, Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, table_block

SOCKET_TABLE_TOP = 0.105  # m below the palm
PLUG_SIZE = (0.010, 0.018)  # m, radius and half height
SOCKET_MOUTH, SOCKET_DEPTH = 0.016, 0.018  # m: where the socket begins, and how deep it is
SOCKET_PLAY, SOCKET_HALF_HEIGHT = 1.5e-3, 0.010  # m: play on either side; half the height of its walls
# m, m, rad: half a wall's thickness; half the length of the lead-in walls, and their angle
SOCKET_HALF_WALL, FLARE_HALF_LENGTH, FLARE_ANGLE = 2e-3, 8e-3, np.radians(40.0)
WANTED_DEPTH, LARGEST_PLUG_TILT = 0.012, np.radians(15.0)  # m, rad


class Insert(Task):
    """A plug that walls guide into a socket."""

    description = "push a round plug of 20 mm over a table into a socket 23 mm wide"
    success_criterion = "in the last 0.4 s the plug is 12 mm deep in the socket (of 18), and tilted by less than 15 degrees"
    duration: ClassVar[float] = 2.6
    push_strength: ClassVar[float | tuple[float, ...]] = (0.7, 0.0, 0.0)

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        slick = rng.uniform(0.25, 0.4)
        plug = Thing(
            "object", "cylinder", PLUG_SIZE, rng.uniform(0.03, 0.05),
            (rng.uniform(0.027, 0.029), rng.uniform(-2e-3, 2e-3), SOCKET_TABLE_TOP - PLUG_SIZE[1]), friction=slick,
        )  # fmt: skip
        return plug, build_table(SOCKET_TABLE_TOP, *socket_walls(slick), friction=slick)

    def side_push(self, before: float, seen: SceneState, start: SceneState) -> float:
        """Return no side push: a round plug may turn, and two walls guide it."""
        return 0.0

    def judge(self, track: ObjectTrack) -> Outcome:
        depth = SOCKET_MOUTH - (track.place[:, 0] - PLUG_SIZE[0])
        inside = (depth > WANTED_DEPTH) & (np.abs(track.place[:, 1]) < PLUG_SIZE[0])
        if not track.was_touched:
            return Outcome.NOT_REACHED
        if track.tilt_cosine()[-1] < np.cos(2.0 * LARGEST_PLUG_TILT):
            return Outcome.DROPPED
        if (inside & (track.tilt_cosine() > np.cos(LARGEST_PLUG_TILT)))[track.in_final_span].all():
            return Outcome.SUCCESS
        return Outcome.NOT_REACHED if depth[-1] < WANTED_DEPTH else Outcome.SLIPPED


def socket_walls(slick: float) -> tuple[Part, ...]:
    """Return two walls, one behind them, and two that lead in."""
    side, half = PLUG_SIZE[0] + SOCKET_PLAY + SOCKET_HALF_WALL, 0.5 * SOCKET_DEPTH
    parts = [
        table_block(
            (SOCKET_HALF_WALL, side + SOCKET_HALF_WALL, SOCKET_HALF_HEIGHT),
            SOCKET_MOUTH - SOCKET_DEPTH - SOCKET_HALF_WALL,
            0.0,
            friction=slick,
        )
    ]
    for sign in (-1.0, 1.0):
        lead = SOCKET_MOUTH + FLARE_HALF_LENGTH * np.cos(FLARE_ANGLE), sign * (side + FLARE_HALF_LENGTH * np.sin(FLARE_ANGLE))
        parts.append(table_block((half, SOCKET_HALF_WALL, SOCKET_HALF_HEIGHT), SOCKET_MOUTH - half, sign * side, friction=slick))
        parts.append(
            table_block((FLARE_HALF_LENGTH, SOCKET_HALF_WALL, SOCKET_HALF_HEIGHT), *lead, yaw=sign * FLARE_ANGLE, friction=slick)
        )
    return tuple(parts)
