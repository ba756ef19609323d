"""The solver of an MJCF: trials by MuJoCo's steps, with the laws of effects between them."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Loads, Problem, Route, Solution, Start
from twin.mechanics.mjcf.body import ModelBody, line_lag, payload_places
from twin.mechanics.mjcf.friction import JointLaws, Paths, Slip, Tree
from twin.mechanics.mjcf.poses import add_masses, set_start
from twin.mechanics.mjcf.routes import geared
from twin.mechanics.mjcf.stepping import LARGEST_RATE, Laws, Memory, Views, run
from twin.mechanics.mjcf.stops import soften_stops

LONGEST_STEP = 2e-3  # s: for a finger of 30 g on winches of 2 N/mm a hundredth of a degree from the limit of short steps
# Times the body's own, where joints rub or bump: on a finger whose joints stick within 0.03 deg, against an independent simulator,
# steps of 2 ms err by 0.3 to 0.5 standard deviations of its noise where friction is worth 8, those of 1 ms by 0.1.
RUBBING_STEPS = 0.5
COARSE_STEPS = 2.5  # times `longest_step`, for differences (`Problem.once`): see `twin.diagnosis.calibration.objective`
MOST_LOADED_MODELS = 8
MOST_SETTLED = 4
_WHOLE_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_SHOWN = ("qpos", "qfrc_actuator", "actuator_length", "actuator_force", "ten_length", "site_xpos", "sensordata")
_RATES = ("qvel", "actuator_velocity", "ten_velocity")


@dataclass(frozen=True)
class _Compiled:
    """A model under one set of loads, its data, views and tendons' geometry."""

    model: mujoco.MjModel
    data: mujoco.MjData
    views: Views
    tree: Tree
    paths: Paths
    pull: np.ndarray
    settled: dict[bytes, tuple[np.ndarray, Memory]] = field(default_factory=dict)  # states where trials begin


@dataclass(frozen=True)
class Motion:
    """A model in motion under its loads and laws, in steps of `step` s; `stands` is whether it has a state to go on from."""

    under: _Compiled
    laws: Laws
    memory: Memory
    step: float
    stands: bool

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped."""
        return self.under.model

    @property
    def data(self) -> mujoco.MjData:
        """Its state."""
        return self.under.data

    def advance(self, commands: np.ndarray, rows: np.ndarray, out: np.ndarray) -> int:
        """Step through commands (n, nu) as `twin.mechanics.mjcf.stepping.run`; return the number of steps."""
        now = self.under
        return run((now.model._address, now.data._address, self.step), now.views, self.laws, self.memory, commands, rows, out)


class ModelSolver:
    """Simulates trials of an MJCF. Its statics are its dynamics: what is slow is stepped like what is fast.

    Steps are the rows' interval in equal parts, `longest_step` at most, `COARSE_STEPS` times as much for differences between two
    problems (`Problem.once`); commands run straight from row to row. A trial starts settled under its first command
    (`twin.body.Start`).
    """

    n_delayed = 0

    def __init__(self, body: ModelBody) -> None:
        self.body, self.places = body, payload_places(body.loaded)
        self.straight_path = _lengths_at_rest(body.model)
        self._compiled: dict[bytes, _Compiled] = {}

    def solve(self, problem: Problem) -> Solution:
        """Simulate a trial. Raises DataError for a payload or a start that the model does not have."""
        time, h, rows = _grid(problem.time, longest_step(self.body, problem.route) * (COARSE_STEPS if problem.once else 1.0))
        at, course = problem.course or (problem.time, problem.command)
        commands = np.stack([np.interp(time, at, u) for u in np.asarray(course, float).T], axis=1)
        motion = self.begin(problem, h, commands[0])
        now = motion.under
        out = np.full((len(time) if rows is None else len(problem.time), _width(now)), np.nan)
        each = np.append(np.arange(len(time)) if rows is None else rows, -1)
        commands = np.vstack([commands, commands[-1:]])
        done = motion.advance(commands, each, out) if motion.stands else 0
        if rows is None:
            out = np.stack([np.interp(problem.time, time, column) for column in out.T], axis=1)
        return self._solution(out, now, done == len(commands))

    def begin(self, problem: Problem, h: float, first: np.ndarray) -> Motion:
        """Return a problem's motion in steps of h s where it begins: settled under the `first` command (nu,). Raises as `solve`."""
        now = self._under(problem.loads)
        laws = _laws(now, self.body, problem.route)
        now.model.opt.timestep = h
        soften_stops(now.model, self.body, problem.route.bumpers, h)
        memory, stands = self._settled(now, laws, problem, h, first[None])
        return Motion(now, laws, memory, h, stands)

    def _settled(self, now: _Compiled, laws: Laws, problem: Problem, h: float, first: np.ndarray) -> tuple[Memory, bool]:
        """Settle under the `first` command (1, nu), or take what was settled before; return the laws' memory and whether it stands.

        Most trials of a session begin alike.
        """
        start = problem.start
        key = repr((first.tolist(), h, start.settle, start.pose, problem.route)).encode()
        if key not in now.settled:
            set_start(now.model, now.data, first[0], start.pose)
            memory = _memory(now, laws)
            steps = max(0, round(start.settle / h))
            held, none, nothing = np.repeat(first, steps, axis=0), np.empty(0, np.int64), np.empty((0, 0))
            run((now.model._address, now.data._address, h), now.views, laws, memory, held, none, nothing)
            state = np.empty(mujoco.mj_stateSize(now.model, _WHOLE_STATE))
            mujoco.mj_getState(now.model, now.data, state, _WHOLE_STATE)
            if len(now.settled) >= MOST_SETTLED:
                now.settled.pop(next(iter(now.settled)))
            now.settled[key] = state, memory
        state, memory = now.settled[key]
        mujoco.mj_resetData(now.model, now.data)
        mujoco.mj_setState(now.model, now.data, state, _WHOLE_STATE)
        mujoco.mj_forward(now.model, now.data)
        slip = memory.slip._replace(z=memory.slip.z.copy(), beyond=memory.slip.beyond.copy())  # type: ignore[attr-defined]
        copied = memory._replace(z=memory.z.copy(), slip=slip, started=memory.started.copy(),
                                 heard=memory.heard.copy(), **_at_rest(now.model))  # fmt: skip
        if start.seen and laws.joints.dof.size:
            _stand(now, self.body, laws.joints, copied.z, start)
        rates = now.data.qvel
        return copied, bool(np.isfinite(rates).all() and np.abs(rates).max(initial=0.0) < LARGEST_RATE)

    def loaded_model(self, loads: Loads) -> mujoco.MjModel:
        """Return a copy of the model that is stepped under these loads."""
        return copy(self._under(loads).model)

    def _under(self, loads: Loads) -> _Compiled:
        """Return the model with the loads' gravity and payloads."""
        body = self.body
        tip = [(body.loaded.names("site")[body.tip], loads.payload)] if loads.payload and body.tip >= 0 else []
        masses = [*loads.payloads, *tip]
        key = repr((masses, loads.gravity.tolist())).encode()
        if key not in self._compiled:
            model = copy(body.model)
            add_masses(model, masses, self.places)
            model.opt.gravity[:] = loads.gravity
            if model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4):  # has no step in two halves
                model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # what diverges is not begun again unseen
            data = mujoco.MjData(model)
            mujoco.mj_setConst(model, data)
            if len(self._compiled) >= MOST_LOADED_MODELS:
                self._compiled.pop(next(iter(self._compiled)))
            self._compiled[key] = _compile(model, data)
        return self._compiled[key]

    def _solution(self, out: np.ndarray, now: _Compiled, whole: bool) -> Solution:
        """Return the recorded columns as signals by group."""
        model, at = now.model, 0
        found = {}
        for name, array in zip((*_SHOWN, *_RATES), (*now.views.shown, *now.views.rates), strict=True):
            found[name] = out[:, at : at + array.size]
            at += array.size
        joints = np.arange(model.njnt)
        dof, qpos = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
        angle, speed, effort = found["qpos"][:, qpos], found["qvel"][:, dof], found["qfrc_actuator"][:, dof]
        length, force = found["actuator_length"], found["actuator_force"]
        others = {"joint angle": angle, "joint shift": angle, "joint rate": speed, "joint speed": speed, "joint torque": effort}
        others |= {
            "joints": angle[:, list(self.body.joints)],
            "joint force": effort,
            "actuator angle": length,
            "actuator length": length,
        }
        others |= {"actuator rate": found["actuator_velocity"], "actuator speed": found["actuator_velocity"]}
        others |= {"actuator torque": force, "actuator force": force, "tendon length": found["ten_length"]}
        others |= {"tendon speed": found["ten_velocity"], "tendon tension": force @ now.pull.T + _own_tension(model, found)}
        others |= {sense.group: found["sensordata"] for name, sense in self.body.senses.items() if name.startswith("sensor.")}
        good = np.isfinite(out).all(axis=1)
        return Solution(
            tension=-force, path=length, markers=found["site_xpos"].reshape(len(out), -1, 3), q=found["qpos"], others=others,
            status=np.where(good, DIRECT, NOT_FOUND),
            end_reason="" if whole and good.all() else "the model's motion diverges; check masses, inertias and gains, or write "
            "a shorter `timestep` in [structure]",
        )  # fmt: skip


def _own_tension(model: mujoco.MjModel, found: dict[str, np.ndarray]) -> np.ndarray:
    """Return the tension (n, ntendon) of the tendons' own springs and dampers."""
    length, low, high = found["ten_length"], model.tendon_lengthspring[:, 0], model.tendon_lengthspring[:, 1]
    stretch = np.maximum(length - high, 0.0) + np.minimum(length - low, 0.0)
    return model.tendon_stiffness * stretch + model.tendon_damping * found["ten_velocity"]


def _compile(model: mujoco.MjModel, data: mujoco.MjData) -> _Compiled:
    shown, rates = (tuple(np.asarray(getattr(data, name)).reshape(-1) for name in names) for names in (_SHOWN, _RATES))
    before = sum(array.size for array in shown[: _SHOWN.index("actuator_force")])
    affine = (model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)) & (model.actuator_delay <= 0.0)
    limits = np.where(model.actuator_forcelimited[:, None] != 0, model.actuator_forcerange, [-np.inf, np.inf])
    views = Views(
        data.ctrl, data.qvel, data.qfrc_applied, data.actuator_force,
        (data.qfrc_passive, data.qfrc_actuator, data.qfrc_constraint, data.qfrc_bias), model.dof_damping, shown,
        rates, before, np.where(affine, model.actuator_biasprm[:, 2], 0.0), limits,
        (data.moment_rownnz, data.moment_rowadr, data.moment_colind, data.actuator_moment.reshape(-1)),
        model.opt.integrator != int(mujoco.mjtIntegrator.mjINT_EULER), data.actuator_length,
        np.column_stack([model.actuator_gainprm[:, 0], model.actuator_biasprm[:, :2]]),
    )  # fmt: skip
    last = np.full(model.nbody, -1, np.int64)
    for k in range(model.nbody):
        own = model.body_dofnum[k] > 0
        last[k] = model.body_dofadr[k] + model.body_dofnum[k] - 1 if own else last[model.body_parentid[k]] if k else -1
    tree = Tree(
        model.tendon_adr.astype(np.int64), model.tendon_num.astype(np.int64), model.wrap_type.astype(np.int64),
        model.wrap_objid.astype(np.int64), model.site_bodyid.astype(np.int64), model.geom_bodyid.astype(np.int64),
        model.body_rootid.astype(np.int64), last, model.dof_parentid.astype(np.int64),
    )  # fmt: skip
    paths = Paths(
        data.ten_wrapadr, data.ten_wrapnum, data.wrap_obj.reshape(-1), data.wrap_xpos.reshape(-1, 3), data.cdof, data.subtree_com
    )
    pull = np.zeros((model.ntendon, model.nu))
    for k in range(model.nu):
        if model.actuator_trntype[k] == int(mujoco.mjtTrn.mjTRN_TENDON):
            pull[model.actuator_trnid[k, 0], k] = -model.actuator_gear[k, 0]
    return _Compiled(model, data, views, tree, paths, pull)


def _lengths_at_rest(model: mujoco.MjModel) -> np.ndarray:
    """Return the lengths (nu,) of actuators in the model's reference pose."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.actuator_length.copy()


def _width(now: _Compiled) -> int:
    return sum(array.size for array in (*now.views.shown, *now.views.rates))


def _laws(now: _Compiled, body: ModelBody, route: Route) -> Laws:
    """Return the laws that effects put between the steps."""
    rub, model, n = route.rubbing, now.model, len(body.joints)
    each = [np.array(x, float) if x else np.zeros(n) for x in (rub.torque, rub.breakaway, rub.load, rub.viscous)]
    joints = np.array(body.joints, np.int64)
    gears = geared(model)[joints]
    each[2] = each[2] * gears.any(axis=1)
    rubs = np.flatnonzero(each[0] + each[1] + each[2] > 0.0)
    dof = model.jnt_dofadr[joints].astype(np.int64)
    model.dof_damping[dof] = body.model.dof_damping[dof] + each[3]
    torque, breakaway, load = (x[rubs] for x in each[:3])
    law = JointLaws(dof[rubs], torque, breakaway, load, gears[rubs], float(rub.stribeck), float(rub.presliding))
    mu = route.mu * np.ones(model.ntendon) * (route.mu_shares or 1.0)
    return Laws(law, mu, float(route.presliding), now.tree, now.paths, now.pull, line_lag(model))


def _memory(now: _Compiled, laws: Laws) -> Memory:
    """Return the laws' memory of a body at its start: nothing slips, no bristle is bent."""
    points = 2 * int(now.model.tendon_num.max(initial=0)) + 2
    each, room = (
        (now.model.ntendon, points),
        (np.empty(points, np.int64), np.empty((points, 3)), np.empty(points), np.empty(points)),
    )
    slip = Slip(np.zeros(each), np.zeros(each), *room)
    heard = np.full((2, now.model.nu), np.nan)
    return Memory(np.zeros(len(laws.joints.dof)), slip, np.zeros(1, bool), heard=heard, **_at_rest(now.model))


def _stand(now: _Compiled, body: ModelBody, joints: JointLaws, z: np.ndarray, start: Start) -> None:
    """Put a body at rest where its joints were seen; those that rub hold what is out of balance there, as far as they can.

    A joint that is d off where it was let go moves by d^2 / (d^2 + doubt^2) of that, and slip states by the largest such share.
    """
    model, data, share = now.model, now.data, 0.0
    for joint in body.joints:
        if joint < len(start.seen) and np.isfinite(start.seen[joint]):
            off = start.seen[joint] - data.qpos[model.jnt_qposadr[joint]]
            believed = off * off / (off * off + start.doubt[joint] ** 2)
            data.qpos[model.jnt_qposadr[joint]] += believed * off
            share = max(share, believed)
    data.qvel[:] *= 1.0 - share
    mujoco.mj_forward(model, data)
    most = joints.torque + joints.breakaway + joints.load * np.abs(joints.gears @ data.actuator_force)
    held = data.qfrc_smooth[joints.dof] + data.qfrc_constraint[joints.dof]
    z += share * (np.clip(held / np.maximum(most, 1e-12), -1.0, 1.0) - z)


def _at_rest(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Return what is remembered of a step before where there is none."""
    late = np.vstack([np.zeros((3, model.nu)), np.full((1, model.nu), np.nan)])
    return {"raised": np.zeros(model.nv), "rate": np.zeros(model.nv), "late": late, "moving": np.zeros(1, bool)}


def _grid(time: np.ndarray, longest: float) -> tuple[np.ndarray, float, np.ndarray | None]:
    """Return the steps' times, their length (s), and the row of each step, -1 for none.

    Rows at equal intervals fall on steps; others are interpolated between steps, which the None for rows says.
    """
    gap = np.diff(time)
    typical = float(np.median(gap)) if gap.size else longest
    parts = max(1, int(np.ceil(typical / longest - 1e-9)))
    h = typical / parts
    if not gap.size or np.abs(gap - typical).max() < 1e-6:
        rows = np.full((len(time) - 1) * parts + 1, -1, np.int64)
        rows[::parts] = np.arange(len(time))
        return time[0] + h * np.arange(len(rows)), h, rows
    n = int(np.ceil((time[-1] - time[0]) / h)) + 1
    return time[0] + h * np.arange(n), h, None


def longest_step(body: ModelBody, route: Route) -> float:
    """Return the bound of the steps (s) of a body with the friction and the bumpers of a route."""
    rub, bumps = route.rubbing, route.bumpers.give > 0.0
    return body.longest_step * (RUBBING_STEPS if bumps or any((*rub.torque, *rub.breakaway, *rub.load)) else 1.0)
