"""A robot's shapes as arrays: what a solver's coordinates look like."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, cast

import mujoco
import numpy as np

from twin.body import Path, Problem
from twin.effects import Loads
from twin.equilibrium import Equilibrium
from twin.equilibrium.along import tension_along
from twin.equilibrium.chain import Law
from twin.errors import DataError
from twin.hinges import HingeChain
from twin.soft import SoftBody, SoftStatics
from twin.soft.cables import follow, unpulled
from twin.soft.room import undeformed
from twin.soft.statics import turned
from twin.twin import Twin
from twin.viewer.colours import Range

RINGS, AROUND = 28, 32  # of the drawn skin


@dataclass(frozen=True)
class Frames:
    """n instants of a robot. Links: places (n, g, 3) m and turns (n, g, 4) as w, x, y, z; tendon pieces (n, s, 2, 3) m and their
    tensions (n, s) N; skin (n, v, 3) m and its strain along the body (n, v); markers (n, m, 3) m."""

    place: np.ndarray
    turn: np.ndarray
    piece: np.ndarray
    tension: np.ndarray
    skin: np.ndarray
    strain: np.ndarray
    markers: np.ndarray

    def at(self, i: int, share: float = 0.0) -> Frames:
        """Instant i as frames of one; `share` of the way to the next, straight."""
        j = min(i + 1, len(self.markers) - 1)
        return Frames(*((1.0 - share) * getattr(self, n)[i : i + 1] + share * getattr(self, n)[j : j + 1] for n in FIELDS))


FIELDS = ("place", "turn", "piece", "tension", "skin", "strain", "markers")


class Figure(Protocol):
    """What is drawn of a robot. `cylinders` (g, 2) m are radius and half length of its links, `colour` (g, 3) bytes; `faces` (f, 3)
    of its skin; `coloured` says what its colours mean."""

    cylinders: np.ndarray
    colour: np.ndarray
    faces: np.ndarray
    height: float

    def frames(self, path: Path, loads: Loads) -> Frames: ...

    def coloured(self, most: float) -> Range: ...


def figure(twin: Twin) -> Figure:
    """The figure of a twin's robot. Raises DataError for a family that is not drawn yet."""
    body = twin.body()
    if isinstance(body, HingeChain):
        return ChainFigure(twin, body)
    if isinstance(body, SoftBody):
        return SoftFigure(twin, body)
    raise DataError(f"robot {twin.robot.name!r} is a {twin.robot.family}, which is not drawn here yet; see `twin robots`")


@dataclass
class ChainFigure:
    """A backbone: links and disks as MuJoCo has them, tendons from hole to hole."""

    twin: Twin
    body: HingeChain
    faces: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.uint32))

    def __post_init__(self) -> None:
        self._solver = cast(Equilibrium, self.twin.robot.solver(self.body))
        model = self._solver.model
        self.cylinders = model.geom_size[:, :2].copy()
        self.colour = (255 * model.geom_rgba[:, :3]).astype(np.uint8)
        self.height = self.body.length

    def coloured(self, most: float) -> Range:
        return Range("tension along the tendons", "N", 1.0, 0.0, most)

    def frames(self, path: Path, loads: Loads) -> Frames:
        """Of a path that began slack under `loads`; friction's share of the tension is followed from there."""
        solver, route = self._solver, self.twin.laws.route
        n_piece = solver.chain.hole.shape[1] - 1
        nt = len(solver.chain.pieces)
        z, s, along = (np.zeros((nt, n_piece)) for _ in range(3))
        law = Law(float(route.mu), float(route.presliding), np.array(loads.wall, float))
        slack = solver.solve(Problem(np.zeros(1), np.zeros((1, nt)), loads, route))
        drawn = []
        for q, tension in ((slack.q[0], np.zeros(nt)), *zip(path.q, path.tension, strict=True)):
            self._put(q)
            tension_along(solver.chain, law, np.maximum(tension, 0.0), z, s, along)
            drawn.append(self._drawn(along))
        return _stacked(drawn[1:], self.body.frame.reported(path.markers))

    def standing(self, q: np.ndarray, along: np.ndarray, markers: np.ndarray) -> Frames:
        """One instant of known tensions (n_tendon, n_piece) N along the tendons."""
        self._put(q)
        return _stacked([self._drawn(along)], markers[None])

    def _put(self, q: np.ndarray) -> None:
        self._solver.data.qpos[:] = q
        mujoco.mj_kinematics(self._solver.model, self._solver.data)

    def _drawn(self, along: np.ndarray) -> tuple[np.ndarray, ...]:
        data, chain = self._solver.data, self._solver.chain
        turn = np.empty((len(self.cylinders), 4))
        for g, matrix in enumerate(data.geom_xmat):
            mujoco.mju_mat2Quat(turn[g], matrix)
        ends = data.site_xpos[chain.hole]
        real = np.arange(along.shape[1]) < chain.pieces[:, None]
        piece = np.stack([ends[:, :-1], ends[:, 1:]], axis=2)[real]
        return data.geom_xpos.copy(), turn, piece, along[real], np.zeros((0, 3)), np.zeros(0)


@dataclass
class SoftFigure:
    """A silicone finger: its skin, strained along the finger, and the tendons in it."""

    twin: Twin
    body: SoftBody
    cylinders: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    colour: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.uint8))

    def __post_init__(self) -> None:
        self._solver = cast(SoftStatics, self.twin.robot.solver(self.body))
        cone = self.body.cone
        self.height = cone.length
        z, t = np.linspace(0.0, cone.length, RINGS), 2.0 * np.pi * np.arange(AROUND) / AROUND
        Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
        skin = np.column_stack([cone.radius(Z) * np.cos(T), cone.radius(Z) * np.sin(T), Z])
        self._skin = np.vstack([skin, [[0.0, 0.0, cone.length]]])
        self._weights = self.body.lattice.weights(self._skin)
        ring, k = np.arange(RINGS - 1)[:, None] * AROUND, np.arange(AROUND)
        a, b = ring + k, ring + (k + 1) % AROUND
        sides = [np.stack([a, b, b + AROUND], -1), np.stack([a, b + AROUND, a + AROUND], -1)]
        last = (RINGS - 1) * AROUND
        cap = np.stack([last + k, last + (k + 1) % AROUND, np.full(AROUND, len(skin))], -1)
        self.faces = np.concatenate([*(s.reshape(-1, 3) for s in sides), cap]).astype(np.uint32)

    def coloured(self, most: float) -> Range:
        return Range("strain of the skin along the finger", "%", 100.0, -30.0, 30.0)

    def frames(self, path: Path, loads: Loads) -> Frames:
        """Of a path that began hanging; friction's share of the tension is followed from there."""
        cables, route, turn = self._solver.parts.cables, self.twin.laws.route, turned(self.body.turn).T
        start = undeformed(self._solver.parts, np.empty((0, 0, 0, 6)))
        slip, beyond, pulled, drawn = start.slip, start.beyond, unpulled(cables), []
        for q, tension in zip(path.q, path.tension, strict=True):
            u = q.reshape(-1, 3)
            follow(cables, u, slip, beyond, float(route.mu), float(route.presliding), pulled)
            slip, beyond = pulled.slip.copy(), pulled.beyond.copy()
            points = (cables.rest + cables.weights @ u) @ turn
            piece = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
            skin = self._skin + self._weights @ u
            along = (tension[:, None] * pulled.share).ravel()
            drawn.append((np.zeros((0, 3)), np.zeros((0, 4)), piece, along, skin @ turn, self._strain(skin)))
        return _stacked(drawn, path.markers)

    def _strain(self, skin: np.ndarray) -> np.ndarray:
        """(v,) of the lines along the finger, the mean of the pieces that meet at a point."""

        def spans(x: np.ndarray) -> np.ndarray:
            return np.linalg.norm(np.diff(x[:-1].reshape(RINGS, AROUND, 3), axis=0), axis=2)

        e = spans(skin) / spans(self._skin) - 1.0
        at = np.concatenate([e[:1], 0.5 * (e[1:] + e[:-1]), e[-1:]]).ravel()
        return np.append(at, at[-AROUND:].mean())


def _stacked(drawn: list[tuple[np.ndarray, ...]], markers: np.ndarray) -> Frames:
    place, turn, piece, tension, skin, strain = (np.stack(column) for column in zip(*drawn, strict=True))
    return Frames(place, turn, piece, tension, skin, strain, markers)
