"""A wall or a round post stands near the robot; the disks (balls of 10 mm) touch it in some trials.

The gap to the straight robot's axis is 95 mm - 25 mm strength for a wall and 80 mm - 25 mm strength for a post, so strength
moves the obstacle in. Penalty stiffness 0.3 to 3 N/mm, see `tools/simulators/rod/fields.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation
from tools.simulators.rod.fields import POST, WALL


@dataclass(frozen=True)
class Contact(Effect):
    id: ClassVar[str] = "contact"
    most: ClassVar[float] = 2.5

    kind: int  # WALL or POST
    azimuth: float  # rad
    height: float  # m along the robot where the post passes
    stiffness: float  # N/m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Contact:
        return cls(
            1.0,
            int(rng.choice([WALL, POST])),
            float(rng.uniform(0, 2 * np.pi)),
            float(rng.uniform(0.07, 0.10)),
            float(np.exp(rng.uniform(np.log(300), np.log(3000)))),
        )

    def mount(self, situation: Situation) -> None:
        out = np.array([np.cos(self.azimuth), np.sin(self.azimuth), 0.0])
        if self.kind == WALL:
            row = [WALL, 1, *((0.095 - 0.025 * self.strength) * out), *-out, self.stiffness, 0.010]
        else:
            point = (0.080 - 0.025 * self.strength) * out + [0.0, 0.0, self.height]
            along = [-out[1], out[0], 0.0]
            row = [POST, 1, *point, *along, self.stiffness, 0.015]
        situation.fields = np.vstack([situation.fields, row])
