"""A hand among rigid things that it may touch, hold and move: one MuJoCo model, driven by servos or tendon by tendon.

A servo drives a pair of antagonist tendons: it winds the first in by as much as it pays the second out. Fingers touch things,
things touch each other and the table; fingers do not touch each other. Forces on the skin stand for a person's hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from twin.body import Drive, Loads, Problem, Route
from twin.foundation.errors import DataError, SolveError
from twin.mechanics.silicone.hand import HandBody, hand_motion, start_hand
from twin.mechanics.silicone.motion.stepping import unique_contacts
from twin.mechanics.silicone.motion.things import Part, Thing, ThingPoses, Turn, Vector

__all__ = ["Part", "Scene", "SceneState", "Thing", "Turn", "Vector"]

# MuJoCo's impratio, with an elliptic cone: a ball of 15 g held by three fingers sinks by 0.2 mm/s, with the default of 1 by 4.
IMPRATIO = 20.0
LONGEST_SCENE_STEP = 2.5e-3  # s; half of it moves fingers that hold a ball by 0.01 mm, the ball by 0.04 mm


@dataclass(frozen=True)
class SceneState:
    """State of a scene at an instant.

    Time (s); shortenings of the tendons (finger, tendon) m; tensions (finger, tendon) N; nodes' displacements (finger, n_free, 3) m
    in each finger's own frame; strain (finger, sensor) and resistance of the cords, ohm; of each moving thing its place (thing, 3)
    m, turn (thing, 4), velocity and angular velocity (thing, 6) m/s, rad/s; the number of points of the hand in contact.
    """

    time: float
    shortening: np.ndarray
    tension: np.ndarray
    nodes: np.ndarray
    strain: np.ndarray
    resistance: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    velocity: np.ndarray
    touching: int

    @property
    def servos(self) -> np.ndarray:
        """(finger, pair) m: half the difference of the shortenings of each pair."""
        first, second = np.split(self.shortening, 2, axis=1)
        return 0.5 * (first - second)


class Scene:
    """A hand and things, at rest with all servos at zero when created or reset."""

    def __init__(self, body: HandBody, things: Sequence[Thing], gravity: ArrayLike, route: Route | None = None) -> None:
        """`gravity` (3,) m/s^2 in the palm's frame; `route` gives the tendons' friction.

        Raises DataError for things of the same name and for fingers without pairs of tendons, SolveError where the hand has no
        equilibrium.
        """
        tendons = len(body.fingers[0].paths)
        if tendons % 2 or len({t.name for t in things}) < len(things):
            raise DataError("a scene needs fingers with pairs of tendons, and things of different names")
        self.pairs, self.things = tendons // 2, tuple(things)
        n = tendons * len(body.fingers)
        rest = Problem(
            np.zeros(1), np.zeros((1, n)), Loads(np.asarray(gravity, float)), route or Route(), (Drive.DISPLACEMENT,) * n
        )
        resting, spec = start_hand(body, rest, LONGEST_SCENE_STEP)
        for thing in things:
            thing.add(spec)
        self.spec, self.motion = spec, hand_motion(resting, spec)
        self.model, self.data = self.motion.model, self.motion.data
        self.model.opt.cone, self.model.opt.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPRATIO
        self._poses = ThingPoses(self.model, things)
        self._shortening = np.zeros((len(resting), tendons))
        self._initial = [self.data.qpos.copy(), self.model.body_pos.copy(), *(a.copy() for a in self._body_states())]

    def reset(self) -> SceneState:
        """Return to the initial rest."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._initial[0]
        self.model.body_pos[:] = self._initial[1]
        for array, kept in zip(self._body_states(), self._initial[2:], strict=True):
            array[:] = kept
        self._shortening[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        return self.observe()

    def step(self, servos: ArrayLike, seconds: float) -> SceneState:
        """Advance for some seconds (at least a step) while the servos (finger, pair) m go linearly to their commands.

        Raises DataError for a command that is not finite, SolveError naming the finger, or the thing, and the time where it is
        lost.
        """
        command = _finite("servo", np.asarray(servos, float).reshape(-1, self.pairs))
        return self.step_tendons(np.concatenate([command, -command], axis=1), seconds)

    def step_tendons(self, shortening: ArrayLike, seconds: float) -> SceneState:
        """As `step`, each tendon by itself: shortened by (finger, tendon) m from the hanging rest; far below zero it is slack."""
        command = _finite("tendon", np.asarray(shortening, float).reshape(self._shortening.shape))
        steps = max(1, round(seconds / self.motion.step))
        self.motion.run(self._shortening, command, steps)
        self._shortening = command.copy()
        lost = ~np.isfinite(self._poses.read(self.data)[0]).all(axis=1)
        if lost.any():
            name = self._poses.things[int(np.argmax(lost))].name
            raise SolveError(
                f"thing {name!r} is lost at t = {self.data.time:.4g} s; slower servos, or a heavier thing, may keep it"
            )
        return self.observe()

    def set_node_forces(self, force: ArrayLike) -> None:
        """Set forces (finger, n_free, 3) N on the fingers' nodes from now on, in each finger's own frame."""
        for body, one in zip(self.motion.bodies, np.asarray(force, float), strict=True):
            body.force[:] = one.ravel()

    def move_thing(self, name: str, shift: ArrayLike) -> None:
        """Move a fixed thing by (3,) m of the palm's frame; contacts do not see its speed."""
        self.model.body(name).pos += np.asarray(shift, float)

    def restore_shortening(self, shortening: np.ndarray) -> None:
        """Set the tendons' present shortenings (finger, tendon) m, beside a restored motion."""
        self._shortening = shortening.copy()

    def observe(self) -> SceneState:
        """Return the present state."""
        data, hand = self.data, self.motion
        nodes = np.stack([hand.displacement(k) for k in range(len(hand.bodies))])
        signals = [s.statics.sensor_signals(u[None]) for s, u in zip(hand.resting, nodes, strict=True)]
        return SceneState(
            float(data.time), self._shortening.copy(), np.stack([body.tension for body in hand.bodies]), nodes,
            np.concatenate([f["strain"] for f in signals]), np.concatenate([f["sensor"] for f in signals]),
            *self._poses.read(data), self._count_contacts(),
        )  # fmt: skip

    def _body_states(self) -> list[np.ndarray]:
        """Return the arrays of the fingers that change from step to step and are not part of MuJoCo's state."""
        return [a for body in self.motion.bodies for a in (body.slip, body.distal, body.tension, body.force)]

    def _count_contacts(self) -> int:
        if not self.data.ncon:
            return 0
        contact, own = self.data.contact, (self.data.contact.flex >= 0).any(axis=1)
        return len(unique_contacts(contact.pos[own], contact.geom[own], contact.flex[own]))


def _finite(drive: str, command: np.ndarray) -> np.ndarray:
    """Return the command. Raises DataError naming the drive (servo or tendon) whose command is not finite."""
    if not np.isfinite(command).all():
        number = int(np.flatnonzero(~np.isfinite(command))[0]) + 1
        raise DataError(f"{drive} {number}: the command {command.tolist()} is not finite; finite numbers (m) are needed")
    return command
