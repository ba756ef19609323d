"""Silicone bodies in motion: MuJoCo's steps under the law of the statics, one body or several in one model.

A motion starts at rest in equilibrium. It has mass, damping and contact, which statics lacks; statics has walls, tangents for fits,
and takes a sample where a motion takes the time between two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Problem
from twin.effects import Drive
from twin.errors import SolveError
from twin.soft.body import SoftBody
from twin.soft.creep import relax_for
from twin.soft.flex import Placed, flex, place
from twin.soft.newton import Parts
from twin.soft.room import room_for
from twin.soft.statics import SoftPath, SoftStatics, Trial, single_thread, turned
from twin.soft.stepping import DONE, FASTEST, INVERTED, Engine, Limb, advance, shape

LONGEST, SHORTEST, PER_DAMPING = (
    4e-3,
    5e-4,
    0.4,
)  # s, s, 1: a step is that share of the silicone's damping coefficient, within these
TURNS = 400  # that solve's turns; some hundred do
STIFFNESS = 2e5  # N/m, of a held tendon that does not stretch: 10 um at 2 N
POISSON = 0.47  # at most: MuJoCo's solve of what is less compressible takes twice as long; it moves the tip by 0.03 mm
SOLVED = 1e-4  # MuJoCo's tolerance for (M + h D + h^2 K) a: a tenth of it moves no tip by a micrometre


@dataclass(frozen=True)
class Started:
    """A body at rest in equilibrium, ready to be moved: what was asked of it, its statics and its first equilibrium."""

    body: SoftBody
    statics: SoftStatics
    problem: Problem
    trial: Trial

    @staticmethod
    def of(body: SoftBody, problem: Problem) -> Started:
        """Under the problem's loads and first command. The body's stiffness counts with its mean: temperature changes little in a
        motion. Raises SolveError where there is no such equilibrium, and for what is not stepped here."""
        if problem.loads.wall[4] > 0.0:
            raise SolveError("a silicone body's motion against a soft wall is not stepped here; use static equilibria")
        if problem.route.stiffening > 0.0 or problem.heating is not None:
            raise SolveError("tendons that stiffen and SMA springs do not move a silicone body here; remove that effect or drive")
        scale = 1.0 if problem.stiffness is None else float(np.mean(problem.stiffness))
        body = replace(body, youngs_modulus=scale * body.youngs_modulus, poisson=min(body.poisson, POISSON))
        statics = SoftStatics(body)
        first = replace(
            problem, time=problem.time[:1], command=problem.command[:1], stiffness=None, near=None, keep=False, once=False
        )
        with single_thread():
            trial = Trial(statics, first)
            trial.run()
        if not trial.status.all():
            pull = ", ".join(f"{d.shown[1] * c:.3g} {d.shown[0]}" for d, c in zip(first.drives, first.command[0], strict=True))
            raise SolveError(f"no equilibrium to start from under {pull or np.round(first.command[0], 3).tolist()}")
        return Started(body, statics, problem, trial)

    @property
    def parts(self) -> Parts:
        return self.statics.parts

    def limb(self, model: mujoco.MjModel, placed: Placed) -> Limb:
        """The body as it is stepped. Its tendons' stiffness is set in the model."""
        problem, trial, state = self.problem, self.trial, self.trial.state
        held = problem.which(Drive.DISPLACEMENT)
        stiffness = np.full(len(held), 1.0 / (problem.route.stretch + 1.0 / STIFFNESS))
        model.tendon_stiffness[placed.wraps.tendon] = np.where(held, stiffness, 0.0)
        force = np.outer(self.statics.tip, problem.loads.force @ turned(self.body.turn)).ravel()
        return Limb(
            self.parts, room_for(self.parts, len(problem.creep.amplitude) > 0), placed.dof, placed.wraps, held, stiffness,
            trial.hanging, state.slip, state.beyond, state.tension, force, float(problem.route.mu), float(problem.route.presliding),
        )  # fmt: skip


class Moving:
    """Bodies in one MuJoCo model, from rest in equilibrium on.

    `model` is compiled of what `flex` makes of each, `placed` says where each is in it, `names` what each is called.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, started: Sequence[Started], placed: Sequence[Placed], names: Sequence[str]
    ) -> None:
        model.opt.tolerance, model.opt.iterations = SOLVED, TURNS
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a state that is lost must be seen as such
        self.model, self.data, self.names, self.started = model, data, tuple(names), tuple(started)
        self.limbs = tuple(s.limb(model, p) for s, p in zip(started, placed, strict=True))
        for s, limb in zip(started, self.limbs, strict=True):
            data.qpos[limb.dof] = s.trial.state.u
        mujoco.mj_forward(model, data)
        self._engine = Engine(
            model._address, data._address, data.qpos, data.qvel, data.qfrc_spring, data.qfrc_applied, model.wrap_prm,
            data.ten_length, model.tendon_lengthspring,
        )  # fmt: skip
        self._warned = self._warnings()

    @property
    def step(self) -> float:
        return float(self.model.opt.timestep)

    def run(self, start: np.ndarray, end: np.ndarray, n: int) -> None:
        """n steps while the commands go straight from `start` to `end` (body, t), N or m.

        Raises SolveError naming the body and the time where a cell turns inside out, a state is not finite or MuJoCo warns.
        """
        how, which = advance(self.limbs, self._engine, start, end, n)
        if how != DONE:
            what = (
                "a cell of its silicone has turned inside out"
                if how == INVERTED
                else f"a node has no finite speed below {FASTEST:g} m/s"
            )
            pull = ", ".join(f"{T:.3g}" for T in self.limbs[which].tension)
            raise SolveError(
                f"{self.names[which]} is lost at t = {self.data.time:.4g} s: {what}, under tensions {pull} N; smoother or smaller "
                "commands, or a shorter step, may keep it"
            )
        warned = self._warnings()
        if (warned > self._warned).any():
            kind = mujoco.mjtWarning(int(np.argmax(warned - self._warned))).name
            raise SolveError(
                f"{', '.join(self.names)}: MuJoCo warns ({kind}) at t = {self.data.time:.4g} s; smoother commands or a shorter "
                "step may help"
            )

    def u(self, k: int, ahead: float = 0.0) -> np.ndarray:
        """(n_free, 3) m, displacements of body k's nodes, carried on straight for `ahead` (s)."""
        dof = self.limbs[k].dof
        return (self.data.qpos[dof] + ahead * self.data.qvel[dof]).reshape(-1, 3)

    def lengths(self, k: int) -> np.ndarray:
        """(t,) m, path lengths of body k's tendons."""
        limb = self.limbs[k]
        shape(limb, self._engine)
        return limb.room.pulled.length.copy()

    def _warnings(self) -> np.ndarray:
        return np.array([w.number for w in self.data.warning])


def step_for(body: SoftBody) -> float:
    """s: half of it moves the tip by less than 0.1 mm (tools/finger_dynamics.py)."""
    return min(LONGEST, max(SHORTEST, PER_DAMPING * body.damping))


def compiled(spec: mujoco.MjSpec, put: Callable[[mujoco.MjModel], None]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model of `flex` bodies, each `put` in its place."""
    model = spec.compile()
    put(model)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    return model, data


class SoftDynamics:
    """A silicone body ready to be moved."""

    def __init__(self, body: SoftBody) -> None:
        self.body = body
        self.statics = SoftStatics(body)
        self.straight_path = self.statics.straight_path

    @property
    def n_slow(self) -> int:
        return self.statics.n_slow

    def solve(self, problem: Problem) -> SoftPath:
        """The motion from rest in equilibrium under the first command. `near`, `keep`, `once` and `tolerance` are of statics only.

        Where the motion is lost `ended` says how; samples from there on are NaN.
        """
        started = Started.of(self.body, problem)
        loads, body, placed = problem.loads, started.body, []
        spec = flex(body, started.parts, step_for(body))
        spec.option.gravity = loads.gravity @ turned(body.turn)
        model, data = compiled(spec, lambda m: placed.append(place(m, body, started.parts, payload=loads.payload)))
        return followed(started, Moving(model, data, [started], placed, ["the finger"]), problem)


def followed(started: Started, moving: Moving, problem: Problem) -> SoftPath:
    """One body's motion, seen at the problem's samples."""
    n, nt = problem.command.shape
    u, tension, length = np.full((n, moving.limbs[0].dof.size), np.nan), np.full((n, nt), np.nan), np.full((n, nt), np.nan)
    command, time, h, ended, now, i = np.array(problem.command, float)[:, None], problem.time, moving.step, "", 0, 0
    relaxed = Relaxed(started, problem)
    try:
        for i in range(n):
            steps = int((time[i] - time[0]) / h + 1e-6) - now
            if steps:
                share = (now * h - (time[i - 1] - time[0])) / (time[i] - time[i - 1])
                far = ((now + steps) * h - (time[i - 1] - time[0])) / (time[i] - time[i - 1])
                way = command[i] - command[i - 1]
                moving.run(command[i - 1] + share * way, command[i - 1] + far * way, steps)
                now += steps
            u[i] = moving.u(0, time[i] - time[0] - now * h).ravel()
            tension[i], length[i] = moving.limbs[0].tension, moving.lengths(0)
            relaxed.on(moving, u[i], time[i] - time[max(0, i - 1)])
        i = n
    except SolveError as lost:
        ended = str(lost)
    statics = started.statics
    shapes = u.reshape(n, -1, 3)
    return SoftPath(
        tension=tension, path=length - started.trial.hanging + statics.straight_path, markers=statics.markers(shapes), ended=ended,
        status=np.where(np.arange(n) < i, DIRECT, NOT_FOUND), q=u, others=statics.sensed(shapes),
    )  # fmt: skip


class Relaxed:
    """Creep between samples, as in statics: the relaxed stress that the limb's room holds."""

    def __init__(self, started: Started, problem: Problem) -> None:
        self.parts, self.taken = started.parts, started.trial.state.taken
        self.amplitude, self.lag = np.array(problem.creep.amplitude, float), np.array(problem.creep.time, float)
        self.whole = np.zeros((started.parts.clamped + started.body.lattice.n_free, 3))

    def on(self, moving: Moving, u: np.ndarray, dt: float) -> None:
        """Advance by dt (s) at nodal displacements u (nq,)."""
        if self.amplitude.size:
            self.whole[self.parts.clamped :] = u.reshape(-1, 3)
            relax_for(self.whole, self.parts.cells, self.amplitude, self.lag, dt, self.taken)
            moving.limbs[0].room.relaxed[:] = self.taken.sum(axis=0)
