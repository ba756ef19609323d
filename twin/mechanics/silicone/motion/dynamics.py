"""Silicone bodies in motion: MuJoCo's steps with the elasticity of the statics, one body or several in one model.

A motion starts at rest in equilibrium. It has mass, damping and contact, which statics lacks. Statics has walls and tangents for
fits, and needs a sample where a motion needs the time between two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Drive, Problem
from twin.foundation.errors import SolveError
from twin.foundation.parallel import single_thread
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.material.creep import advance_relaxed_stress
from twin.mechanics.silicone.material.damping import effective_mass
from twin.mechanics.silicone.material.flex import finish_flex, flex_spec
from twin.mechanics.silicone.motion.stepping import (
    DONE,
    FASTEST_NODE,
    INVERTED,
    LOST,
    UNBALANCED,
    Contacts,
    EngineState,
    SteppedBody,
    advance_speeds,
    unique_contacts,
    update_forces,
)
from twin.mechanics.silicone.newton import BodyArrays
from twin.mechanics.silicone.solver_arrays import work_arrays
from twin.mechanics.silicone.statics import SoftSolution, SoftStatics, SoftTrial, rotation_about_z

LONGEST_STEP, SHORTEST_STEP = 4e-3, 5e-4  # s
STEP_PER_DAMPING = 0.4  # a step is this share of the silicone's damping coefficient, within these limits
HELD_STIFFNESS = 2e5  # N/m, of a held inextensible tendon: 10 um at 2 N
MOST_POISSON = 0.47  # with 0.49 the finger comes to rest 0.1 mm from statics under tendon friction, not 0.02
FAULTS = {
    INVERTED: "a cell of its silicone has turned inside out",
    LOST: f"a node has no finite speed below {FASTEST_NODE:g} m/s",
    UNBALANCED: "no forces of its tendons and contacts are found",
}


@dataclass(frozen=True)
class RestingBody:
    """A body at rest in equilibrium, ready to be moved: its problem, statics and first equilibrium."""

    body: SoftBody
    statics: SoftStatics
    problem: Problem
    trial: SoftTrial

    @staticmethod
    def of(body: SoftBody, problem: Problem) -> RestingBody:
        """Solve the rest under the problem's loads and first command. Stiffness counts with its mean over the motion.

        Raises SolveError where there is no such equilibrium, and for loads that are not stepped here.
        """
        if problem.loads.wall[4] > 0.0:
            raise SolveError("a silicone body's motion against a soft wall is not stepped here; use static equilibria")
        if problem.heating is not None:
            raise SolveError("SMA springs do not move a silicone body here; remove that drive")
        scale = 1.0 if problem.stiffness is None else float(np.mean(problem.stiffness))
        body = replace(body, youngs_modulus=scale * body.youngs_modulus, poisson=min(body.poisson, MOST_POISSON))
        statics = SoftStatics(body)
        first = replace(
            problem, time=problem.time[:1], command=problem.command[:1], stiffness=None, neighbour=None, keep=False, once=False
        )
        with single_thread():
            trial = SoftTrial(statics, first)
            trial.run()
        if not trial.status.all():
            pull = ", ".join(
                f"{d.display_unit[1] * c:.3g} {d.display_unit[0]}" for d, c in zip(first.drives, first.command[0], strict=True)
            )
            raise SolveError(f"no equilibrium to start from under {pull or np.round(first.command[0], 3).tolist()}")
        return RestingBody(body, statics, problem, trial)

    @property
    def arrays(self) -> BodyArrays:
        """The body's arrays for compiled code."""
        return self.statics.arrays

    def stepped(self, mass: np.ndarray, dof: np.ndarray, step: float) -> SteppedBody:
        """Return the body as it is stepped, its unknowns of `mass` (n,) kg at the coordinates `dof`."""
        problem, trial, state, body = self.problem, self.trial, self.trial.state, self.body
        held = problem.drive_mask(Drive.DISPLACEMENT)
        stiffness = np.full(len(held), 1.0 / (problem.route.stretch + 1.0 / HELD_STIFFNESS))
        resistance = effective_mass(body.lattice, self.arrays, mass, step * max(body.damping, step))
        return SteppedBody(
            self.arrays, work_arrays(self.arrays, len(problem.creep.amplitude) > 0), resistance, dof, held, stiffness,
            trial.hanging_path, state.slip, state.distal, state.tension, self.statics.node_forces(problem.loads).ravel(),
            float(problem.route.mu), float(problem.route.presliding),
        )  # fmt: skip


class SoftMotion:
    """Bodies in one MuJoCo model, in motion from rest in equilibrium.

    `model` is compiled from the bodies' `flex_spec`, `dof` are each one's coordinates in it, `names` their names in messages.
    """

    def __init__(
        self, model: mujoco.MjModel, resting: Sequence[RestingBody], dof: Sequence[np.ndarray], names: Sequence[str]
    ) -> None:
        off = mujoco.mjtDisableBit
        model.opt.disableflags |= off.mjDSBL_AUTORESET  # a diverged state must not be reset silently
        # stepping.py does their work.
        model.opt.disableflags |= off.mjDSBL_SPRING | off.mjDSBL_DAMPER | off.mjDSBL_REFSAFE | off.mjDSBL_ISLAND
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
        self.model, self.data, self.names, self.resting = model, mujoco.MjData(model), tuple(names), tuple(resting)
        mujoco.mj_setConst(model, self.data)
        mujoco.mj_resetData(model, self.data)
        for s, own in zip(resting, dof, strict=True):
            self.data.qpos[own] = s.trial.state.u
        mujoco.mj_forward(model, self.data)
        mass = self.data.M[model.M_rowadr + model.M_rownnz - 1]
        self.bodies = tuple(s.stepped(mass[own], own, self.step) for s, own in zip(resting, dof, strict=True))
        body_of, index = np.full(model.nv, -1), np.zeros(model.nv, int)
        for k, own in enumerate(dof):
            body_of[own], index[own] = k, np.arange(len(own))
        is_thing, data = body_of < 0, self.data
        index[is_thing] = np.arange(is_thing.sum())
        self._engine = EngineState(data.qpos, data.qvel, data.qfrc_bias, mass, body_of, index, int(is_thing.sum()), self.step)
        self._warned = self._warnings()

    @staticmethod
    def of(spec: mujoco.MjSpec, resting: Sequence[RestingBody], prefixes: Sequence[str], names: Sequence[str]) -> SoftMotion:
        """Compile a spec that holds each body's `flex_spec` under its prefix."""
        model = spec.compile()
        dof = [finish_flex(model, s.body, prefix, s.problem.loads.payload) for s, prefix in zip(resting, prefixes, strict=True)]
        return SoftMotion(model, resting, dof, names)

    @property
    def step(self) -> float:
        """Length of a step (s)."""
        return float(self.model.opt.timestep)

    def run(self, start: np.ndarray, end: np.ndarray, n: int) -> None:
        """Take n steps while the commands go linearly from `start` to `end` (body, t), N or m.

        Raises SolveError naming the body and the time where a cell is inverted, a state is not finite or MuJoCo warns.
        """
        for step in range(n):
            mujoco.mj_step1(self.model, self.data)
            share = (step + 1.0) / n
            status, which = advance_speeds(self.bodies, self._engine, self._contacts(), (1.0 - share) * start + share * end)
            if status != DONE:
                break
            mujoco.mj_integratePos(self.model, self.data.qpos, self.data.qvel, self.step)
            self.data.time += self.step
        if status != DONE:
            concerned = slice(None) if which < 0 else slice(which, which + 1)
            pull = ", ".join(f"{T:.3g}" for body in self.bodies[concerned] for T in body.tension)
            raise SolveError(
                f"{', '.join(self.names[concerned])} is lost at t = {self.data.time:.4g} s: {FAULTS[status]}, under tensions "
                f"{pull} N; smoother or smaller commands, or a shorter step, may keep it"
            )
        warned = self._warnings()
        if (warned > self._warned).any():
            kind = mujoco.mjtWarning(int(np.argmax(warned - self._warned))).name
            raise SolveError(
                f"{', '.join(self.names)}: MuJoCo warns ({kind}) at t = {self.data.time:.4g} s; smoother commands or a shorter "
                "step may help"
            )

    def displacement(self, k: int, ahead: float = 0.0) -> np.ndarray:
        """Return the displacements (n_free, 3) m of body k's nodes, extrapolated linearly by `ahead` (s)."""
        dof = self.bodies[k].dof
        return (self.data.qpos[dof] + ahead * self.data.qvel[dof]).reshape(-1, 3)

    def _contacts(self) -> Contacts:
        """Return the contacts that `mj_step1` has found."""
        data, rows, friction = self.data, np.empty(0, np.int64), np.empty(0)
        if data.nefc:
            which = data.efc_id[::3]
            # MuJoCo reports a vertex once for each of its facets; it counts once.
            one = unique_contacts(data.contact.pos[which], data.contact.geom[which], data.contact.flex[which])
            rows, friction = (3 * one[:, None] + np.arange(3)).ravel(), data.contact.friction[which[one], 0]
        return Contacts(
            data.efc_J, data.efc_J_colind, data.efc_J_rowadr[rows], data.efc_J_rownnz[rows], data.efc_KBIP.reshape(-1, 4)[rows],
            data.efc_pos[rows] - data.efc_margin[rows], data.efc_vel[rows], friction, float(self.model.opt.impratio),
        )  # fmt: skip

    def path_lengths(self, k: int) -> np.ndarray:
        """Return the path lengths (t,) m of body k's tendons."""
        body = self.bodies[k]
        update_forces(body, self.data.qpos)
        return body.work.tendons.path.copy()

    def _warnings(self) -> np.ndarray:
        return np.array(self.data.warning.number)


def motion_step(body: SoftBody) -> float:
    """Return the step (s): half of it moves the tip by less than 0.1 mm (tools/benchmarks/solvers/finger_dynamics.py)."""
    return min(LONGEST_STEP, max(SHORTEST_STEP, STEP_PER_DAMPING * body.damping))


class SoftDynamics:
    """A silicone body ready to be moved."""

    def __init__(self, body: SoftBody) -> None:
        self.body = body
        self.statics = SoftStatics(body)
        self.straight_path = self.statics.straight_path

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return self.statics.n_delayed

    def solve(self, problem: Problem) -> SoftSolution:
        """Return the motion from rest in equilibrium under the first command.

        `neighbour`, `keep`, `once` and `tolerance` apply to statics only. Where the motion is lost `end_reason` says why; samples
        from there on are NaN.
        """
        resting = RestingBody.of(self.body, problem)
        spec = flex_spec(resting.body, motion_step(self.body))
        spec.option.gravity = problem.loads.gravity @ rotation_about_z(self.body.turn)
        motion = SoftMotion.of(spec, [resting], [""], ["the finger"])
        return run_motion(motion, problem.time, np.array(problem.command, float)[:, None])[0]


def run_motion(motion: SoftMotion, time: np.ndarray, command: np.ndarray) -> list[SoftSolution]:
    """Return the motion of each body under commands (n, body, t), at times (n,) s."""
    n, b, nt = command.shape
    u = [np.full((n, body.dof.size), np.nan) for body in motion.bodies]
    tension, path = np.full((2, b, n, nt), np.nan)
    relaxed = [CreepBetweenSamples(s) for s in motion.resting]
    h, done, n_sample, ended = motion.step, 0, n, ""
    for i in range(n):
        steps = int((time[i] - time[0]) / h + 1e-6) - done
        try:
            if steps:
                before, after = ((k * h - (time[i - 1] - time[0])) / (time[i] - time[i - 1]) for k in (done, done + steps))
                way = command[i] - command[i - 1]
                motion.run(command[i - 1] + before * way, command[i - 1] + after * way, steps)
        except SolveError as lost:
            n_sample, ended = i, str(lost)
            break
        done += steps
        for k, body in enumerate(motion.bodies):
            u[k][i] = motion.displacement(k, time[i] - time[0] - done * h).ravel()
            tension[k, i], path[k, i] = body.tension, motion.path_lengths(k)
            relaxed[k].advance(body, u[k][i], time[i] - time[max(0, i - 1)])
    status = np.where(np.arange(n) < n_sample, DIRECT, NOT_FOUND)
    return [_solution(s, u[k], tension[k], path[k], status, ended) for k, s in enumerate(motion.resting)]


def _solution(
    resting: RestingBody, u: np.ndarray, tension: np.ndarray, path: np.ndarray, status: np.ndarray, ended: str
) -> SoftSolution:  # fmt: skip
    statics, shapes = resting.statics, u.reshape(len(u), -1, 3)
    return SoftSolution(
        tension=tension, path=path - resting.trial.hanging_path + statics.straight_path, markers=statics.markers(shapes),
        end_reason=ended, status=status, q=u, others=statics.sensor_signals(shapes, resting.problem),
    )  # fmt: skip


class CreepBetweenSamples:
    """Creep between samples, as in statics: advances the relaxed stress in the body's work arrays."""

    def __init__(self, resting: RestingBody) -> None:
        creep = resting.problem.creep
        self.arrays, self.relaxed = resting.arrays, resting.trial.state.relaxed
        self.amplitude, self.retardation = np.array(creep.amplitude, float), np.array(creep.time, float)
        self.all_nodes = np.zeros((resting.arrays.clamped + resting.body.lattice.n_free, 3))

    def advance(self, body: SteppedBody, u: np.ndarray, dt: float) -> None:
        """Advance by dt (s) at nodal displacements u (nq,)."""
        if self.amplitude.size:
            self.all_nodes[self.arrays.clamped :] = u.reshape(-1, 3)
            advance_relaxed_stress(self.all_nodes, self.arrays.cells, self.amplitude, self.retardation, dt, self.relaxed)
            body.work.relaxed[:] = self.relaxed.sum(axis=0)
