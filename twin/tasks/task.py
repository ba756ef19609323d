"""Base of all tasks: things around the hand, how a person's hand does it with the fingers, and its success.

A new task is one module in this folder with one subclass of `Task`; it is found by its file's name. Everything random is drawn from
the generator given. Success and failure depend only on the object's path and on whether fingers touched it.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from twin.foundation.errors import UnknownNameError
from twin.mechanics.silicone.motion.scene import Part, SceneState, Thing, Turn, Vector

CONTROL_STEP = 0.02  # s between two observations
TABLE_NAME = "table"
TABLE_HALF_THICKNESS = 5e-3  # m, half the table's thickness
SHORTEST_TOUCH = 0.2  # s: an object touched for less was not reached
FINAL_SPAN = 0.4  # s at the end, over which an object must stay
SIDE_PUSH_GAIN = 1.5  # N/(rad s), of a person's push against a turn that is seen; hands give force, not speed
LARGEST_SIDE_PUSH = 0.6  # N
DROP_DISTANCE, LARGEST_SINK, LARGEST_SLIDE = 30e-3, 10e-3, 3e-3  # m: dropped; slipped since the start; slipped in the final span


class Outcome(StrEnum):
    """How a trial ended."""

    SUCCESS = "success"
    DROPPED = "dropped"
    SLIPPED = "slipped"
    NOT_REACHED = "not reached"
    ENDED = "simulation ended"


@dataclass(frozen=True)
class ObjectTrack:
    """The object over time (n,) s.

    `place` (n, 3) m, `turn` (n, 4) w x y z, `touching` (n,): how many points of the hand touch something, and `other_places` (n,
    thing, 3) m of its other moving things.
    """

    time: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    touching: np.ndarray
    other_places: np.ndarray

    @property
    def was_touched(self) -> bool:
        """Whether the hand touched something for long enough."""
        return bool(np.gradient(self.time)[self.touching > 0].sum() > SHORTEST_TOUCH)

    @property
    def in_final_span(self) -> np.ndarray:
        """Whether each sample lies in the final span, (n,)."""
        return self.time > self.time[-1] - FINAL_SPAN

    def yaw(self) -> np.ndarray:
        """Return the angle (n,) rad turned about the palm's axis since the start."""
        w, z = self.turn[:, 0], self.turn[:, 3]
        angle = np.unwrap(2.0 * np.arctan2(z, w))
        return angle - angle[0]

    def tilt_cosine(self) -> np.ndarray:
        """Return the cosine (n,) of the tilt against the palm's axis."""
        return 1.0 - 2.0 * (self.turn[:, 1] ** 2 + self.turn[:, 2] ** 2)


@dataclass(frozen=True)
class Demonstrator:
    """How one person closes the fingers.

    Where on their backs (height and azimuth (f,) m, rad) and over what width (f,) m a fingertip lies, the final force (f,) N, how
    long closing takes (s), and the tremor of the force: amplitude, rates (2,) Hz, phases (f, 2).
    """

    height: np.ndarray
    azimuth: np.ndarray
    width: np.ndarray
    force: np.ndarray
    closing_time: float
    tremor: float
    tremor_rate: np.ndarray
    tremor_phase: np.ndarray

    @staticmethod
    def draw(rng: np.random.Generator, fingers: int, force: ArrayLike) -> Demonstrator:
        """Draw a person who pushes with about `force` (N), of all fingers or (f,)."""
        return Demonstrator(
            rng.uniform(0.075, 0.088, fingers), np.pi + rng.normal(0.0, 0.12, fingers), rng.uniform(8e-3, 14e-3, fingers),
            np.asarray(force) * rng.uniform(0.85, 1.15) * rng.uniform(0.95, 1.05, fingers), rng.uniform(0.8, 1.2),
            rng.uniform(0.01, 0.04), rng.uniform(0.7, 3.0, 2), rng.uniform(0.0, 2.0 * np.pi, (fingers, 2)),
        )  # fmt: skip

    def push_force(self, t: float) -> np.ndarray:
        """Return the forces (f,) N inwards at time t (s)."""
        tremor = np.sin(2.0 * np.pi * self.tremor_rate * t + self.tremor_phase).sum(axis=1)
        return self.force * smooth_step(t / self.closing_time) * (1.0 + self.tremor * tremor)


class Task(ABC):
    """Base of all tasks. The first of its things is the object; the one named "table" carries it."""

    description: ClassVar[str]
    success_criterion: ClassVar[str]
    duration: ClassVar[float]
    table_drop_time: ClassVar[float | None] = None  # s, from which on the table sinks, at TABLE_SPEED
    push_strength: ClassVar[float | tuple[float, ...]] = 0.9  # N, of a person's push on each finger; zero leaves a finger alone

    @classmethod
    def name(cls) -> str:
        """Return the name of its file."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        """Draw the object and the table, in the palm's frame."""

    def wanted_turn(self, t: float) -> float:
        """Return the angle (rad) by which the object should be turned about the palm's axis, t (s) after the start."""
        return 0.0

    def side_push(self, before: float, state: SceneState, start: SceneState) -> float:
        """Return a person's side push (N) on each finger, from the push `before` and the scene now.

        It acts along the finger's own y axis, which goes around against the palm's z axis, and grows until the object is turned as
        wanted.
        """
        turned = 2.0 * np.arctan2(state.turn[0, 3], state.turn[0, 0]) - 2.0 * np.arctan2(start.turn[0, 3], start.turn[0, 0])
        push = before - SIDE_PUSH_GAIN * CONTROL_STEP * (self.wanted_turn(state.time - start.time) - turned)
        return float(np.clip(push, -LARGEST_SIDE_PUSH, LARGEST_SIDE_PUSH))

    @abstractmethod
    def judge(self, track: ObjectTrack) -> Outcome:
        """Return how the trial ended."""


def smooth_step(share: float) -> float:
    """Return a value from 0 to 1 as `share` goes from 0 to 1, with zero slope at either end."""
    x = min(1.0, max(0.0, share))
    return x * x * (3.0 - 2.0 * x)


def build_table(top: float, *blocks: Part, friction: float = 1.0) -> Thing:
    """Return a table with its upper side `top` (m) below the palm, and the blocks on it."""
    return Thing(
        TABLE_NAME,
        "box",
        (0.1, 0.1, TABLE_HALF_THICKNESS),
        1.0,
        (0.0, 0.0, top + TABLE_HALF_THICKNESS),
        friction=friction,
        fixed=True,
        parts=blocks,
    )


def table_block(size: Vector, x: float, y: float, above: float = 0.0, yaw: float = 0.0, friction: float = 1.0) -> Part:
    """Return a box of half lengths `size` (m) on the table at x, y (m), or `above` it, turned by `yaw` (rad)."""
    return Part("box", size, (x, y, -TABLE_HALF_THICKNESS - above - size[2]), quaternion_about_z(yaw), friction=friction)


def quaternion_about_z(angle: float) -> Turn:
    """Return the rotation by `angle` (rad) about z, as w x y z."""
    return float(np.cos(angle / 2)), 0.0, 0.0, float(np.sin(angle / 2))


def judge_lift(track: ObjectTrack, within: float = LARGEST_SINK) -> Outcome:
    """Judge an object whose table has sunk: it must keep its height to within `within` (m)."""
    sunk = track.place[:, 2] - track.place[0, 2]
    if not track.was_touched:
        return Outcome.NOT_REACHED
    if sunk[-1] > DROP_DISTANCE:
        return Outcome.DROPPED
    way = np.linalg.norm(np.ptp(track.place[track.in_final_span], axis=0))
    return Outcome.SLIPPED if abs(sunk[-1]) > within or way > LARGEST_SLIDE else Outcome.SUCCESS


@cache
def tasks() -> dict[str, type[Task]]:
    """Return all tasks by name."""
    found = {}
    package = importlib.import_module(__package__ or "twin.tasks")
    for module in pkgutil.iter_modules(package.__path__):
        members = vars(importlib.import_module(f"{package.__name__}.{module.name}")).values()
        own = (m for m in members if isinstance(m, type) and issubclass(m, Task) and m.__module__.endswith(f".{module.name}"))
        task = next((m for m in own if not inspect.isabstract(m)), None)
        if task is not None:
            found[module.name] = task
    return found


def make_task(name: str) -> Task:
    """Make the task of this name. Raises UnknownNameError, listing those that exist."""
    try:
        return tasks()[name]()
    except KeyError:
        raise UnknownNameError("task", name, list(tasks())) from None
