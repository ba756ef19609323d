"""Pick a thin disc up from a table, at its rim."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from twin.soft.scene import Thing
from twin.tasks.task import Outcome, Task, Track, lifted, table


class Pick(Task):
    about = "pick a disc of 46 to 54 mm, 10 mm thick, from a table by its rim"
    success = (
        "1.4 s after the table began to sink (50 mm/s) the disc is within 10 mm of its height and has moved by less than 3 mm in "
        "the last 0.4 s"
    )
    seconds: ClassVar[float] = 3.0
    leaves: ClassVar[float | None] = 1.6

    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, y = rng.uniform(-2e-3, 2e-3, 2)
        thing = Thing(
            "object", "cylinder", (rng.uniform(0.023, 0.027), 5e-3), rng.uniform(0.004, 0.008), (x, y, 0.096),
            friction=rng.uniform(0.8, 1.2),
        )  # fmt: skip
        return thing, table(0.101)

    def judge(self, track: Track) -> Outcome:
        return lifted(track)
