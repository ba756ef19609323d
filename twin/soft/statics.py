"""Trials of a silicone body by statics: hanging at rest, then through the commands, each shape found from the one before."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twin.body import DIRECT, NOT_FOUND, TOLERANCE, Path, Problem, fingerprint
from twin.effects import Drive, Loads
from twin.effects.contact import seen_from
from twin.errors import SolveError
from twin.sensors import resistance
from twin.soft.body import SoftBody
from twin.soft.newton import Found, Kept, Way, along
from twin.soft.room import parts_of, room_for, undeformed
from twin.soft.skin import Skin, stand
from twin.threads import single_thread

SMALLEST = 1e-3  # of a step between two samples
REMEMBERED = 64  # trials, of some 300 kB
CLOSE = 2e-8  # m: a step after which a shape counts as found; with it goes some 1e-6 N


@dataclass(frozen=True, kw_only=True)
class SoftPath(Path):
    """`q` (n, nq) are the displacements of the free nodes, m; `LU` (n, nq, nq) the inverses of their tangents, m/N, in single
    precision. `of` is a hash of what was solved: who asks the same again is answered from here. `others`: "strain" (n, s) of the
    cords, "sensor" (n, s) ohm and "sensor_rest", at no strain; "skin" (n, k) m, where patches seen by a camera
    should be, as in `twin.measurements.patches`."""

    of: bytes = b""


_SOLVED: dict[
    tuple[bytes, float], SoftPath
] = {}  # trials solved from their start, so that what differs only in sensors is not solved again


class SoftStatics:
    """A body ready to be solved. One instance serves one thread at a time."""

    def __init__(self, body: SoftBody) -> None:
        self.body = body
        self.parts = parts_of(body)
        grid = body.lattice
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(body.paths, axis=1), axis=2).sum(axis=1)
        self.tip = grid.weights(np.array([[0.0, 0.0, body.cone.length]]))[0]
        self._seen, self._cords = grid.weights(body.seen), grid.weights(body.cord_paths.reshape(-1, 3))
        self._pieces = np.diff(body.cord_paths, axis=1)
        self._cord_steps = np.diff(self._cords.reshape(*body.cord_paths.shape[:2], -1), axis=1)
        self._cord_rest = np.linalg.norm(self._pieces, axis=2).sum(axis=1)

    @cached_property
    def skin(self) -> Skin:
        return Skin.of(self.body)

    @property
    def n_slow(self) -> int:
        return self.parts.cells.weight.size * 6

    def solve(self, problem: Problem) -> SoftPath:
        """Equilibria in order; tendons held at lengths are measured from the hanging rest, under the weight of the body alone, and
        so is `path`: a payload comes on when drums have been set to zero.

        The first sample without one ends the trial: from there on the status is NOT_FOUND and no shape is given. Raises SolveError
        for springs that pull, which nothing here solves.
        """
        if problem.heating is not None:
            raise SolveError("SMA springs are not solved for a silicone body; remove that drive")
        with single_thread():
            trial, near = Trial(self, problem), problem.near
            asked = trial.asked()
            if isinstance(near, SoftPath) and near.of == asked != b"":
                u = near.q.reshape(len(near.q), -1, 3)  # what differs is only how it is seen and sensed
                return replace(near, markers=self.markers(u), others=self.sensed(u, problem))
            cold = asked != b"" and near is None and not problem.keep
            if cold and (found := _SOLVED.get((asked, problem.tolerance))) is not None:
                u = found.q.reshape(len(found.q), -1, 3)
                return replace(found, markers=self.markers(u), others=self.sensed(u, problem))
            with suppress(np.linalg.LinAlgError):  # a tangent without an inverse: what comes from there on has no equilibrium
                trial.run()
        u = trial.found.u.reshape(len(trial.found.u), -1, 3)
        path = SoftPath(
            tension=trial.found.tension, path=trial.found.length - trial.hanging + self.straight_path, markers=self.markers(u),
            status=trial.status, q=trial.found.u, others=self.sensed(u, problem), LU=trial.inverses(),
            of=asked if trial.status.all() else b"",
        )  # fmt: skip
        if cold and path.of:
            _SOLVED[asked, problem.tolerance] = path
            while len(_SOLVED) > REMEMBERED:
                _SOLVED.pop(next(iter(_SOLVED)), None)
        return path

    def pressed(self, loads: Loads) -> np.ndarray:
        """(n_free, 3) N on the nodes, in the finger's own frame, by the tip's force and the push."""
        turn, push, cone = turned(self.body.turn), loads.push, self.body.cone
        force = np.outer(self.tip, loads.force @ turn)
        if push is not None:
            z = push.height * cone.length
            radius, azimuth = float(cone.radius(z)), push.azimuth - self.body.turn
            point = np.array([[radius * np.cos(azimuth), radius * np.sin(azimuth), z]])
            force = force + np.outer(self.body.lattice.weights(point)[0], push.force @ turn)
        return force

    def markers(self, u: np.ndarray) -> np.ndarray:
        """(n, m + 1, 3) m in the base frame: the markers, and the tip."""
        tip = self.tip @ u + [0.0, 0.0, self.body.cone.length]
        own = np.concatenate([self.body.seen + self._seen @ u, tip[:, None]], axis=1)
        return own @ turned(self.body.turn).T

    def sensed(self, u: np.ndarray, problem: Problem | None = None) -> dict[str, np.ndarray]:
        """What the cords feel of nodes' displacements u (n, n_free, 3) m, and where a problem's clouds should be, by group as in
        `SoftPath.others`."""
        strain = self.strain(self.cords(u))
        rest = np.broadcast_to(self.body.cords.rest, strain.shape)
        felt = {"strain": strain, "sensor": resistance(strain, self.body.cords), "sensor_rest": rest}
        if problem is None or problem.seen is None:
            return felt
        return felt | {"skin": stand(self.skin, problem.seen, problem.time, u, turned(self.body.turn))}

    def cords(self, u: np.ndarray) -> np.ndarray:
        """Paths (n, s, p, 3) m of the cords in the finger's own frame at nodes' displacements u (n, n_free, 3) m."""
        return self.body.cord_paths + (self._cords @ u).reshape(len(u), *self.body.cord_paths.shape)

    def strain(self, cords: np.ndarray) -> np.ndarray:
        """(n, s) of paths (n, s, p, 3) m."""
        return np.linalg.norm(np.diff(cords, axis=2), axis=3).sum(axis=2) / self._cord_rest - 1.0

    def strain_slope(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Strains (s,) of the cords at nodes' displacements u (n_free, 3) m, and their derivatives (s, 3 n_free) 1/m."""
        piece = self._pieces + self._cord_steps @ u
        length = np.sqrt((piece**2).sum(axis=2))
        slope = (np.swapaxes(self._cord_steps, 1, 2) @ (piece / length[..., None])).reshape(len(piece), -1)
        return length.sum(axis=1) / self._cord_rest - 1.0, slope / self._cord_rest[:, None]


def turned(angle: float) -> np.ndarray:
    """The rotation about z by `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class Trial:
    """One way through a problem's commands. Loads and tensions count over the stiffness, `scale` (n,) of that described."""

    def __init__(self, statics: SoftStatics, problem: Problem) -> None:
        self.problem, self.parts, body = problem, statics.parts, statics.body
        n, nt = problem.command.shape
        loads, turn = problem.loads, turned(body.turn)
        along = loads.gravity @ turn
        weight = np.outer(body.lattice.volume, body.density * along)
        self.zero = weight + np.outer(statics.tip, loads.at_zero * along)  # what lengths are set to zero under
        self.force = weight + np.outer(statics.tip, loads.payload * along) + statics.pressed(loads)
        self.wall = seen_from(loads.wall, turn, np.zeros(3))
        self.held = problem.which(Drive.DISPLACEMENT)
        self.scale = np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float)
        k = len(problem.creep.amplitude)
        slow = np.zeros((k, statics.n_slow)) if problem.delayed is None else problem.delayed
        self.state = undeformed(self.parts, slow.reshape(k, *self.parts.cells.weight.shape, 6))
        self.room = room_for(self.parts, k > 0)
        nq = self.state.u.size
        self.found = Found(
            np.zeros((n, nq)),
            np.zeros((n, nt)),
            np.zeros((n, nt)),
            np.empty((n if problem.keep else 0, nq, nq), np.float32),
            np.zeros(n, bool),
        )
        self.status = np.full(n, NOT_FOUND)
        self.hanging, self.at = np.zeros(nt), np.zeros(nt)
        self.hangs = False

    def asked(self) -> bytes:
        """A hash of all that the shapes follow from; empty with creep, whose state must be advanced."""
        if self.problem.creep.amplitude:
            return b""
        cells, route = self.parts.cells, self.problem.route
        numbers = (
            cells.shear, cells.bulk, cells.gradient, self.parts.cables.weights, self.zero, self.force, self.wall, self.scale,
            self.held, self.problem.command, np.array([route.mu, route.presliding, route.stretch]),
        )  # fmt: skip
        return fingerprint(*numbers)

    def run(self) -> None:
        """At rest where lengths count from; then under its loads; then all samples in order, up to the first that has no
        equilibrium."""
        slack = np.zeros(len(self.at), bool)
        self.hangs = self._one(0, self.at, slack, self.zero)
        self.hanging = self.room.pulled.length.copy()
        if self.hangs and (self.force != self.zero).any():
            self.hangs = self._one(0, self.at, slack, self.force)
        self.state.slip[:] = 0.0
        i, n, near = 0, len(self.status), self.problem.near
        kept = Kept(self.found.u[:0], self.found.tension[:0], self.found.inverse[:0])
        if near is not None and len(near.LU) == n:
            kept = Kept(near.q, near.tension, near.LU)
        way = self._way(slice(0, n), self.problem.command, self.held, self.force)
        while i < n and self.hangs:
            end = along(self.parts, way, kept, i, self.state, self.found, self.room)
            self.status[i:end] = DIRECT
            i = end
            if i < n:  # Newton's method is lost between two commands: in parts
                self.at = self.problem.command[i - 1] if i else self.at
                if not self._in_parts(i):
                    return  # what comes after would be sought from a shape that is none
                self.status[i] = DIRECT
                i += 1

    def inverses(self) -> np.ndarray:
        """(n, nq, nq) m/N of the tangents, those of the neighbour where they served; none where they are not to be kept."""
        near, found = self.problem.near, self.found
        if near is None or not found.borrowed.any() or not len(found.inverse):
            return found.inverse
        if found.borrowed.all():
            return near.LU
        found.inverse[found.borrowed] = near.LU[found.borrowed]
        return found.inverse

    def _in_parts(self, i: int) -> bool:
        """From the last command to that of sample i, in ever smaller parts. False, with its shape as last found, where not."""
        start, goal, done, part = self.at, self.problem.command[i], 0.0, 0.5
        if i and self.status[i - 1]:
            self.state.u[:], self.state.tension[:] = self.found.u[i - 1], self.found.tension[i - 1] / self.scale[i - 1]
        while done < 1.0 and part > SMALLEST:
            if self._one(i, start + min(1.0, done + part) * (goal - start), self.held, self.force):
                done += part
                part = min(2.0 * part, 1.0 - done)
            else:
                part *= 0.5
        self.found.u[i], self.found.tension[i] = self.state.u, self.state.tension * self.scale[i]
        self.found.length[i] = self.room.pulled.length
        if self.problem.keep:
            self.found.inverse[i] = self.state.inverse
        return done >= 1.0

    def _one(self, i: int, command: np.ndarray, held: np.ndarray, force: np.ndarray) -> bool:
        """To one command under `force` (n_free, 3) N on the nodes and what else loads sample i."""
        n, nt, nq = 1, len(command), self.state.u.size
        nothing = Kept(np.empty((0, nq)), np.empty((0, nt)), np.empty((0, nq, nq), np.float32))
        found = Found(np.empty((n, nq)), np.empty((n, nt)), np.empty((n, nt)), nothing.inverse, np.zeros(n, bool))
        way = self._way(slice(i, i + 1), command[None], held, force)
        return along(self.parts, way, nothing, 0, self.state, found, self.room) == 1

    def _way(self, rows: slice, command: np.ndarray, held: np.ndarray, force: np.ndarray) -> Way:
        problem, scale = self.problem, self.scale[rows]
        once = problem.once and len(command) == len(self.scale)
        tension, free = np.ascontiguousarray(np.maximum(command, 0.0)), np.ascontiguousarray(self.hanging - command)
        return Way(
            tension, free, held, np.outer(scale, np.full(len(held), problem.route.stretch)), force, self.wall, scale,
            float(problem.route.mu), float(problem.route.presliding),
            np.array(problem.time[rows], float), np.array(problem.creep.amplitude, float), np.array(problem.creep.time, float),
            CLOSE * problem.tolerance / TOLERANCE, once, problem.keep,
        )  # fmt: skip
