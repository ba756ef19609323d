"""A hand among rigid things that it may touch, hold and move: one MuJoCo model, driven by its servos or tendon by tendon.

A servo drives a pair of antagonist tendons: it pulls the first in by as much as it pays the second out. Fingers touch things,
things touch each other and the table; fingers do not touch each other. Forces on the skin stand for a person's hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from twin.body import Problem
from twin.effects import Drive, Loads, Route
from twin.errors import DataError, SolveError
from twin.soft.hand import HandBody, moving, stand
from twin.soft.stepping import once
from twin.soft.things import Part, Places, Thing, Turn, Vector

__all__ = ["Part", "Scene", "Sight", "Thing", "Turn", "Vector"]

# MuJoCo's impratio, with an elliptic cone: a ball of 15 g held by three fingers sinks by 0.2 mm/s, with its usual 1 by 4.
STICKS = 20.0
LONGEST = 2.5e-3  # s: half of it moves fingers that hold a ball by 0.01 mm, the ball by 0.04


@dataclass(frozen=True)
class Sight:
    """An instant: time (s); shortenings of the tendons (finger, tendon) m; tensions (finger, tendon) N; nodes' displacements
    (finger, n_free, 3) m in each finger's own frame; strain (finger, sensor) and resistance of the cords, ohm; of each thing that
    moves its place (thing, 3) m, turn (thing, 4), velocity and angular velocity (thing, 6) m/s, rad/s; how many points of the
    hand touch something."""

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
        """(finger, pair) m: by how much more the first of each pair is pulled in than half of both."""
        first, second = np.split(self.shortening, 2, axis=1)
        return 0.5 * (first - second)


class Scene:
    """A hand and things, at rest with all servos at zero when it is made or reset."""

    def __init__(self, body: HandBody, things: Sequence[Thing], gravity: ArrayLike, route: Route | None = None) -> None:
        """`gravity` (3,) m/s^2 in the palm's frame; `route` gives the tendons' friction.

        Raises DataError for things of one name and for fingers whose tendons are no pairs, SolveError where the hand has no
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
        started, spec = stand(body, rest, LONGEST)
        for thing in things:
            thing.add(spec)
        self.spec, self.moving = spec, moving(started, spec)
        self.model, self.data = self.moving.model, self.moving.data
        self.model.opt.cone, self.model.opt.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, STICKS
        self._places = Places(self.model, things)
        self._pulled = np.zeros((len(started), tendons))
        self._kept = [self.data.qpos.copy(), self.model.body_pos.copy(), *(a.copy() for a in self._memory())]

    def reset(self) -> Sight:
        """Back to rest, as it was made."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._kept[0]
        self.model.body_pos[:] = self._kept[1]
        for array, kept in zip(self._memory(), self._kept[2:], strict=True):
            array[:] = kept
        self._pulled[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        return self.see()

    def step(self, servos: ArrayLike, seconds: float) -> Sight:
        """On for some time (at least a step) while the servos (finger, pair) m go straight to where they are told.

        Raises DataError for a command that is not finite, SolveError naming the finger, or the thing, and the time where it is
        lost.
        """
        told = np.asarray(servos, float).reshape(-1, self.pairs)
        if not np.isfinite(told).all():
            raise DataError(f"servo {int(np.flatnonzero(~np.isfinite(told))[0]) + 1} is told {told.tolist()}; a number is needed")
        return self.pull(np.concatenate([told, -told], axis=1), seconds)

    def pull(self, shortening: ArrayLike, seconds: float) -> Sight:
        """As `step`, each tendon by itself: shortened by (finger, tendon) m from the hanging rest; far below zero it is slack."""
        told = np.asarray(shortening, float).reshape(self._pulled.shape)
        if not np.isfinite(told).all():
            raise DataError(f"tendon {int(np.flatnonzero(~np.isfinite(told))[0]) + 1} is told {told.tolist()}; a number is needed")
        steps = max(1, round(seconds / self.moving.step))
        self.moving.run(self._pulled, told, steps)
        self._pulled = told.copy()
        lost = ~np.isfinite(self._places.see(self.data)[0]).all(axis=1)
        if lost.any():
            name = self._places.things[int(np.argmax(lost))].name
            raise SolveError(
                f"thing {name!r} is lost at t = {self.data.time:.4g} s; slower servos, or a heavier thing, may keep it"
            )
        return self.see()

    def press(self, force: ArrayLike) -> None:
        """From now on forces (finger, n_free, 3) N act on the fingers' nodes, in each finger's own frame."""
        for limb, one in zip(self.moving.limbs, np.asarray(force, float), strict=True):
            limb.force[:] = one.ravel()

    def shift(self, name: str, way: ArrayLike) -> None:
        """Move a fixed thing on by (3,) m of the palm's frame: what it carries does not feel its speed."""
        self.model.body(name).pos += np.asarray(way, float)

    def see(self) -> Sight:
        """Where all is now."""
        data, hand = self.data, self.moving
        nodes = np.stack([hand.u(k) for k in range(len(hand.limbs))])
        felt = [s.statics.sensed(u[None]) for s, u in zip(hand.started, nodes, strict=True)]
        return Sight(
            float(data.time), self._pulled.copy(), np.stack([limb.tension for limb in hand.limbs]), nodes,
            np.concatenate([f["strain"] for f in felt]), np.concatenate([f["sensor"] for f in felt]),
            *self._places.see(data), self._touching(),
        )  # fmt: skip

    def _memory(self) -> list[np.ndarray]:
        """What the fingers carry from step to step beside MuJoCo's state."""
        return [a for limb in self.moving.limbs for a in (limb.slip, limb.beyond, limb.tension, limb.force)]

    def _touching(self) -> int:
        if not self.data.ncon:
            return 0
        contact, own = self.data.contact, (self.data.contact.flex >= 0).any(axis=1)
        return len(once(contact.pos[own], contact.geom[own], contact.flex[own]))
