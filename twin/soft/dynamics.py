"""Silicone bodies in motion: MuJoCo's steps under the law of the statics, one body or several in one model.

A motion starts at rest in equilibrium. It has mass, damping and contact, which statics lacks; statics has walls, tangents for fits,
and takes a sample where a motion takes the time between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Problem
from twin.effects import Drive
from twin.errors import SolveError
from twin.soft.body import SoftBody
from twin.soft.creep import relax_for
from twin.soft.flex import flex, place
from twin.soft.metric import metric
from twin.soft.newton import Parts
from twin.soft.room import room_for
from twin.soft.statics import SoftPath, SoftStatics, Trial, turned
from twin.soft.stepping import DONE, FASTEST, INVERTED, LOST, UNBALANCED, Engine, Limb, Touch, advance, once, shape
from twin.threads import single_thread

LONGEST, SHORTEST, PER_DAMPING = (
    4e-3,
    5e-4,
    0.4,
)  # s, s, 1: a step is that share of the silicone's damping coefficient, within these
STIFFNESS = 2e5  # N/m, of a held tendon that does not stretch: 10 um at 2 N
POISSON = 0.47  # at most: with 0.49 the finger comes to rest 0.1 mm from statics among rubbing tendons, not 0.02
WRONG = {
    INVERTED: "a cell of its silicone has turned inside out",
    LOST: f"a node has no finite speed below {FASTEST:g} m/s",
    UNBALANCED: "what its tendons and contacts push with is not found",
}


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
        if problem.heating is not None:
            raise SolveError("SMA springs do not move a silicone body here; remove that drive")
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

    def limb(self, mass: np.ndarray, dof: np.ndarray, step: float) -> Limb:
        """The body as it is stepped, its unknowns of `mass` (n,) kg at the coordinates `dof`."""
        problem, trial, state, body = self.problem, self.trial, self.trial.state, self.body
        held = problem.which(Drive.DISPLACEMENT)
        stiffness = np.full(len(held), 1.0 / (problem.route.stretch + 1.0 / STIFFNESS))
        damps = metric(body.lattice, self.parts, mass, step * max(body.damping, step))
        return Limb(
            self.parts, room_for(self.parts, len(problem.creep.amplitude) > 0), damps, dof, held, stiffness, trial.hanging,
            state.slip, state.beyond, state.tension, self.statics.pressed(problem.loads).ravel(), float(problem.route.mu),
            float(problem.route.presliding),
        )  # fmt: skip


class Moving:
    """Bodies in one MuJoCo model, from rest in equilibrium on.

    `model` is compiled of what `flex` makes of each, `dof` are each one's coordinates in it, `names` what each is called.
    """

    def __init__(self, model: mujoco.MjModel, started: Sequence[Started], dof: Sequence[np.ndarray], names: Sequence[str]) -> None:
        off = mujoco.mjtDisableBit
        model.opt.disableflags |= off.mjDSBL_AUTORESET  # a state that is lost must be seen as such
        # What these do is done in stepping.py.
        model.opt.disableflags |= off.mjDSBL_SPRING | off.mjDSBL_DAMPER | off.mjDSBL_REFSAFE | off.mjDSBL_ISLAND
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
        self.model, self.data, self.names, self.started = model, mujoco.MjData(model), tuple(names), tuple(started)
        mujoco.mj_setConst(model, self.data)
        mujoco.mj_resetData(model, self.data)
        for s, own in zip(started, dof, strict=True):
            self.data.qpos[own] = s.trial.state.u
        mujoco.mj_forward(model, self.data)
        mass = self.data.M[model.M_rowadr + model.M_rownnz - 1]
        self.limbs = tuple(s.limb(mass[own], own, self.step) for s, own in zip(started, dof, strict=True))
        limb, place = np.full(model.nv, -1), np.zeros(model.nv, int)
        for k, own in enumerate(dof):
            limb[own], place[own] = k, np.arange(len(own))
        place[limb < 0] = np.arange((limb < 0).sum())
        data = self.data
        self._engine = Engine(data.qpos, data.qvel, data.qfrc_bias, mass, limb, place, int((limb < 0).sum()), self.step)
        self._warned = self._warnings()

    @staticmethod
    def of(spec: mujoco.MjSpec, started: Sequence[Started], prefixes: Sequence[str], names: Sequence[str]) -> Moving:
        """Of a spec that holds what `flex` makes of each body under its prefix."""
        model = spec.compile()
        dof = [place(model, s.body, prefix, s.problem.loads.payload) for s, prefix in zip(started, prefixes, strict=True)]
        return Moving(model, started, dof, names)

    @property
    def step(self) -> float:
        return float(self.model.opt.timestep)

    def run(self, start: np.ndarray, end: np.ndarray, n: int) -> None:
        """n steps while the commands go straight from `start` to `end` (body, t), N or m.

        Raises SolveError naming the body and the time where a cell turns inside out, a state is not finite or MuJoCo warns.
        """
        for step in range(n):
            mujoco.mj_step1(self.model, self.data)
            share = (step + 1.0) / n
            how, which = advance(self.limbs, self._engine, self._touch(), (1.0 - share) * start + share * end)
            if how != DONE:
                break
            mujoco.mj_integratePos(self.model, self.data.qpos, self.data.qvel, self.step)
            self.data.time += self.step
        if how != DONE:
            concerned = slice(None) if which < 0 else slice(which, which + 1)
            pull = ", ".join(f"{T:.3g}" for limb in self.limbs[concerned] for T in limb.tension)
            raise SolveError(
                f"{', '.join(self.names[concerned])} is lost at t = {self.data.time:.4g} s: {WRONG[how]}, under tensions {pull} N; "
                "smoother or smaller commands, or a shorter step, may keep it"
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

    def _touch(self) -> Touch:
        """What touches, where `mj_step1` has seen it."""
        data, rows, friction = self.data, np.empty(0, np.int64), np.empty(0)
        if data.nefc:
            which = data.efc_id[::3]
            # A vertex is seen once for each of its facets; it touches once.
            one = once(data.contact.pos[which], data.contact.geom[which], data.contact.flex[which])
            rows, friction = (3 * one[:, None] + np.arange(3)).ravel(), data.contact.friction[which[one], 0]
        return Touch(
            data.efc_J, data.efc_J_colind, data.efc_J_rowadr[rows], data.efc_J_rownnz[rows], data.efc_KBIP.reshape(-1, 4)[rows],
            data.efc_pos[rows] - data.efc_margin[rows], data.efc_vel[rows], friction, float(self.model.opt.impratio),
        )  # fmt: skip

    def lengths(self, k: int) -> np.ndarray:
        """(t,) m, path lengths of body k's tendons."""
        limb = self.limbs[k]
        shape(limb, self.data.qpos)
        return limb.room.pulled.length.copy()

    def _warnings(self) -> np.ndarray:
        return np.array(self.data.warning.number)


def step_for(body: SoftBody) -> float:
    """s: half of it moves the tip by less than 0.1 mm (tools/finger_dynamics.py)."""
    return min(LONGEST, max(SHORTEST, PER_DAMPING * body.damping))


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
        spec = flex(started.body, step_for(self.body))
        spec.option.gravity = problem.loads.gravity @ turned(self.body.turn)
        moving = Moving.of(spec, [started], [""], ["the finger"])
        return followed(moving, problem.time, np.array(problem.command, float)[:, None])[0]


def followed(moving: Moving, time: np.ndarray, command: np.ndarray) -> list[SoftPath]:
    """The motion of each body under commands (n, body, t), seen at times (n,) s."""
    n, b, nt = command.shape
    u = [np.full((n, limb.dof.size), np.nan) for limb in moving.limbs]
    tension, length = np.full((2, b, n, nt), np.nan)
    relaxed = [Relaxed(s) for s in moving.started]
    h, now, taken, ended = moving.step, 0, n, ""
    for i in range(n):
        steps = int((time[i] - time[0]) / h + 1e-6) - now
        try:
            if steps:
                before, after = ((k * h - (time[i - 1] - time[0])) / (time[i] - time[i - 1]) for k in (now, now + steps))
                way = command[i] - command[i - 1]
                moving.run(command[i - 1] + before * way, command[i - 1] + after * way, steps)
        except SolveError as lost:
            taken, ended = i, str(lost)
            break
        now += steps
        for k, limb in enumerate(moving.limbs):
            u[k][i] = moving.u(k, time[i] - time[0] - now * h).ravel()
            tension[k, i], length[k, i] = limb.tension, moving.lengths(k)
            relaxed[k].on(limb, u[k][i], time[i] - time[max(0, i - 1)])
    status = np.where(np.arange(n) < taken, DIRECT, NOT_FOUND)
    return [_path(s, u[k], tension[k], length[k], status, ended) for k, s in enumerate(moving.started)]


def _path(
    started: Started, u: np.ndarray, tension: np.ndarray, length: np.ndarray, status: np.ndarray, ended: str
) -> SoftPath:  # fmt: skip
    statics, shapes = started.statics, u.reshape(len(u), -1, 3)
    return SoftPath(
        tension=tension, path=length - started.trial.hanging + statics.straight_path, markers=statics.markers(shapes), ended=ended,
        status=status, q=u, others=statics.sensed(shapes, started.problem),
    )  # fmt: skip


class Relaxed:
    """Creep between samples, as in statics: the relaxed stress that the limb's room holds."""

    def __init__(self, started: Started) -> None:
        creep = started.problem.creep
        self.parts, self.taken = started.parts, started.trial.state.taken
        self.amplitude, self.lag = np.array(creep.amplitude, float), np.array(creep.time, float)
        self.whole = np.zeros((started.parts.clamped + started.body.lattice.n_free, 3))

    def on(self, limb: Limb, u: np.ndarray, dt: float) -> None:
        """Advance by dt (s) at nodal displacements u (nq,)."""
        if self.amplitude.size:
            self.whole[self.parts.clamped :] = u.reshape(-1, 3)
            relax_for(self.whole, self.parts.cells, self.amplitude, self.lag, dt, self.taken)
            limb.room.relaxed[:] = self.taken.sum(axis=0)
