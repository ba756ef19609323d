"""Pick up a thin disc from a table, at its rim."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, judge_lift


class Pick(Task):
    """A thin disc on a sinking table."""

    description = "pick a disc of 46 to 54 mm, 10 mm thick, from a table by its rim"
    success_criterion = (
        "1.4 s after the table began to sink (50 mm/s) the disc is within 10 mm of its height and has moved by less than 3 mm in "
        "the last 0.4 s"
    )
    duration: ClassVar[float] = 3.0
    table_drop_time: ClassVar[float | None] = 1.6

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, y = rng.uniform(-2e-3, 2e-3, 2)
        thing = Thing(
            "object", "cylinder", (rng.uniform(0.023, 0.027), 5e-3), rng.uniform(0.004, 0.008), (x, y, 0.096),
            friction=rng.uniform(0.8, 1.2),
        )  # fmt: skip
        return thing, build_table(0.101)

    def judge(self, track: ObjectTrack) -> Outcome:
        return judge_lift(track)
