"""Effects around the robot: a tilted base, a turned camera, something in the way, a weight at the tip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation, rotation, unit_vector
from tools.simulators.rod.mechanics.fields import POST_FIELD, WALL_FIELD


@dataclass(frozen=True)
class BaseTilt(Effect):
    """Gravity points elsewhere than declared: turned by 1 degree strength about an axis fixed in the base frame. Markers stay
    there."""

    id: ClassVar[str] = "base_tilt"
    most: ClassVar[float] = 12.0

    axis: tuple[float, float, float]  # unit vector in the base frame, the same whichever way the robot is mounted

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BaseTilt:
        return cls(1.0, tuple(float(v) for v in unit_vector(rng)))

    def mount(self, situation: Situation) -> None:
        situation.gravity = rotation(np.radians(self.strength) * np.array(self.axis)) @ situation.gravity


@dataclass(frozen=True)
class CameraMisalignment(Effect):
    """The marker frame is turned by 0.7 degree strength and shifted by 0.5 mm strength against the base: y = Q x + b."""

    id: ClassVar[str] = "camera_misalignment"
    most: ClassVar[float] = 5.0

    axis: tuple[float, ...]
    shift: tuple[float, ...]  # direction and share of the shift

    @classmethod
    def draw(cls, rng: np.random.Generator) -> CameraMisalignment:
        return cls(1.0, tuple(unit_vector(rng)), tuple(rng.uniform(0.3, 1.0) * unit_vector(rng)))

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        turned = markers @ rotation(np.radians(0.7 * self.strength) * np.array(self.axis)).T
        return turned + 0.5e-3 * self.strength * np.array(self.shift)


@dataclass(frozen=True)
class Contact(Effect):
    """A wall or a round post stands near the robot; the disks (balls of 10 mm) touch it in some trials.

    The gap to the straight robot's axis is 95 mm - 25 mm strength for a wall and 80 mm - 25 mm strength for a post, so strength
    moves the obstacle in. Penalty stiffness 0.3 to 3 N/mm, see `tools/simulators/rod/mechanics/fields.py`.
    """

    id: ClassVar[str] = "contact"
    most: ClassVar[float] = 2.5

    kind: int  # WALL_FIELD or POST_FIELD
    azimuth: float  # rad
    height: float  # m along the robot where the post passes
    stiffness: float  # N/m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Contact:
        return cls(
            1.0,
            int(rng.choice([WALL_FIELD, POST_FIELD])),
            float(rng.uniform(0, 2 * np.pi)),
            float(rng.uniform(0.07, 0.10)),
            float(np.exp(rng.uniform(np.log(300), np.log(3000)))),
        )

    def mount(self, situation: Situation) -> None:
        out = np.array([np.cos(self.azimuth), np.sin(self.azimuth), 0.0])
        if self.kind == WALL_FIELD:
            row = [WALL_FIELD, 1, *((0.095 - 0.025 * self.strength) * out), *-out, self.stiffness, 0.010]
        else:
            point = (0.080 - 0.025 * self.strength) * out + [0.0, 0.0, self.height]
            along = [-out[1], out[0], 0.0]
            row = [POST_FIELD, 1, *point, *along, self.stiffness, 0.015]
        situation.fields = np.vstack([situation.fields, row])


@dataclass(frozen=True)
class TipPayload(Effect):
    """A mass of 1 g strength at the tip that nobody wrote down."""

    id: ClassVar[str] = "tip_payload"

    def mount(self, situation: Situation) -> None:
        situation.payload += 1e-3 * self.strength
