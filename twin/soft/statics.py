"""Trials of a silicone body by statics: hanging at rest, then through the commands, each shape found from the one before."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from twin.body import DIRECT, NOT_FOUND, TOLERANCE, Path, Problem
from twin.effects import Drive
from twin.errors import SolveError
from twin.sensors import resistance
from twin.soft.body import AROUND, SoftBody, skin_points
from twin.soft.cables import Cables
from twin.soft.creep import relax_for
from twin.soft.finger import CLOSE, Burden, Pull, Solid, getri
from twin.soft.lattice import ACROSS
from twin.soft.neighbour import Kept, Parts, Way, along
from twin.soft.silicone import Cells
from twin.soft.wall import Skin

SMALLEST = 1e-3  # of a step between two samples


@dataclass(frozen=True, kw_only=True)
class SoftPath(Path):
    """`q` (n, nq) are the displacements of the free nodes, m; `LU` (n, nq, nq) the inverses of their tangents, m/N, in single
    precision. `others`: "strain" (n, s) of the cords, "sensor" (n, s) ohm and "sensor_rest", at no strain."""


class SoftStatics:
    """A body ready to be solved. One instance serves one thread at a time."""

    def __init__(self, body: SoftBody) -> None:
        self.body = body
        grid = body.lattice
        gradient, local = grid.gradients
        weight = grid.quadrature[1]
        basis = np.concatenate([np.ones((*local.shape[:2], 1)), local], axis=-1)
        inverse = np.linalg.inv(np.einsum("eqa,eq,eqb->eab", basis, weight, basis))
        E, nu = body.youngs_modulus, body.poisson
        shear, bulk = body.shear * (E / (2.0 * (1.0 + nu))), body.bulk * (E / (3.0 * (1.0 - 2.0 * nu)))
        cells = Cells(grid.members, grid.unknowns, gradient, weight, basis, inverse, shear, bulk)
        nt, points_each, _ = body.paths.shape
        weights = grid.weights(body.paths.reshape(-1, 3)).reshape(nt, points_each, -1)
        for t in range(nt):
            weights[t, -1] = grid.spread(body.paths[t, -1], body.anchor)
        skin = skin_points(body.cone)
        self.solid = Solid(
            cells, Cables(np.ascontiguousarray(body.paths), weights),
            Skin(skin, grid.weights(skin), np.full(len(skin), 1.0 / AROUND)), ACROSS**2,
        )  # fmt: skip
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(body.paths, axis=1), axis=2).sum(axis=1)
        self._tip = grid.weights(np.array([[0.0, 0.0, body.cone.length]]))[0]
        self._seen, self._cords = grid.weights(body.seen), grid.weights(body.cord_paths.reshape(-1, 3))
        self._cord_rest = np.linalg.norm(np.diff(body.cord_paths, axis=1), axis=2).sum(axis=1)

    @property
    def n_slow(self) -> int:
        return self.solid.cells.weight.size * 6

    def solve(self, problem: Problem) -> SoftPath:
        """As `_solve`, by one thread."""
        with single_thread():
            return self._solve(problem)

    def _solve(self, problem: Problem) -> SoftPath:
        """Equilibria in order; tendons held at lengths are measured from the hanging rest, and so is `path`.

        Where none was found the sample's status is NOT_FOUND and its shape is the one before. Raises SolveError for tendons that
        stiffen or springs that pull, which nothing here solves.
        """
        if problem.route.stiffening > 0.0 or problem.heating is not None:
            raise SolveError("tendons that stiffen and SMA springs are not solved for a silicone body; remove that effect or drive")
        trial = _Trial(self, problem)
        trial.run()
        u, length = trial.u.reshape(len(trial.u), -1, 3), trial.length
        return SoftPath(
            tension=trial.tension, path=length - trial.hanging + self.straight_path, markers=self._markers(u), status=trial.status,
            q=trial.u, others=self.sensed(u), LU=trial.inverse,
        )  # fmt: skip

    def _markers(self, u: np.ndarray) -> np.ndarray:
        """(n, m + 1, 3) m in the base frame: the markers, and the tip."""
        tip = self._tip @ u + [0.0, 0.0, self.body.cone.length]
        own = np.concatenate([self.body.seen + self._seen @ u, tip[:, None]], axis=1)
        return own @ turned(self.body.turn).T

    def sensed(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """What the cords feel of nodes' displacements u (n, n_free, 3) m, by group as in `SoftPath.others`."""
        shape = (len(u), *self.body.cord_paths.shape)
        moved = self.body.cord_paths + (self._cords @ u).reshape(shape)
        strain = np.linalg.norm(np.diff(moved, axis=2), axis=3).sum(axis=2) / self._cord_rest - 1.0
        rest = np.broadcast_to(self.body.cords.rest, strain.shape)
        return {"strain": strain, "sensor": resistance(strain, self.body.cords), "sensor_rest": rest}

    def strain_slope(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Strains (s,) of the cords at nodes' displacements u (n_free, 3) m, and their derivatives (s, 3 n_free) 1/m."""
        s, points, _ = self.body.cord_paths.shape
        weights = self._cords.reshape(s, points, -1)
        piece = np.diff(self.body.cord_paths + weights @ u, axis=1)
        length = np.linalg.norm(piece, axis=2)
        slope = np.einsum("spc,spn->snc", piece / length[..., None], np.diff(weights, axis=1)).reshape(s, -1)
        return length.sum(axis=1) / self._cord_rest - 1.0, slope / self._cord_rest[:, None]


def single_thread() -> AbstractContextManager[object]:
    """Small systems by one thread each: with two, these take tens of times longer on a busy machine."""
    return _threads().limit(limits=1)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()


def turned(angle: float) -> np.ndarray:
    """The rotation about z by `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class _Trial:
    """One way through a problem's commands. Loads and tensions count over the stiffness, `scale` (n,) of that described."""

    def __init__(self, statics: SoftStatics, problem: Problem) -> None:
        self.problem, self.solid, body = problem, statics.solid, statics.body
        n, nt = problem.command.shape
        self.scale = np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float)
        loads, turn = problem.loads, turned(body.turn)
        volume = body.lattice.volume
        at_tip = loads.payload * loads.gravity + loads.force
        self.force = np.outer(volume, body.density * loads.gravity @ turn) + np.outer(statics._tip, at_tip @ turn)
        self.wall = np.concatenate([loads.wall[:3] @ turn, loads.wall[3:]])
        self.held = problem.which(Drive.DISPLACEMENT)
        amplitude = np.array(problem.creep.amplitude, float)
        self.amplitude, self.time = amplitude, np.array(problem.creep.time, float)
        slow = np.zeros((amplitude.size, statics.n_slow)) if problem.delayed is None else problem.delayed
        self.taken = slow.reshape(amplitude.size, *self.solid.cells.weight.shape, 6)
        self.close = CLOSE * problem.tolerance / TOLERANCE
        self.shape = self.solid.rest()
        self.hanging = np.zeros(nt)
        slack = Pull(np.zeros(nt), np.zeros(nt, bool), np.zeros(nt), np.zeros(nt), 0.0, 1.0)
        self.found = self.solid.settle(self.shape, slack, self._burden(0))
        if self.found:
            self.hanging = self.solid.pulled.length.copy()
            self.shape.slip.state[:] = 0.0
        self.at = np.zeros(nt)
        nq = self.shape.u.size
        self.u, self.tension, self.length = np.empty((n, nq)), np.empty((n, nt)), np.empty((n, nt))
        self.inverse = np.empty((n if problem.keep else 0, nq, nq), np.float32)
        self.status = np.full(n, NOT_FOUND)

    def run(self) -> None:
        """All samples in order."""
        i, n = 0, len(self.u)
        while i < n:
            if self.found and self._neighboured():
                i = self._along(i)
            if i < n:
                self._put(i, self.found and self._march(i))
                i += 1

    def _neighboured(self) -> bool:
        near = self.problem.near
        return near is not None and len(near.LU) == len(self.u) and not self.problem.keep

    def _along(self, start: int) -> int:
        """By the neighbour's tangents, as far as that goes."""
        near, shape, route, n = self.problem.near, self.shape, self.problem.route, len(self.u)
        assert near is not None
        command = self.problem.command
        way = Way(
            np.maximum(command, 0.0), self.hanging - command, self.held, np.outer(self.scale, 0.0 * self.at + route.stretch),
            self.force, self.wall, self.scale, float(route.mu), float(route.presliding), np.array(self.problem.time, float),
            self.amplitude, self.time, self.close, self.problem.once,
        )  # fmt: skip
        parts = Parts(self.solid.cells, self.solid.cables, self.solid.skin, self.solid.clamped)
        end = along(
            parts, way, Kept(near.q, near.tension, near.LU), start, shape.slip, self.taken,
            (self.u, self.tension, self.length), self.solid.room(),
        )  # fmt: skip
        self.status[start:end] = DIRECT
        if end > start:
            shape.u, shape.tension = self.u[end - 1].reshape(-1, 3).copy(), self.tension[end - 1] / self.scale[end - 1]
            shape.LU, self.at = None, command[end - 1]
        return min(end, n)

    def _put(self, i: int, found: bool) -> None:
        self.status[i] = DIRECT if found else NOT_FOUND
        self.u[i], self.tension[i] = self.shape.u.ravel(), self.shape.tension * self.scale[i]
        self.length[i] = self.solid.pulled.length
        if self.problem.keep and self.shape.LU is not None:
            self.inverse[i] = getri(*self.shape.LU)[0]

    def _march(self, i: int) -> bool:
        """From the last command to that of sample i, in ever smaller parts where Newton's method is lost. False, and the shape as
        it was, where no equilibrium was found."""
        start, goal, done, part = self.at, self.problem.command[i], 0.0, 1.0
        while done < 1.0:
            trial = self.shape.copy()
            command = start + min(1.0, done + part) * (goal - start)
            if self.solid.settle(trial, self._pull(i, command), self._burden(i), close=self.close):
                self.shape, done = trial, done + part
                part = min(2.0 * part, 1.0 - done)
                continue
            part, self.shape.LU = 0.5 * part, None
            if part < SMALLEST:
                return False
        self.at = goal
        time = self.problem.time
        if self.amplitude.size and i + 1 < len(time):
            whole = np.concatenate([np.zeros((self.solid.clamped, 3)), self.shape.u])
            relax_for(whole, self.solid.cells, self.amplitude, self.time, time[i + 1] - time[i], self.taken)
        return True

    def _pull(self, i: int, command: np.ndarray) -> Pull:
        route, scale = self.problem.route, self.scale[i]
        tension = np.where(self.held, 0.0, np.maximum(command, 0.0) / scale)
        stretch = np.full(len(command), route.stretch * scale)
        return Pull(tension, self.held, self.hanging - command, stretch, float(route.mu), float(route.presliding))

    def _burden(self, i: int) -> Burden:
        relaxed = self.taken.sum(axis=0) if self.amplitude.size else np.empty((0, 0, 6))
        wall = self.wall.copy()
        wall[4] /= self.scale[i]
        return Burden(self.force / self.scale[i], wall, relaxed)
