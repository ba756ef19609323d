"""What every effect is: frozen numbers, a law in words, and the places where it acts.

Every place has a default that changes nothing; an effect overrides the one where it acts. Numbers named in `size` grow together
when an effect is made as large as a day wants it; the others stay as drawn.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from scipy.spatial.transform import Rotation

from tools.simulators.second_rod.day import Day, Drive, Trial, Want
from tools.simulators.second_rod.mechanics.rod import Rod
from tools.simulators.second_rod.robot import Robot

Array = np.ndarray
Numbers = float | tuple["Numbers", ...]


class Backbone:
    """What a backbone does over a day beyond elasticity: a rest shape and a stiffness that may remember."""

    def rest(self) -> Array | float:
        """(3 n) coefficients of the curvature without stress, rad, to be added to the others'."""
        return 0.0

    def stiffness(self, clock: float) -> float:
        """Factor on bending and twisting stiffness at a time of the day, s."""
        return 1.0

    def wait(self, seconds: float) -> None:
        """Between trials, straight and unloaded."""

    def spend(self, seconds: float, elastic: Array, moved: Array) -> None:
        """In a trial: elastic (3 n) curvature held for so long, moved (3 n) the change of curvature that led there, rad."""


@dataclass(frozen=True)
class Markers:
    """One trial's markers, before noise, and what they depend on; (rows, INTERVALS, 3)."""

    positions: Array  # m
    axes: Array  # of the disks
    gravity: Array  # (3,) m/s^2, as it is
    number: int  # of the trial


@dataclass(frozen=True)
class Effect:
    """One effect with its numbers; SI units unless the law says otherwise."""

    name: ClassVar[str]  # of the draw
    identifier: ClassVar[str]  # in measurements.md's list, or `name` for what no catalogue has
    known: ClassVar[bool] = True
    law: ClassVar[str]  # in one line, with the parameters' names and units
    size: ClassVar[tuple[str, ...]]
    largest: ClassVar[float]  # of the largest number in size[0]
    drives: ClassVar[frozenset[Drive]] = frozenset({"tension"})  # where it shows
    wants: ClassVar[frozenset[Want]] = frozenset()
    remembers: ClassVar[bool] = False  # trials must be run row by row, in full
    between_rows: ClassVar[int] = 1  # equilibria per row; more for what depends on the path
    stage: ClassVar[int] = 0  # order among effects that act at one place

    @classmethod
    def draw(cls, random: np.random.Generator, day: Day) -> Self:
        """Numbers of a middling size."""
        raise NotImplementedError

    def scaled(self, factor: float) -> Self:
        return replace(self, **{name: times(getattr(self, name), factor) for name in self.size})

    def scale_limit(self) -> float:
        """The factor at which the effect is as large as it may be."""
        return self.largest / float(np.max(np.abs(np.array(getattr(self, self.size[0])))))

    def parameters(self) -> dict[str, Any]:
        """For the truth."""
        return asdict(self)

    def built(self, robot: Robot, share: float) -> Robot:
        """The robot with the effect, `share` of the day having passed."""
        return robot

    def gravity(self, gravity: Array) -> Array:
        """(3,) m/s^2, from what is declared to what is."""
        return gravity

    def backbone(self, rod: Rod, day: Day) -> Backbone | None:
        return None

    def clock(self, times: Array) -> Array:
        """The times that markers and outputs logged at `times` show, s."""
        return times

    def delivered(self, command: Array, step: float, day: Day) -> Array:
        """(n, TENDONS) what the drive delivers, N or m, sampled every `step` s, where the log holds `command`."""
        return command

    def read(self, tension: Array, share: Array) -> Array:
        """(n, TENDONS) N the load cells show at shares (n,) of the day."""
        return tension

    def seen(self, markers: Markers, trial: Trial, day: Day) -> Array:
        """(rows, INTERVALS, 3) m where the markers are seen."""
        return markers.positions


def times(numbers: Numbers, factor: float) -> Numbers:
    """A number, or numbers in tuples of tuples, times a factor."""
    return tuple(times(n, factor) for n in numbers) if isinstance(numbers, tuple) else float(numbers * factor)


def floats(values: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def any_three(random: np.random.Generator) -> Array:
    """Three numbers, the largest 1 or -1."""
    values = random.uniform(-1, 1, 3)
    return values / np.max(np.abs(values))


def sign(random: np.random.Generator) -> float:
    return float(random.choice([-1.0, 1.0]))


def rotation(vector: Array) -> Array:
    """(3, 3) by |vector| rad about it."""
    return Rotation.from_rotvec(vector).as_matrix()
