"""What an effect is: an immutable law with parameters, each with unit, bounds, source and an OFF value.

A law acts in the places below, in the order of the signal, and in no other. State goes in and comes out; a law keeps none.

    command   reported input -> true input      (a load cell that misreads: the inverse of its `sense`)
    drive     command -> what the motors do     (lag, saturation, play)
    edit      the body                          (stiffness, rest shape, routing)
    soften    temperature, time -> its stiffness
    surround  the loads on it                   (gravity, payload, a wall)
    route     along the tendon                  (friction, stretch)
    spring    the SMA springs that pull         (heat loss, phase change)
    deform    slow change of the rest shape     (creep)
    sense     true output -> reported output    (frame, delay, drift)

An effect that acts in `sense` only needs no new simulation: it is applied to what is already predicted.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import PchipInterpolator, PPoly

from twin.errors import TwinError
from twin.quantities import Parameter, Values, overrides
from twin.springs import Spring


class Drive(StrEnum):
    """What holds a tendon: a given tension (N), a given displacement at its motor (m), an SMA spring under a given current (A)."""

    TENSION = "tension"
    DISPLACEMENT = "displacement"
    CURRENT = "current"

    @property
    def shown(self) -> tuple[str, float]:
        """The unit people read it in, and how many of these one SI unit is."""
        return {"tension": ("N", 1.0), "displacement": ("mm", 1e3), "current": ("A", 1.0)}[self]

    @property
    def reading(self) -> float:
        """What one reading of it is typically good for (SI): 10 mN, 20 um, 3 mA."""
        return {"tension": 0.01, "displacement": 2e-5, "current": 3e-3}[self]


Drives = tuple[Drive, ...]  # one a tendon


def driven_by(drives: Drives, kind: Drive) -> np.ndarray:
    """(n_tendon,) whether a tendon is driven in this way."""
    return np.array([d is kind for d in drives], bool)


@dataclass(frozen=True)
class Push:
    """A dead force (3,) N on a backbone or a silicone body: at the disk nearest to `height`, from 0 at the base to 1 at the tip; or
    on the skin there, at `azimuth` (rad) about the body's axis, of `finger` (from 0) of a hand. All as the body is at rest."""

    force: np.ndarray
    height: float = 1.0
    azimuth: float = 0.0
    finger: int = 0


@dataclass(frozen=True)
class Loads:
    """Surroundings of one trial: gravity (3,) m/s^2; payload (kg) and force (3,) N at the tip; a wall or a post (10,) as
    `twin.effects.contact.obstacle` makes it; torque (n,) or (1,) N m on a jaw's hinge, along its positive angle; a push. `at_zero`:
    the payload (kg) that hung on silicone already when its tendons' lengths were set to zero."""

    gravity: np.ndarray
    payload: float = 0.0
    force: np.ndarray = field(default_factory=lambda: np.zeros(3))
    wall: np.ndarray = field(default_factory=lambda: np.zeros(10))
    torque: np.ndarray = field(default_factory=lambda: np.zeros(1))
    push: Push | None = None
    at_zero: float = 0.0


@dataclass(frozen=True)
class Bearing:
    """By which torque (N m) the joint that antagonists turn rubs, with its pre-sliding turn (rad): what it always is, what comes
    on top at rest and fades beyond a rate (rad/s), and what goes with the rate (N m s/rad)."""

    torque: float = 0.0
    presliding: float = 1e-2
    breakaway: float = 0.0
    stribeck: float = 0.2
    viscous: float = 0.0

    def at(self, rate: np.ndarray | float) -> np.ndarray:
        """(n,) N m at rates (n,) rad/s, either way."""
        rate = np.abs(rate)
        return self.torque + self.breakaway * np.exp(-((rate / self.stribeck) ** 2)) + self.viscous * rate


@dataclass(frozen=True)
class Route:
    """A tendon: friction coefficient and pre-sliding travel (m); stretch (m/N); by how much it beds in (m) and over which tension
    (N). Of antagonists also how the joint that they turn rubs.
    `stall`: the tension (N) at which a motor that holds a tendon at a length gives way, and holds no more.
    `mounted`: the share of its rest bend that the body had when SMA springs were put on; `hooked`: that of what their first tension
    stretches which was stretched then, so that the springs were as long as described. `play` (m) each tendon has either way before
    its SMA spring follows, over a travel of `swap` (m), its own or one of all."""

    mu: float = 0.0
    presliding: float = 4e-4
    stretch: float = 0.0
    bedding: float = 0.0
    bedding_tension: float = 1.0
    bearing: Bearing = field(default_factory=Bearing)
    mounted: float = 0.0
    stall: float = np.inf
    hooked: float = 0.0
    play: tuple[float, ...] = ()
    swap: tuple[float, ...] = (1e-4,)

    def elongation(self, tension: np.ndarray) -> np.ndarray:
        """By how much (m) a tendon is longer under a tension (N) than slack."""
        return self.stretch * tension + self.bedding * -np.expm1(-tension / self.bedding_tension)


@dataclass(frozen=True)
class Creep:
    """Delayed strain, one element a retardation time: amplitude (delayed / instant strain) and time (s)."""

    amplitude: tuple[float, ...] = ()
    time: tuple[float, ...] = ()


@dataclass(frozen=True)
class Signals:
    """The quantities of one trial that sensors see, true or reported; batch (sample) first.

    time (n,) s in the trial; clock (n,) s since the first trial; tension (n, n_tendon) N at the base; displacement (n, n_tendon) m
    at the motor; markers (n, n_marker, 3) m; temperature (n,) K of the room; `drives`, what drives each tendon, and current
    (n, n_tendon) A of the SMA springs. On the way in (`command`, `drive`) what does not drive a tendon is zero. `antagonists`: two
    tendons pretensioned against each other on a rigid joint. `others`: further groups a body shows, by name, (n, n_port) SI.
    `smooth`: commands pass through their rows by monotone cubics, as a log's may; else they go straight from row to row.
    """

    time: np.ndarray
    clock: np.ndarray
    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    temperature: np.ndarray
    drives: Drives = (Drive.TENSION,)
    current: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    antagonists: bool = False
    others: Mapping[str, np.ndarray] = field(default_factory=lambda: MappingProxyType({}))
    smooth: bool = False

    @property
    def by_length(self) -> np.ndarray:
        """(n_tendon,) whether a displacement drives the tendon."""
        return driven_by(self.drives, Drive.DISPLACEMENT)

    @property
    def by_current(self) -> np.ndarray:
        """(n_tendon,) whether a current drives the tendon, through its SMA spring."""
        return driven_by(self.drives, Drive.CURRENT)

    @property
    def command(self) -> np.ndarray:
        """(n, n_tendon), SI: of each tendon what drives it."""
        return np.where(self.by_length, self.displacement, np.where(self.by_current, self.current, self.tension))

    def with_(self, **changes: Any) -> Signals:
        return replace(self, **changes)

    def group(self, name: str) -> np.ndarray:
        """A group by its name: "marker" (n, n_marker, 3), else (n, n_port, 1)."""
        if name == "marker":
            return self.markers
        own = {"tension": self.tension, "displacement": self.displacement}
        return (own | dict(self.others))[name][..., None]


def between_rows(signals: Signals, command: np.ndarray) -> PPoly:
    """Commands (n, n_tendon) of a trial of two rows or more at any moment within it."""
    if signals.smooth:
        return PchipInterpolator(signals.time, command)
    chords = np.diff(command, axis=0) / np.diff(signals.time)[:, None]
    return PPoly(np.stack([0.0 * chords, 0.0 * chords, chords, command[:-1]]), signals.time)


ROPES = frozenset({"rope"})  # tendons that may bed in, and whose motors may stall


@dataclass(frozen=True)
class Start:
    """Where a fit of an effect may begin, which of its parameters it then frees, and which parts of a body these besides act on."""

    values: Mapping[str, float]
    free: tuple[str, ...]
    needs: frozenset[str] = frozenset()


class Effect(ABC):
    """Base of all laws. A subclass states its data and overrides the places it acts in; the base's places change nothing.

    `per_tendon` parameters exist once per tendon, as name_1, name_2, ... `shape` names parameters that mean nothing while
    the effect is OFF (a time constant of no creep). `richer` names parameters of a second, fuller law that stay OFF
    until the plain one has been accepted. `akin` names effects whose signature is so like this one's that both are never
    claimed together. `needs` names the parts a body must have for the law to act (`twin.robots.Body.parts`), `richer_needs` those
    for its fuller law. `moves_with` says in words what gives the effect away in a plot.
    """

    id: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    per_tendon: ClassVar[tuple[Parameter, ...]] = ()
    shape: ClassVar[tuple[str, ...]] = ()
    richer: ClassVar[tuple[str, ...]] = ()
    akin: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[frozenset[str]] = frozenset()
    richer_needs: ClassVar[frozenset[str]] = frozenset()
    guesses: ClassVar[tuple[Values, ...]] = ()
    moves_with: ClassVar[str]

    def __init__(self, values: Values | None = None, n_tendon: int = 3, **named: float) -> None:
        """What is not given is as on a robot of size 1. Raises TwinError for an unknown parameter or a value that no robot has."""
        try:
            self.values: dict[str, float] = overrides([p.anywhere for p in self.declared(n_tendon)], {**(values or {}), **named})
        except TwinError as error:
            raise TwinError(f"effect {self.id}: {error}") from None
        self.n_tendon = n_tendon

    @classmethod
    def declared(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """All parameters, those per tendon expanded."""
        many = (replace(p, name=f"{p.name}_{i}") for i in range(1, n_tendon + 1) for p in cls.per_tendon)
        return (*cls.parameters, *many)

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Where to begin a fit: each guess; for per-tendon laws each tendon alone and all, with the first parameter and with
        all of them.

        `predicted` is what the twin without the effect predicts, for laws that must look where the robot goes.
        """
        names = tuple(p.name for p in cls.parameters if p.name not in cls.richer)
        for guess in cls.guesses:
            yield Start(guess, names)
        tendons = range(1, n_tendon + 1)
        for kind in (cls.per_tendon[:k] for k in range(1, len(cls.per_tendon) + 1)):
            single = [{f"{p.name}_{i}": p.value + p.step for p in kind} for i in tendons]
            for values in (*single, {k: v for s in single for k, v in s.items()}):
                yield Start(values, tuple(values))

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        """Which of several laws of this name is fitted, told by the parameters that are free, where an effect may begin as one or
        another. Sets of effects are weighed with each; a start of the same form only leads to it from elsewhere."""
        return ""

    def fuller_starts(self, predicted: list[Signals]) -> Iterator[Start]:
        """Where fits of a fuller law may begin, where this is the plain one: its values besides, and what it frees of `richer`;
        `predicted` is with the plain one."""
        table = {p.name: p for p in self.declared(self.n_tendon)}
        yield Start({n: table[n].value + (0.0 if n in self.shape else table[n].step) for n in self.richer}, self.richer)

    def implausible(self) -> str:
        """Why nothing of this name has these values, in words; empty where it may."""
        return ""

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def each(self, name: str) -> np.ndarray:
        """A per-tendon parameter as an array (n_tendon,)."""
        return np.array([self.values[f"{name}_{i}"] for i in range(1, self.n_tendon + 1)])

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.values == other.values  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((self.id, tuple(sorted(self.values.items()))))

    def __repr__(self) -> str:
        return f"{self.id}({', '.join(f'{k}={v:.4g}' for k, v in self.values.items())})"

    def acts_in(self, *places: str) -> bool:
        """Whether the law overrides any of the named places."""
        return any(getattr(type(self), p) is not getattr(Effect, p) for p in places)

    @property
    def physical(self) -> bool:
        """Whether the law acts on the robot and its drives, not only on what sensors report of outputs."""
        return self.acts_in("command", "drive", "edit", "soften", "surround", "route", "spring", "deform")

    # ---- the places, in the order of the signal -----------------------------------------------------------------------

    def command(self, reported: Signals) -> Signals:
        return reported

    def drive(self, command: Signals) -> Signals:
        return command

    def edit(self, body: Any) -> None:
        """Change the body (a `twin.robots.Body`) before it is compiled."""

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray | float:
        """Stiffness of the body over that described, at `temperature` (n,) K, `clock` (n,) s after the first trial's start."""
        return 1.0

    def surround(self, loads: Loads) -> Loads:
        return loads

    def route(self) -> Route:
        return Route()

    def spring(self, spring: Spring) -> Spring:
        return spring

    def deform(self) -> Creep:
        return Creep()

    def sense(self, true: Signals) -> Signals:
        return true
