"""The problem and the solution of a simulation of a body, and the solver's interface."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from twin.body.drives.spring import Spring
from twin.body.loads import Loads
from twin.body.route import Creep, Route
from twin.body.signals import Drive, Drives, drive_mask
from twin.measurements.patches import Patches

SOLVE_TOLERANCE = 1e-7  # rad in every hinge: the tip is then within 1e-4 mm
NOT_FOUND, DIRECT, BY_CONTINUATION = 0, 1, 2  # status of a solve


def array_hash(*numbers: np.ndarray) -> bytes:
    """Return a hash of arrays, by which solvers recognise that they have solved the same problem before."""
    found = hashlib.blake2b(digest_size=16)
    for array in numbers:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.digest()


@dataclass(frozen=True)
class Heating:
    """SMA springs, and the temperature `ambient` (n,) K around them."""

    ambient: np.ndarray
    spring: Spring


@dataclass(frozen=True)
class Start:
    """How a trial of an MJCF begins: from a keyframe (or, if empty, where its springs and servos rest), held for `settle` s.

    Joints that rub stay anywhere: they then stand where they were `seen` (n_joint,) rad or m, NaN where they were not, if that is
    off by more than `doubt` (n_joint,).
    """

    settle: float = 2.0
    pose: str = ""
    seen: tuple[float, ...] = ()
    doubt: tuple[float, ...] = ()


@dataclass(frozen=True)
class Problem:
    """A trial to simulate: commands over time, under loads.

    `neighbour` is the solution of a similar problem on the same samples, which speeds this solve up. With `once` the result is one
    Newton step a sample from it (a backbone with tendon friction is solved in full), or motion in longer steps. `keep` stores in
    the solution what a later neighbour needs.
    """

    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon), of the tendons' drives, SI
    loads: Loads
    route: Route = field(default_factory=Route)
    drives: Drives = ()  # empty: all tensions
    creep: Creep = field(default_factory=Creep)
    delayed: np.ndarray | None = None  # the body's delayed strains, advanced in place
    stiffness: np.ndarray | None = None  # (n,), factor on the body's stiffness
    heating: Heating | None = None
    neighbour: Solution | None = None
    keep: bool = False
    once: bool = False
    tolerance: float = SOLVE_TOLERANCE
    seen: Patches | None = None  # patches of skin seen by a camera, for a body that predicts them
    start: Start = field(default_factory=Start)
    course: tuple[np.ndarray, np.ndarray] | None = None  # (m,) s and (m, n_tendon): commands that are not straight between rows

    def drive_mask(self, kind: Drive) -> np.ndarray:
        """Return (n_tendon,) whether each tendon has this kind of drive."""
        return drive_mask(self.drives or (Drive.TENSION,) * self.command.shape[1], kind)


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A simulated trial; `q` and `LU` are the solver's own."""

    tension: np.ndarray  # (n, n_tendon) N at the base
    path: np.ndarray  # (n, n_tendon) m, lengths of the tendons' paths
    markers: np.ndarray  # (n, n_marker, 3) m in the base frame
    status: np.ndarray  # (n,)
    q: np.ndarray  # (n, nq), coordinates
    others: Mapping[str, np.ndarray] = field(default_factory=dict)  # further signals by group, (n, n_port) SI
    start_status: int = DIRECT
    end_reason: str = ""  # why it ended early, where known
    LU: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 0)), repr=False)  # for a neighbour, or empty

    @property
    def unstable_start(self) -> bool:
        """Whether the loaded, untensioned robot has no stable shape near straight (it is past buckling)."""
        return self.start_status != DIRECT


class Solver(Protocol):
    """A compiled body, solved sample by sample with memory (slip, creep, heat). An instance is for one thread."""

    @property
    def straight_path(self) -> np.ndarray:
        """(n_tendon,) m, `Solution.path` at rest."""
        ...

    @property
    def n_delayed(self) -> int:
        """The number of delayed strains of an element of creep."""
        ...

    def solve(self, problem: Problem) -> Solution:
        """Simulate a trial."""
        ...

    def orientations(self, q: np.ndarray, sites: tuple[str, ...]) -> np.ndarray:
        """Return rotation vectors (n, n_site, 3) rad of sites at coordinates `q` (n, nq), of a body that shows orientations."""
        ...
