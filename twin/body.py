"""The seam between a body and all that works with it: what may drive it, what it can show, and what a solve of it asks and answers.

What a body is made of (hinges, nodes, a drum) stays behind it. A family (`twin.robots.family`) builds bodies and names their
solvers.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from twin.effects import Creep, Drive, Drives, Loads, Route, driven_by
from twin.measurements.patches import Patches
from twin.quantities import Size
from twin.springs.spring import Spring

TOLERANCE = 1e-7  # rad in every hinge: the tip is then within 1e-4 mm
NOT_FOUND, DIRECT, FOLLOWED = 0, 1, 2  # status of a solve


@dataclass(frozen=True)
class Port:
    """A channel that may drive a body. One SI unit of it is to each tendon `pull` (n_tendon,), SI: 1 of its own tension, of a
    drum's angle what it takes up, m/rad."""

    channel: str
    drive: Drive
    pull: tuple[float, ...]


@dataclass(frozen=True)
class Sense:
    """A channel that a body can show: where it stands in `Signals.group(group)`; `only` where its tendon is driven so."""

    group: str
    index: int
    axis: int = 0
    only: Drive | None = None


@dataclass(frozen=True)
class Frame:
    """Where the markers' frame is against the base frame: reported = R(turn) x + shift, turn a rotation vector (3,), shift (3,) m.

    A rig whose registration is known is in its base frame already; one that was never registered has these as parameters.
    """

    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @staticmethod
    def of(values: Mapping[str, float]) -> Frame:
        turn, shift = (np.array([values.get(f"frame.{kind}_{a}", 0.0) for a in "xyz"]) for kind in ("turn", "shift"))
        return Frame(turn, shift)

    def reported(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the base frame as the markers' frame has them."""
        if not (self.turn.any() or self.shift.any()):
            return points
        return points @ Rotation.from_rotvec(self.turn).as_matrix().T + self.shift


@dataclass(frozen=True, kw_only=True)
class Body:
    """A robot as an editable MuJoCo model.

    `drives`: for each of its drives the ports it may be driven through, `stepped` those that its dynamics take. `senses`: what it
    can show, by channel. `loads`: inputs that load it, by channel, and which of `Loads` each is. `parts`: what an effect may need
    to act on: "weight", "elasticity" (one stiffness for all of it), "markers", "load cells", "strain sensors", "antagonists",
    "rope" (tendons that may bed in); and what it offers to change: "planes" of bending and stiffness along its "length"
    (`bend_unequally`, `grade`), its "rest shape" (`precurve`), "holes" (`reroute`), a "surface" that may touch, "viscosity" that
    may creep, a "hanging zero" (lengths count from where it hangs, not from a straight body); "skin", whose patches it compares
    with clouds (`Problem.seen`). `antagonists` as in `Signals`; `frame` is that of the markers; `tendons` are the sites each
    tendon passes, base to tip, and `markers` those that are seen.
    """

    spec: mujoco.MjSpec
    n_tendon: int
    parts: frozenset[str]
    drives: tuple[tuple[Port, ...], ...]
    senses: Mapping[str, Sense]
    stepped: frozenset[Drive] = frozenset({Drive.TENSION})
    loads: Mapping[str, str] = field(default_factory=dict)
    antagonists: bool = False
    frame: Frame = field(default_factory=Frame)
    tendons: tuple[tuple[str, ...], ...] = ()
    markers: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """How large it is beside bodies for which effects' numbers are written: those without a rod, as the numbers have it."""
        return Size()

    def first_mode(self) -> float:
        """Frequency (Hz) of the first mode, a scale for rates; without end for a body that only statics describes."""
        return math.inf


def tendon_ports(n: int, resistance: float = 1.0) -> tuple[tuple[Port, ...], ...]:
    """Each of n tendons driven by its tension or its displacement, or by an SMA spring of a resistance (ohm) through current or
    voltage."""
    one = [np.eye(n)[i] for i in range(n)]
    return tuple(
        (
            Port(f"tendon_{i}_tension", Drive.TENSION, tuple(pull)),
            Port(f"tendon_{i}_displacement", Drive.DISPLACEMENT, tuple(pull)),
            Port(f"sma_{i}_current", Drive.CURRENT, tuple(pull)),
            Port(f"sma_{i}_voltage", Drive.CURRENT, tuple(pull / resistance)),
        )
        for i, pull in enumerate(one, 1)
    )


def tendon_senses(n: int) -> dict[str, Sense]:
    """What n tendons and the springs that pull them show."""
    senses = {}
    for i in range(1, n + 1):
        senses |= {
            f"tendon_{i}_tension": Sense("tension", i - 1),
            f"tendon_{i}_displacement": Sense("displacement", i - 1),
            f"sma_{i}_temperature": Sense("temperature", i - 1, only=Drive.CURRENT),
            f"sma_{i}_resistance": Sense("resistance", i - 1, only=Drive.CURRENT),
        }
    return senses


def marker_senses(names: list[str]) -> dict[str, Sense]:
    """Markers (or disks, or the tip) in the order in which they stand in `Signals.markers`."""
    return {f"{name}_{a}": Sense("marker", m, k) for m, name in enumerate(names) for k, a in enumerate("xyz")}


def fingerprint(*numbers: np.ndarray) -> bytes:
    """A hash of arrays: what solves go by, to tell whether another asked for the same."""
    found = hashlib.blake2b(digest_size=16)
    for array in numbers:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.digest()


@dataclass(frozen=True)
class Heating:
    """SMA springs in surroundings at `ambient` (n,) K."""

    ambient: np.ndarray
    spring: Spring


@dataclass(frozen=True)
class Problem:
    """What a solve asks: the way through commands (n, n_tendon) at times (n,) s, under loads.

    A command is what its tendon's drive says (all tensions if not said). `delayed` are the strains that creep has left, the body's
    own business, advanced in place. `stiffness` (n,) scales the body's. `near`, the kept answer to a neighbouring problem on the
    same samples, speeds a solve up; with `once` one Newton step a sample is taken from it (a backbone whose tendons rub is solved
    in full); `keep` keeps what that needs. `seen` are patches of skin that a camera saw, where a body is asked for those.
    """

    time: np.ndarray
    command: np.ndarray
    loads: Loads
    route: Route = field(default_factory=Route)
    drives: Drives = ()
    creep: Creep = field(default_factory=Creep)
    delayed: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    heating: Heating | None = None
    near: Path | None = None
    keep: bool = False
    once: bool = False
    tolerance: float = TOLERANCE
    seen: Patches | None = None

    def which(self, kind: Drive) -> np.ndarray:
        """(n_tendon,) whether a tendon is driven in this way."""
        return driven_by(self.drives or (Drive.TENSION,) * self.command.shape[1], kind)


@dataclass(frozen=True, kw_only=True)
class Path:
    """What a solve answers: base tension (n, n_tendon) N, path lengths of the tendons (n, n_tendon) m, markers (n, n_marker, 3) m
    in the base frame, further signals by group (n, n_port) SI; status (n,), how it `started`, and, where known, why it `ended`
    early, in words. `q` (n, nq) and `LU` are the solver's own: its coordinates, and what a neighbour needs of it, or empty."""

    tension: np.ndarray
    path: np.ndarray
    markers: np.ndarray
    status: np.ndarray
    q: np.ndarray
    others: Mapping[str, np.ndarray] = field(default_factory=dict)
    started: int = DIRECT
    ended: str = ""
    LU: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)), repr=False)

    @property
    def unstable_start(self) -> bool:
        """Whether the loaded, untensioned robot has no stable shape near straight (a load past buckling)."""
        return self.started != DIRECT


class Solver(Protocol):
    """A compiled body, solved one sample after another with memory (slip, creep, heat). One instance serves one thread."""

    @property
    def straight_path(self) -> np.ndarray:
        """(n_tendon,) m: what `Path.path` is at rest."""
        ...

    @property
    def n_slow(self) -> int:
        """How many delayed strains an element of creep has."""
        ...

    def solve(self, problem: Problem) -> Path: ...
