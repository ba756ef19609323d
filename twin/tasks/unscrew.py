"""Turn a bayonet cap out from under its hooks, and keep it when the neck that it closed sinks."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Part, Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, judge_lift, quaternion_about_z, smooth_step, table_block

UNSCREW_ANGLE, UNSCREW_START, UNSCREW_DURATION = np.radians(32.0), 1.2, 0.9  # rad, s: free of the hooks from some 20 degrees on
LARGEST_CAP_SINK = 15e-3  # m
NECK_TOP, CAP_HALF_HEIGHT = 0.104, 0.016  # m: the neck that the cap stands on; half the cap's height
LUG_HALF_SIZE = (3e-3, 3e-3, 2e-3)  # m: outwards, around, along the axis
HOOK_HALF_SIZE, HOOK_PLAY = (6e-3, 5e-3, 2e-3), 0.5e-3  # m: the part over a lug, and its gap above the lug
BOSS_SIZE = (0.010, 1e-3)  # m, radius and half height of the boss that the cap stands on
LUG_FRICTION = 0.2  # of lugs on hooks, and of the boss on the neck
HOOK_AZIMUTHS = np.radians([60.0, 180.0, 300.0])  # rad, between the fingers


class Unscrew(Task):
    """A cap under three hooks, on a sinking neck."""

    description = "turn a cap of 40 to 46 mm out from under three hooks (some 20 degrees) and keep it when the neck sinks away"
    success_criterion = (
        "1.4 s after the neck began to sink (50 mm/s), hooks and all, the cap is within 15 mm of its height and has moved by less "
        "than 3 mm in the last 0.4 s"
    )
    duration: ClassVar[float] = 3.7
    table_drop_time: ClassVar[float | None] = 2.3

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        r, low = rng.uniform(0.020, 0.023), CAP_HALF_HEIGHT - LUG_HALF_SIZE[2]
        out = r + LUG_HALF_SIZE[0] - 1e-3  # a millimetre within the cap
        lugs = tuple(
            Part("box", LUG_HALF_SIZE, (out * np.cos(a), out * np.sin(a), low), quaternion_about_z(a), friction=LUG_FRICTION)
            for a in HOOK_AZIMUTHS
        )
        boss = Part("cylinder", BOSS_SIZE, (0.0, 0.0, CAP_HALF_HEIGHT + BOSS_SIZE[1]), friction=LUG_FRICTION)
        cap = Thing(
            "object", "cylinder", (r, CAP_HALF_HEIGHT), rng.uniform(0.012, 0.02),
            (0.0, 0.0, NECK_TOP - 2.0 * BOSS_SIZE[1] - CAP_HALF_HEIGHT), friction=rng.uniform(0.8, 1.2), parts=(*lugs, boss),
        )  # fmt: skip
        return cap, build_table(NECK_TOP, *(part for a in HOOK_AZIMUTHS for part in hook_parts(r, a)), friction=LUG_FRICTION)

    def wanted_turn(self, t: float) -> float:
        return UNSCREW_ANGLE * smooth_step((t - UNSCREW_START) / UNSCREW_DURATION)

    def judge(self, track: ObjectTrack) -> Outcome:
        return judge_lift(track, LARGEST_CAP_SINK)


def hook_parts(r: float, azimuth: float) -> tuple[Part, Part]:
    """Return the hook over the lug of a cap of radius r (m): a post outside of it, and the part over it."""
    under = 2.0 * (BOSS_SIZE[1] + LUG_HALF_SIZE[2]) + HOOK_PLAY
    post, over = r + 2.0 * LUG_HALF_SIZE[0] + 2.5e-3, r + 1e-3 + HOOK_HALF_SIZE[0]
    return (
        table_block(
            (1.5e-3, HOOK_HALF_SIZE[1], 0.5 * under),
            post * np.cos(azimuth),
            post * np.sin(azimuth),
            yaw=azimuth,
            friction=LUG_FRICTION,
        ),
        table_block(HOOK_HALF_SIZE, over * np.cos(azimuth), over * np.sin(azimuth), under, azimuth, LUG_FRICTION),
    )
