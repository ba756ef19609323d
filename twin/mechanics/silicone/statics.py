"""Static trials of a silicone body: the hanging rest, then all commands in turn, each shape found from the one before."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twin.body import DIRECT, NOT_FOUND, SOLVE_TOLERANCE, Drive, Loads, Problem, Solution, array_hash
from twin.body.strain_cords import resistance
from twin.effects.contact import obstacle_in_frame
from twin.foundation.errors import SolveError
from twin.foundation.parallel import single_thread
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.newton import NODE_TOLERANCE, NewtonProblem, SoftNeighbour, SoftResult, solve_samples
from twin.mechanics.silicone.skin import Skin, expected_patches
from twin.mechanics.silicone.solver_arrays import body_arrays, undeformed_state, work_arrays

SMALLEST_COMMAND_PART = 1e-3  # of a change between two samples
MOST_SOLUTIONS_KEPT = 64  # of some 300 kB each


@dataclass(frozen=True, kw_only=True)
class SoftSolution(Solution):
    """Solution of a silicone body.

    `q` (n, nq) are the displacements of the free nodes, m; `LU` (n, nq, nq) the inverses of their tangents, m/N, in single
    precision. `fingerprint` is a hash of what was solved, so that the same problem need not be solved again. `others`: "strain" (n,
    s) of the cords, "sensor" (n, s) ohm and "sensor_rest", at no strain; "skin" (n, k) m, expected patches of the camera's clouds,
    as in `twin.measurements.patches`.
    """

    fingerprint: bytes = b""


_SOLVED: dict[
    tuple[bytes, float], SoftSolution
] = {}  # trials solved from their start, so that what differs only in sensors is not solved again


class SoftStatics:
    """A body ready to be solved. One instance serves one thread at a time."""

    def __init__(self, body: SoftBody) -> None:
        self.body = body
        self.arrays = body_arrays(body)
        grid = body.lattice
        self.straight_path: np.ndarray = np.linalg.norm(np.diff(body.paths, axis=1), axis=2).sum(axis=1)
        self.tip = grid.weights(np.array([[0.0, 0.0, body.cone.length]]))[0]
        self._seen, self._cords = grid.weights(body.marker_rest), grid.weights(body.cord_paths.reshape(-1, 3))
        self._pieces = np.diff(body.cord_paths, axis=1)
        self._cord_steps = np.diff(self._cords.reshape(*body.cord_paths.shape[:2], -1), axis=1)
        self._cord_rest = np.linalg.norm(self._pieces, axis=2).sum(axis=1)

    @cached_property
    def skin(self) -> Skin:
        """The skin as a camera sees it."""
        return Skin.of(self.body)

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return self.arrays.cells.weight.size * 6

    def solve(self, problem: Problem) -> SoftSolution:
        """Return the equilibria in order. Held lengths and `path` count from the hanging rest, under the weight of the body alone.

        A payload comes on after the drums have been set to zero. The first sample without an equilibrium ends the trial: from there
        on the status is NOT_FOUND and no shape is given. Raises SolveError for SMA springs, which are not solved here.
        """
        if problem.heating is not None:
            raise SolveError("SMA springs are not solved for a silicone body; remove that drive")
        with single_thread():
            trial, near = SoftTrial(self, problem), problem.neighbour
            problem_hash = trial.problem_hash()
            if isinstance(near, SoftSolution) and near.fingerprint == problem_hash != b"":
                u = near.q.reshape(len(near.q), -1, 3)  # only markers and sensors differ
                return replace(near, markers=self.markers(u), others=self.sensor_signals(u, problem))
            cold = problem_hash != b"" and near is None and not problem.keep
            if cold and (found := _SOLVED.get((problem_hash, problem.tolerance))) is not None:
                u = found.q.reshape(len(found.q), -1, 3)
                return replace(found, markers=self.markers(u), others=self.sensor_signals(u, problem))
            with suppress(np.linalg.LinAlgError):  # a tangent without an inverse: no equilibrium from there on
                trial.run()
        u = trial.result.u.reshape(len(trial.result.u), -1, 3)
        path = SoftSolution(
            tension=trial.result.tension, path=trial.result.path - trial.hanging_path + self.straight_path, markers=self.markers(u),
            status=trial.status, q=trial.result.u, others=self.sensor_signals(u, problem), LU=trial.inverses(),
            fingerprint=problem_hash if trial.status.all() else b"",
        )  # fmt: skip
        if cold and path.fingerprint:
            _SOLVED[problem_hash, problem.tolerance] = path
            while len(_SOLVED) > MOST_SOLUTIONS_KEPT:
                _SOLVED.pop(next(iter(_SOLVED)), None)
        return path

    def node_forces(self, loads: Loads) -> np.ndarray:
        """Return the nodes' forces (n_free, 3) N of the tip force and the push, in the finger's own frame."""
        turn, push, cone = rotation_about_z(self.body.turn), loads.push, self.body.cone
        force = np.outer(self.tip, loads.force @ turn)
        if push is not None:
            z = push.height * cone.length
            radius, azimuth = float(cone.radius(z)), push.azimuth - self.body.turn
            point = np.array([[radius * np.cos(azimuth), radius * np.sin(azimuth), z]])
            force = force + np.outer(self.body.lattice.weights(point)[0], push.force @ turn)
        return force

    def markers(self, u: np.ndarray) -> np.ndarray:
        """Return the markers and the tip, (n, m + 1, 3) m in the base frame."""
        tip = self.tip @ u + [0.0, 0.0, self.body.cone.length]
        own = np.concatenate([self.body.marker_rest + self._seen @ u, tip[:, None]], axis=1)
        return own @ rotation_about_z(self.body.turn).T

    def sensor_signals(self, u: np.ndarray, problem: Problem | None = None) -> dict[str, np.ndarray]:
        """Return the cords' signals at nodes' displacements u (n, n_free, 3) m, and a problem's expected patches, by group.

        Groups as in `SoftSolution.others`.
        """
        strain = self.strain(self.cord_paths(u))
        rest = np.broadcast_to(self.body.cords.rest, strain.shape)
        signals = {"strain": strain, "sensor": resistance(strain, self.body.cords), "sensor_rest": rest}
        if problem is None or problem.seen is None:
            return signals
        return signals | {"skin": expected_patches(self.skin, problem.seen, problem.time, u, rotation_about_z(self.body.turn))}

    def cord_paths(self, u: np.ndarray) -> np.ndarray:
        """Return the cords' paths (n, s, p, 3) m in the finger's own frame at nodes' displacements u (n, n_free, 3) m."""
        return self.body.cord_paths + (self._cords @ u).reshape(len(u), *self.body.cord_paths.shape)

    def strain(self, cords: np.ndarray) -> np.ndarray:
        """Return the strain (n, s) of cord paths (n, s, p, 3) m."""
        return np.linalg.norm(np.diff(cords, axis=2), axis=3).sum(axis=2) / self._cord_rest - 1.0

    def strain_slope(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cords' strains (s,) at nodes' displacements u (n_free, 3) m, and their derivatives (s, 3 n_free) 1/m."""
        piece = self._pieces + self._cord_steps @ u
        length = np.sqrt((piece**2).sum(axis=2))
        slope = (np.swapaxes(self._cord_steps, 1, 2) @ (piece / length[..., None])).reshape(len(piece), -1)
        return length.sum(axis=1) / self._cord_rest - 1.0, slope / self._cord_rest[:, None]


def rotation_about_z(angle: float) -> np.ndarray:
    """Return the rotation matrix about z by `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class SoftTrial:
    """A trial through a problem's commands. Loads and tensions count over the relative stiffness, `scale` (n,)."""

    def __init__(self, statics: SoftStatics, problem: Problem) -> None:
        self.problem, self.arrays, body = problem, statics.arrays, statics.body
        n, nt = problem.command.shape
        loads, turn = problem.loads, rotation_about_z(body.turn)
        along = loads.gravity @ turn
        weight = np.outer(body.lattice.volume, body.density * along)
        self.zero = weight + np.outer(statics.tip, loads.payload_at_zero * along)  # loads under which lengths are set to zero
        self.force = weight + np.outer(statics.tip, loads.payload * along) + statics.node_forces(loads)
        self.wall = obstacle_in_frame(loads.wall, turn, np.zeros(3))
        self.held = problem.drive_mask(Drive.DISPLACEMENT)
        self.scale = np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float)
        k = len(problem.creep.amplitude)
        delayed = np.zeros((k, statics.n_delayed)) if problem.delayed is None else problem.delayed
        self.state = undeformed_state(self.arrays, delayed.reshape(k, *self.arrays.cells.weight.shape, 6))
        self.work = work_arrays(self.arrays, k > 0)
        nq = self.state.u.size
        self.result = SoftResult(
            np.zeros((n, nq)),
            np.zeros((n, nt)),
            np.zeros((n, nt)),
            np.empty((n if problem.keep else 0, nq, nq), np.float32),
            np.zeros(n, bool),
        )
        self.status = np.full(n, NOT_FOUND)
        self.hanging_path, self.command = np.zeros(nt), np.zeros(nt)
        self.is_hanging = False

    def problem_hash(self) -> bytes:
        """Return a hash of everything that determines the shapes; empty with creep, whose state must be advanced."""
        if self.problem.creep.amplitude:
            return b""
        cells, route = self.arrays.cells, self.problem.route
        numbers = (
            cells.shear, cells.bulk, cells.gradient, self.arrays.cables.weights, self.zero, self.force, self.wall, self.scale,
            self.held, self.problem.command, np.array([route.mu, route.presliding, route.stretch]),
        )  # fmt: skip
        return array_hash(*numbers)

    def run(self) -> None:
        """Solve the rest from which lengths count, then the loads, then all samples, up to the first without an equilibrium."""
        slack = np.zeros(len(self.command), bool)
        self.is_hanging = self._solve_command(0, self.command, slack, self.zero)
        self.hanging_path = self.work.tendons.path.copy()
        if self.is_hanging and (self.force != self.zero).any():
            self.is_hanging = self._solve_command(0, self.command, slack, self.force)
        self.state.slip[:] = 0.0
        i, n, near = 0, len(self.status), self.problem.neighbour
        neighbour = SoftNeighbour(self.result.u[:0], self.result.tension[:0], self.result.inverse[:0])
        if near is not None and len(near.LU) == n:
            neighbour = SoftNeighbour(near.q, near.tension, near.LU)
        newton_problem = self._newton_problem(slice(0, n), self.problem.command, self.held, self.force)
        while i < n and self.is_hanging:
            end = solve_samples(self.arrays, newton_problem, neighbour, i, self.state, self.result, self.work)
            self.status[i:end] = DIRECT
            i = end
            if i < n:  # Newton's method fails between two commands: go in parts
                self.command = self.problem.command[i - 1] if i else self.command
                if not self._in_parts(i):
                    return  # later samples would start from a shape that is no equilibrium
                self.status[i] = DIRECT
                i += 1

    def inverses(self) -> np.ndarray:
        """Return inverse tangents (n, nq, nq) m/N, the neighbour's where they served; none unless they are to be kept."""
        near, result = self.problem.neighbour, self.result
        if near is None or not result.borrowed.any() or not len(result.inverse):
            return result.inverse
        if result.borrowed.all():
            return near.LU
        result.inverse[result.borrowed] = near.LU[result.borrowed]
        return result.inverse

    def _in_parts(self, i: int) -> bool:
        """Move from the last command to that of sample i in ever smaller parts.

        Returns False, at the last shape found, on failure.
        """
        start, goal, done, part = self.command, self.problem.command[i], 0.0, 0.5
        if i and self.status[i - 1]:
            self.state.u[:], self.state.tension[:] = self.result.u[i - 1], self.result.tension[i - 1] / self.scale[i - 1]
        while done < 1.0 and part > SMALLEST_COMMAND_PART:
            if self._solve_command(i, start + min(1.0, done + part) * (goal - start), self.held, self.force):
                done += part
                part = min(2.0 * part, 1.0 - done)
            else:
                part *= 0.5
        self.result.u[i], self.result.tension[i] = self.state.u, self.state.tension * self.scale[i]
        self.result.path[i] = self.work.tendons.path
        if self.problem.keep:
            self.result.inverse[i] = self.state.inverse
        return done >= 1.0

    def _solve_command(self, i: int, command: np.ndarray, held: np.ndarray, force: np.ndarray) -> bool:
        """Solve one command under `force` (n_free, 3) N on the nodes and the other loads of sample i."""
        n, nt, nq = 1, len(command), self.state.u.size
        no_neighbour = SoftNeighbour(np.empty((0, nq)), np.empty((0, nt)), np.empty((0, nq, nq), np.float32))
        result = SoftResult(np.empty((n, nq)), np.empty((n, nt)), np.empty((n, nt)), no_neighbour.inverse, np.zeros(n, bool))
        problem = self._newton_problem(slice(i, i + 1), command[None], held, force)
        return solve_samples(self.arrays, problem, no_neighbour, 0, self.state, result, self.work) == 1

    def _newton_problem(self, rows: slice, command: np.ndarray, held: np.ndarray, force: np.ndarray) -> NewtonProblem:
        problem, scale = self.problem, self.scale[rows]
        once = problem.once and len(command) == len(self.scale)
        tension, free = np.ascontiguousarray(np.maximum(command, 0.0)), np.ascontiguousarray(self.hanging_path - command)
        return NewtonProblem(
            tension, free, held, np.outer(scale, np.full(len(held), problem.route.stretch)), force, self.wall, scale,
            float(problem.route.mu), float(problem.route.presliding),
            np.array(problem.time[rows], float), np.array(problem.creep.amplitude, float), np.array(problem.creep.time, float),
            NODE_TOLERANCE * problem.tolerance / SOLVE_TOLERANCE, once, problem.keep,
        )  # fmt: skip
