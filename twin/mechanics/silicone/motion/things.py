"""Rigid things that a hand touches, and their poses in MuJoCo."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from twin.foundation.errors import DataError
from twin.mechanics.silicone.material.flex import FINGER_BIT, THING_BIT

CONTACT_TIME = 4e-3  # s, MuJoCo's time constant of a contact; skin then sinks in by tenths of a millimetre
SHAPES = {
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, 1),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, 2),
    "box": (mujoco.mjtGeom.mjGEOM_BOX, 3),
}
MOVING_COLOUR, FIXED_COLOUR = (0.2, 0.45, 0.7, 1.0), (0.62, 0.62, 0.6, 1.0)  # RGBA
CENTRE_TOLERANCE = 1e-9  # m, of a free thing's centre of mass

Vector = tuple[float, float, float]
Turn = tuple[float, float, float, float]
UPRIGHT: Turn = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Part:
    """A solid rigidly joined to a thing.

    `shape`, `size`, `friction` as a thing's; place (3,) m and turn (4,) w x y z in the thing's frame; `mass` kg, zero if
    negligible.
    """

    shape: str
    size: tuple[float, ...]
    place: Vector
    turn: Turn = UPRIGHT
    mass: float = 0.0
    friction: float = 1.0


@dataclass(frozen=True)
class Thing:
    """A rigid body.

    `shape` is sphere (size: radius), cylinder (radius, half length) or box (three half lengths), m; `mass` kg, its place (3,) m and
    orientation, (4,) w x y z, in the palm's frame; its friction coefficient. A `fixed` thing does not move. One with a `hinge`, a
    point and an axis in its own frame, turns about it without friction and moves no other way. `parts` are joined to it; a free
    thing needs its centre of mass, parts included, at its place.
    """

    name: str
    shape: str
    size: tuple[float, ...]
    mass: float
    place: Vector
    turn: Turn = UPRIGHT
    friction: float = 1.0
    fixed: bool = False
    hinge: tuple[Vector, Vector] | None = None
    parts: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        for solid in (self, *self.parts):
            if solid.shape not in SHAPES:
                raise DataError(f"thing {self.name!r}: no shape {solid.shape!r}; allowed: {', '.join(SHAPES)}")
            needed = SHAPES[solid.shape][1]
            if len(solid.size) != needed or not min(solid.size) > 0.0 or not self.mass > 0.0:
                raise DataError(f"thing {self.name!r}: {needed} sizes and a mass above zero are needed of a {solid.shape}")
        centre = sum((part.mass * np.array(part.place) for part in self.parts), np.zeros(3))
        if not self.fixed and self.hinge is None and np.abs(centre).max() > CENTRE_TOLERANCE * self.mass:
            raise DataError(f"thing {self.name!r}: its parts move its centre of mass from its place; balance them, or fix it")

    @property
    def solids(self) -> tuple[Part, ...]:
        """All solids that it is made of."""
        return Part(self.shape, self.size, (0.0, 0.0, 0.0), UPRIGHT, self.mass, self.friction), *self.parts

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add the thing to a MuJoCo model."""
        body = spec.worldbody.add_body(name=self.name, pos=self.place, quat=self.turn)
        if self.hinge is not None:
            point, axis = self.hinge
            body.add_joint(name=self.name, type=mujoco.mjtJoint.mjJNT_HINGE, pos=point, axis=axis)
        elif not self.fixed:
            body.add_freejoint(name=self.name)
        for k, part in enumerate(self.solids):
            body.add_geom(
                name=self.name if not k else f"{self.name} {k}", type=SHAPES[part.shape][0], size=[*part.size, 0.0, 0.0][:3],
                pos=part.place, quat=part.turn, mass=part.mass, friction=[part.friction, 5e-3, 1e-4], contype=THING_BIT,
                conaffinity=THING_BIT | FINGER_BIT, priority=1, solref=[CONTACT_TIME, 1.0],
                rgba=FIXED_COLOUR if self.fixed else MOVING_COLOUR,
            )  # fmt: skip


class ThingPoses:
    """Poses of the things of a model that move, free and hinged."""

    def __init__(self, model: mujoco.MjModel, things: Sequence[Thing]) -> None:
        self.things = [t for t in things if not t.fixed]
        joints = [model.joint(t.name) for t in self.things]
        self._at = [int(j.qposadr[0]) for j in joints]
        self._speed = [int(j.dofadr[0]) for j in joints]

    def read(self, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return places (n, 3) m, turns (n, 4) w x y z, and velocities (n, 6).

        Velocity is in the palm's frame, angular velocity in the thing's.
        """
        poses, speeds = np.empty((len(self.things), 7)), np.empty((len(self.things), 6))
        for k, (thing, a, d) in enumerate(zip(self.things, self._at, self._speed, strict=True)):
            if thing.hinge is None:
                poses[k], speeds[k] = data.qpos[a : a + 7], data.qvel[d : d + 6]
            else:
                poses[k], speeds[k] = _hinged_pose(thing, float(data.qpos[a]), float(data.qvel[d]))
        return poses[:, :3], poses[:, 3:], speeds


def _hinged_pose(thing: Thing, angle: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pose (7,) and velocities (6,) of a hinged thing at `angle` (rad) and `speed` (rad/s)."""
    assert thing.hinge is not None
    point, axis = np.array(thing.hinge[0]), np.array(thing.hinge[1]) / np.linalg.norm(thing.hinge[1])
    step, turn, arm, there = np.empty(4), np.empty(4), np.empty(3), np.empty(3)
    mujoco.mju_axisAngle2Quat(step, axis, angle)
    mujoco.mju_mulQuat(turn, np.array(thing.turn), step)
    mujoco.mju_rotVecQuat(there, point, np.array(thing.turn))
    mujoco.mju_rotVecQuat(arm, -point, turn)
    around = np.empty(3)
    mujoco.mju_rotVecQuat(around, speed * axis, turn)
    return np.concatenate([thing.place + there + arm, turn]), np.concatenate([np.cross(around, arm), speed * axis])
