"""What a task is: things around the hand, how a person's hand does it with the fingers, and when it is done.

A new task is one file in this folder with one subclass of `Task`; it is found by itself, by its file's name. All is drawn from the
generator that it is given. Success and failures are told from the object's path and from whether fingers touched it, and from
nothing else.
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

from twin.errors import UnknownNameError
from twin.soft.scene import Part, Sight, Thing, Turn, Vector

STEP = 0.02  # s from look to look
TABLE = "table"
HALF = 5e-3  # m, half the table's thickness
TOUCHED = 0.2  # s: touched for less than that an object was not reached
LAST = 0.4  # s at the end, over which an object must stay
EAGER = 1.5  # N/(rad s): how a person who sees a thing turn pushes against it; force, not speed, is what hands give
STRONGEST = 0.6  # N
FALLEN, SUNK, SLIDES = 30e-3, 10e-3, 3e-3  # m: dropped; slipped since the start; slipped in the last LAST s


class Outcome(StrEnum):
    SUCCESS = "success"
    DROPPED = "dropped"
    SLIPPED = "slipped"
    NOT_REACHED = "not reached"
    ENDED = "simulation ended"


@dataclass(frozen=True)
class Track:
    """The object over time (n,) s: place (n, 3) m, turn (n, 4) w x y z, how many points of the hand touch something (n,), and where
    its other things are that move, (n, thing, 3) m."""

    time: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    touching: np.ndarray
    others: np.ndarray

    @property
    def reached(self) -> bool:
        return bool(np.gradient(self.time)[self.touching > 0].sum() > TOUCHED)

    @property
    def last(self) -> np.ndarray:
        """(n,) whether it is within the last LAST s."""
        return self.time > self.time[-1] - LAST

    def yaw(self) -> np.ndarray:
        """(n,) rad turned about the palm's axis since the start."""
        w, z = self.turn[:, 0], self.turn[:, 3]
        angle = np.unwrap(2.0 * np.arctan2(z, w))
        return angle - angle[0]

    def upright(self) -> np.ndarray:
        """(n,) the cosine of its tilt against the palm's axis."""
        return 1.0 - 2.0 * (self.turn[:, 1] ** 2 + self.turn[:, 2] ** 2)


@dataclass(frozen=True)
class Person:
    """How one person closes the fingers: where on their backs (height and azimuth (f,) m, rad) and over what width (f,) m a
    fingertip lies, with what force (f,) N in the end, how long it takes (s), and how the force trembles: amplitude, rates (2,) Hz,
    phases (f, 2)."""

    height: np.ndarray
    azimuth: np.ndarray
    width: np.ndarray
    force: np.ndarray
    closes: float
    tremor: float
    rate: np.ndarray
    phase: np.ndarray

    @staticmethod
    def draw(rng: np.random.Generator, fingers: int, force: ArrayLike) -> Person:
        """One of many, who pushes with some `force` (N), of all fingers or (f,)."""
        return Person(
            rng.uniform(0.075, 0.088, fingers), np.pi + rng.normal(0.0, 0.12, fingers), rng.uniform(8e-3, 14e-3, fingers),
            np.asarray(force) * rng.uniform(0.85, 1.15) * rng.uniform(0.95, 1.05, fingers), rng.uniform(0.8, 1.2),
            rng.uniform(0.01, 0.04), rng.uniform(0.7, 3.0, 2), rng.uniform(0.0, 2.0 * np.pi, (fingers, 2)),
        )  # fmt: skip

    def squeeze(self, t: float) -> np.ndarray:
        """(f,) N inwards at time t (s)."""
        trembles = np.sin(2.0 * np.pi * self.rate * t + self.phase).sum(axis=1)
        return self.force * eased(t / self.closes) * (1.0 + self.tremor * trembles)


class Task(ABC):
    """Base of all tasks. The first of its things is the object; the one named "table" carries it."""

    about: ClassVar[str]
    success: ClassVar[str]
    seconds: ClassVar[float]
    leaves: ClassVar[float | None] = None  # s: from when on the table sinks away, at SINKS
    strength: ClassVar[float | tuple[float, ...]] = 0.9  # N, of a person's push on each finger; no force leaves a finger alone

    @classmethod
    def name(cls) -> str:
        """Its file's."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        """The object and the table, in the palm's frame."""

    def turns(self, t: float) -> float:
        """rad by which a person wants the object turned about the palm's axis, t (s) after the start."""
        return 0.0

    def sideways(self, before: float, seen: Sight, start: Sight) -> float:
        """N by which a person who pushed by `before` and sees this pushes each finger along its own y axis, which goes around
        against the palm's z axis: ever harder until the object is turned as it should be by now."""
        turned = 2.0 * np.arctan2(seen.turn[0, 3], seen.turn[0, 0]) - 2.0 * np.arctan2(start.turn[0, 3], start.turn[0, 0])
        push = before - EAGER * STEP * (self.turns(seen.time - start.time) - turned)
        return float(np.clip(push, -STRONGEST, STRONGEST))

    @abstractmethod
    def judge(self, track: Track) -> Outcome:
        """What became of it."""


def eased(share: float) -> float:
    """From 0 to 1 as `share` goes from 0 to 1, without a jerk at either end."""
    x = min(1.0, max(0.0, share))
    return x * x * (3.0 - 2.0 * x)


def table(top: float, *blocks: Part, friction: float = 1.0) -> Thing:
    """Its upper side `top` (m) below the palm, and what stands on it."""
    return Thing(TABLE, "box", (0.1, 0.1, HALF), 1.0, (0.0, 0.0, top + HALF), friction=friction, fixed=True, parts=blocks)


def block(size: Vector, x: float, y: float, above: float = 0.0, yaw: float = 0.0, friction: float = 1.0) -> Part:
    """A box of half lengths `size` (m) that stands on the table at x, y (m), or `above` it, turned by `yaw` (rad)."""
    return Part("box", size, (x, y, -HALF - above - size[2]), about_z(yaw), friction=friction)


def about_z(angle: float) -> Turn:
    """w x y z."""
    return float(np.cos(angle / 2)), 0.0, 0.0, float(np.sin(angle / 2))


def lifted(track: Track, within: float = SUNK) -> Outcome:
    """Of an object whose table has gone: it is where it was, to within some height (m)."""
    sunk = track.place[:, 2] - track.place[0, 2]
    if not track.reached:
        return Outcome.NOT_REACHED
    if sunk[-1] > FALLEN:
        return Outcome.DROPPED
    way = np.linalg.norm(np.ptp(track.place[track.last], axis=0))
    return Outcome.SLIPPED if abs(sunk[-1]) > within or way > SLIDES else Outcome.SUCCESS


@cache
def tasks() -> dict[str, type[Task]]:
    """All tasks by name."""
    found = {}
    package = importlib.import_module(__package__ or "twin.tasks")
    for module in pkgutil.iter_modules(package.__path__):
        members = vars(importlib.import_module(f"{package.__name__}.{module.name}")).values()
        own = (m for m in members if isinstance(m, type) and issubclass(m, Task) and m.__module__.endswith(f".{module.name}"))
        law = next((m for m in own if not inspect.isabstract(m)), None)
        if law is not None:
            found[module.name] = law
    return found


def task(name: str) -> Task:
    """The task of this name. Raises UnknownNameError, listing those that exist."""
    try:
        return tasks()[name]()
    except KeyError:
        raise UnknownNameError("task", name, list(tasks())) from None
