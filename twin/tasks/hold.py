"""Grasp an object that stands on a table and keep it when the table sinks, as if the palm were lifted."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, judge_lift, quaternion_about_z


class Hold(Task):
    """A ball, cylinder or box on a sinking table."""

    description = "grasp a ball, cylinder or box of 36 to 50 mm and keep it when its table sinks away"
    success_criterion = (
        "1.4 s after the table began to sink (50 mm/s) the object is within 10 mm of its height and has moved by less than 3 mm in "
        "the last 0.4 s"
    )
    duration: ClassVar[float] = 3.0
    table_drop_time: ClassVar[float | None] = 1.6

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        shape = str(rng.choice(["sphere", "cylinder", "box"]))
        r, turn = rng.uniform(0.020, 0.025), rng.uniform(-0.3, 0.3)
        size = {"sphere": (r,), "cylinder": (r, 0.02), "box": (0.9 * r, 0.9 * r, 0.02)}[shape]
        half, (x, y) = size[-1], rng.uniform(-3e-3, 3e-3, 2)
        thing = Thing(
            "object", shape, size, rng.uniform(0.012, 0.02), (x, y, 0.088),
            quaternion_about_z(turn), rng.uniform(0.8, 1.2),
        )  # fmt: skip
        return thing, build_table(0.088 + half)

    def judge(self, track: ObjectTrack) -> Outcome:
        return judge_lift(track)
