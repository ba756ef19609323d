"""Dynamic prediction: MuJoCo steps with the tendons' tensions computed between them, in one compiled loop.

Per step: slip states from the tendons' travel, segment tensions to `ctrl`; tip force, push and the difference of the hinges'
springs from the true elastic moment (elastic.py) to `qfrc_applied`; then `mj_step`. Tendons that motors or SMA springs hold at
lengths are in held_tendons.py.

Neither friction, however short its pre-sliding length (sticking.py), nor the springs of hinges and wall, which MuJoCo's implicit
integration takes, bound the step. That integration adds damping: 2 % of critical at 1 ms on the first mode.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Drive, Loads, Problem
from twin.body.hinge_chain import HingeChain, hinge_pairs
from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import assign, dot, jit, jit_internal
from twin.foundation.errors import SolveError
from twin.mechanics.mujoco_symbols import mj_step
from twin.mechanics.rod import ChainSolution, Equilibrium
from twin.mechanics.rod.balance.chain import (
    ChainState,
    apply_friction,
    empty_tendon_path,
    first_pieces,
    point_velocity,
    trace_tendon,
)
from twin.mechanics.rod.balance.elastic import SET_COUPLING, elastic_forces, rotation_vectors
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.mechanics.rod.balance.tendon_actuation import linearise_tendons
from twin.mechanics.rod.held_tendons import (
    add_held_tendons,
    heat_spring,
    held_tension,
    hold_tendons,
    set_slack_band,
    update_total_tension,
)
from twin.mechanics.rod.sticking import damp_sticking
from twin.mechanics.rod.trial_steps import CreepState, advance_creep, any_true, set_rest_shape

# m, from a wall to a distant site in front of it, to which slack springs of that length tie the disks. The sphere that they cannot
# leave is flat to x^2 / (2 POST_DISTANCE) = 1e-7 m at a robot's length, and lengths are still resolved to 1e-11 m.
POST_DISTANCE = 1e5
PAYLOAD_BODY, WALL_POST = "payload", "post"
FASTEST_HINGE = 1e5  # rad/s, sixteen turns in a step of a millisecond; beyond it the motion counts as lost
FORCE_UPDATE_STEPS = 2  # steps between evaluations of the applied forces, which change by a few per cent a step


@by_reference
class Motion(NamedTuple):
    """MuJoCo's arrays that the loop reads and writes between steps, and the inputs."""

    reached: float  # s, the time MuJoCo's state is at
    taken: int  # steps so far
    step: float  # s
    velocity: np.ndarray  # (nv,)
    ctrl: np.ndarray
    applied: np.ndarray  # (nv,)
    damping: np.ndarray  # (nv,) of the joints, that of sticking tendons included
    own: np.ndarray  # (nv,) the same without
    forces: np.ndarray  # (nv,) applied, without what makes up for that damping
    actuator: np.ndarray  # (n_tendon, n_piece) actuators
    rest: np.ndarray  # (nv,) rest shape without creep
    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) N, m or A
    ambient: np.ndarray  # (n,) K, around SMA springs


@by_reference
class MotionSamples(NamedTuple):
    """The motion at the samples."""

    markers: np.ndarray  # (n, n_marker, 3) m
    path: np.ndarray  # (n, n_tendon) m
    tension: np.ndarray  # (n, n_tendon) N
    temperature: np.ndarray  # (n, n_tendon) K
    q: np.ndarray  # (n, nv)


@jit
def route_tension(system, state, motion, tendons):
    """Set `ctrl` to the segments' tensions at the present geometry, and advance the slip.

    Tensions of held tendons are computed first; their own MuJoCo spring's pull is subtracted from the motors'.
    """
    nt, longest = motion.actuator.shape
    longest_path, distal, rubs = empty_tendon_path(longest), np.zeros(longest), system.law.mu > 0.0
    if rubs:
        assign(motion.damping, motion.own)
    for t in range(nt):
        tendon, by_spring = first_pieces(longest_path, system.chain.n_piece[t]), 0.0
        trace_tendon(system.chain, t, tendon, distal)
        if tendons.actuation.held[t]:
            state.T[t] = by_spring = held_tension(tendons, t, distal[0])
            distal[0] += tendons.bowing[t]
        apply_friction(state.T[t], system.law, tendon, state.z[t], state.s[t], distal, state.z[t])
        if rubs:
            damp_sticking(system, state, motion, tendon, t, distal)
        for d in range(tendon.T.size):
            state.s[t, d] = distal[d]
            motion.ctrl[motion.actuator[t, d]] = tendon.T[d] - by_spring


@jit_internal
def update_held_tensions(system, state, tendons):
    """Set the tensions of held tendons at the present geometry."""
    longest_path, distal = empty_tendon_path(state.s.shape[1]), np.empty(state.s.shape[1])
    for t in range(state.T.size):
        if tendons.actuation.held[t]:
            trace_tendon(system.chain, t, first_pieces(longest_path, system.chain.n_piece[t]), distal)
            state.T[t] = held_tension(tendons, t, distal[0])


@jit_internal
def set_held_springs(state, motion, tendons, i, w):
    """Set the held tendons' springs for a step that ends a share w between samples i - 1 and i."""
    command, actuation = motion.command, tendons.actuation
    update_total_tension(tendons, state.T)
    for t in range(state.T.size):
        if actuation.by_spring[t]:
            heat_spring(tendons, state, t, command[i - 1, t], motion.ambient[i - 1], motion.step)
        elif actuation.held[t]:
            actuation.free_length[t] = actuation.straight_path[t] - (1.0 - w) * command[i - 1, t] - w * command[i, t]
    linearise_tendons(actuation, state.s, state.T)
    for t in range(state.T.size):
        if actuation.held[t]:
            set_slack_band(tendons, state, t)


@jit
def apply_forces(system, state, motion, bowing, r):
    """Set `qfrc_applied` to tip force, push and the hinge springs' difference from the true elastic moment."""
    chain, rest, tip = system.chain, motion.rest, system.chain.disk[-1]
    elastic_forces(chain.qpos, system.rest, chain, state.T, bowing, r, np.empty((0, 0)))
    for k in range(r.size):
        p = chain.partner[k]
        native = chain.stiffness[k] * (chain.qpos[k] - system.rest[k]) + chain.coupling[k] * (
            chain.qpos[k] - chain.qpos[p] - rest[k] + rest[p]
        )
        motion.applied[k] = native - r[k] + dot(system.load.force, point_velocity(chain, k, chain.site[tip]))
    for k in range(chain.disk_joints[system.load.pushed]):
        motion.applied[k] += dot(system.load.push, point_velocity(chain, k, chain.site[chain.disk[system.load.pushed]]))


@jit
def record_motion(system, state, motion, tendons, i, samples):
    """Record sample i, the motion extrapolated for the rest of a step."""
    chain, longest, actuation = system.chain, motion.actuator.shape[1], tendons.actuation
    longest_path, distal, bowing, r = empty_tendon_path(longest), np.empty(longest), np.empty(state.T.size), np.empty(state.q.size)
    T = samples.tension[i]
    for k in range(chain.marker.size):
        for a in range(3):
            samples.markers[i, k, a] = chain.site[chain.marker[k], a]
    for t in range(state.T.size):
        T[t] = state.T[t] if actuation.held[t] else motion.command[i, t]
        samples.temperature[i, t] = actuation.temperature[t]
    elastic_forces(chain.qpos, system.rest, chain, T, bowing, r, np.empty((0, 0)))
    for t in range(state.T.size):
        trace_tendon(chain, t, first_pieces(longest_path, chain.n_piece[t]), distal)
        samples.path[i, t] = distal[0] + bowing[t]
    assign(samples.q[i], chain.qpos)


@jit
def step_through(system, motion, tendons, creep, state, samples):
    """Step through the samples. Commands are linear between samples, currents constant. Creep moves MuJoCo's rest angles,
    `system.rest`.

    Returns the number of samples recorded, the time reached, the steps taken so far, and the joint that diverged in the last
    step, or -1.
    """
    chain, time, command, step, holds = system.chain, motion.time, motion.command, motion.step, any_true(tendons.actuation.held)
    rubs, forces = system.law.mu > 0.0, motion.forces
    now, r, taken = motion.reached, np.zeros(state.q.size), motion.taken
    D = np.empty((chain.handedness.size, 3, 3))
    for i in range(time.size):
        while i > 0 and now + step <= time[i]:
            w = (now + step - time[i - 1]) / (time[i] - time[i - 1])
            for t in range(state.T.size):
                if not tendons.actuation.held[t]:
                    state.T[t] = (1.0 - w) * command[i - 1, t] + w * command[i, t]
            if holds or rubs:
                update_kinematics(system, chain.qpos)
            route_tension(system, state, motion, tendons)
            if taken % FORCE_UPDATE_STEPS == 0:
                apply_forces(system, state, motion, tendons.bowing, r)
                assign(forces, motion.applied)
            if rubs:
                for k in range(r.size):
                    motion.applied[k] = forces[k] + (motion.damping[k] - motion.own[k]) * motion.velocity[k]
            if holds:
                set_held_springs(state, motion, tendons, i, w)
            taken += 1
            mj_step(system.model, system.data)
            now += step
            for k in range(r.size):
                if not abs(motion.velocity[k]) < FASTEST_HINGE:
                    return i, now, taken, k
        assign(state.q, chain.qpos)
        if holds:
            update_kinematics(system, state.q)
            update_held_tensions(system, state, tendons)
        update_kinematics(system, state.q + (time[i] - now) * motion.velocity)
        record_motion(system, state, motion, tendons, i, samples)
        update_kinematics(system, state.q)
        if creep.amplitude.size and i > 0:
            rotation_vectors(state.q, chain, r, D)
            for k in range(r.size):
                r[k] -= system.rest[k]
            advance_creep(creep, r, time[i] - time[i - 1])
            set_rest_shape(motion.rest, creep.delayed, system.rest)
    return time.size, now, taken, -1


class ChainMotion:
    """A chain in motion under given loads, with MuJoCo's state, slip of tendons and creep kept from one call to the next."""

    def __init__(self, dynamics: Dynamics, problem: Problem) -> None:
        """Start at rest in equilibrium under the problem's first commands. Stiffness counts with its mean over the trial.

        Raises SolveError where there is no such equilibrium, and for a round post.
        """
        loads, route = problem.loads, problem.route
        if loads.wall[4] > 0.0 and loads.wall[9] > 0.0:
            raise SolveError("motion against a round post is not stepped here; use static equilibria, or a contact of curvature 0")
        scale = 1.0 if problem.stiffness is None else float(np.mean(problem.stiffness))
        amplitude = np.array(problem.creep.amplitude, float)
        delayed = np.zeros((amplitude.size, dynamics.n_delayed)) if problem.delayed is None else problem.delayed
        first = replace(
            problem,
            time=problem.time[:1],
            command=problem.command[:1],
            stiffness=np.array([scale]),
            delayed=delayed,
            neighbour=None,
        )
        self.start = start = dynamics.statics.solve(first)
        self.drives = problem.drives or (Drive.TENSION,) * problem.command.shape[1]
        if not start.status.all():
            raise SolveError(f"no equilibrium to start from under {self._format_command(problem.command[0])}")
        body = loaded_body(dynamics.body, loads, scale)
        self._by_tension, self._borne = problem.drive_mask(Drive.TENSION), dynamics.body.borne
        add_held_tendons(body.spec, body, ~self._by_tension)
        compiled = Equilibrium(body)
        self.model, self.data = model, data = compiled.model, compiled.data
        model.opt.gravity[:] = loads.gravity
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a diverged state must not be reset silently
        rest = model.qpos_spring.copy()
        model.qpos_spring[:] = rest + delayed.sum(axis=0)
        data.qpos[:] = start.q[0]
        mujoco.mj_forward(model, data)
        springs = None if problem.heating is None else problem.heating.spring
        self._held = hold_tendons(
            problem, compiled, start, dynamics.statics.zero_path(route, problem.drive_mask(Drive.CURRENT), springs)
        )
        actuator, self._start_time = np.zeros(start.slip.shape, np.int64), float(problem.time[0])
        for t, d in ((t, d) for t, n in enumerate(compiled.chain.n_piece) for d in range(n)):
            actuator[t, d] = model.actuator(f"tendon_{t + 1}_segment_{d + 1}").id
        nt = problem.command.shape[1]
        self._motion = Motion(
            self._start_time, 0, float(model.opt.timestep), data.qvel, data.ctrl, data.qfrc_applied, model.dof_damping,
            model.dof_damping.copy(), np.zeros(model.nv), actuator, rest, np.zeros(0), np.zeros((0, nt)), np.zeros(0),
        )  # fmt: skip
        self.state = ChainState(start.tension[0].copy(), start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self._creep = CreepState(amplitude, np.array(problem.creep.time, float), delayed)
        self._system, self._n_marker = compiled.statics(problem)._replace(rest=model.qpos_spring), compiled.chain.marker.size

    def run(self, time: np.ndarray, command: np.ndarray, ambient: np.ndarray | None = None) -> tuple[MotionSamples, int, str]:
        """Continue through times (n,) s under commands (n, n_tendon), from the present state at the first.

        N and m are linear between times; A, in surroundings at `ambient` (n,) K, are constant from one time to the next. Returns
        the samples, their number, and the reason for an early end in words, or "".
        """
        n, nt = command.shape
        tension, path, temperature = np.full((3, n, nt), np.nan)
        samples = MotionSamples(
            np.full((n, self._n_marker, 3), np.nan), path, tension, temperature, np.full((n, self.model.nv), np.nan)
        )
        command = np.ascontiguousarray(np.where(self._by_tension, self._borne(command), command))
        motion = self._motion._replace(
            time=np.array(time, float), command=command, ambient=np.zeros(n) if ambient is None else np.array(ambient, float)
        )
        n_sample, now, taken, lost = step_through(self._system, motion, self._held, self._creep, self.state, samples)
        self._motion = self._motion._replace(reached=now, taken=taken)
        return samples, n_sample, "" if lost < 0 else self._describe_loss(now, lost)

    def _format_command(self, command: np.ndarray) -> str:
        shown = (d.display_unit for d in self.drives)
        return ", ".join(f"{factor * c:.3g} {unit}" for c, (unit, factor) in zip(command, shown, strict=True))

    def _describe_loss(self, now: float, k: int) -> str:
        """Return the state of joint k in the last step, in words."""
        speed, at, step = float(self.data.qvel[k]), float(self.data.qpos[k]), self._motion.step
        pull = ", ".join(f"{T:.4g}" for T in self.state.T)
        what = f"turns at {speed:.2g} rad/s" if np.isfinite(speed) else "has no finite speed"
        return (
            f"the motion is lost at step {round((now - self._start_time) / step)} (t = {now:.4g} s, step {1e3 * step:g} ms): joint "
            f"{self.model.joint(k).name} {what}, at {at:.3g} rad, under tensions {pull} N; smoother or smaller tensions, or a "
            "shorter step, may keep it"
        )


class Dynamics:
    """A compiled chain ready to be stepped."""

    def __init__(self, body: HingeChain) -> None:
        self.statics = Equilibrium(body)
        self.model, self.straight_path, self.body = self.statics.model, self.statics.straight_path, body

    @property
    def n_delayed(self) -> int:
        """Number of delayed strains of an element of creep."""
        return self.statics.n_delayed

    def orientations(self, q: np.ndarray, sites: tuple[str, ...]) -> np.ndarray:
        """Return rotation vectors (n, n_site, 3) rad of sites at shapes q (n, nv)."""
        return self.statics.orientations(q, sites)

    def solve(self, problem: Problem) -> ChainSolution:
        """Return the motion under commands, from rest in equilibrium under the first ones.

        `neighbour`, `keep`, `once` and `tolerance` apply to statics only. Where the motion is lost `end_reason` says why; samples
        from there on are NaN.
        """
        motion = ChainMotion(self, problem)
        samples, n_sample, ended = motion.run(
            problem.time, problem.command, None if problem.heating is None else problem.heating.ambient
        )
        status = np.where(np.arange(len(problem.time)) < n_sample, DIRECT, NOT_FOUND)
        return ChainSolution(
            tension=samples.tension, path=samples.path, markers=samples.markers, status=status, q=samples.q, end_reason=ended,
            others={"temperature": samples.temperature}, start_status=motion.start.start_status,
            slip=motion.state.z, distal=motion.state.s,
        )  # fmt: skip


def pair_spring(one: str, other: str) -> str:
    """Return the name of the spring that couples two hinges."""
    return f"{one}-{other}"


def wall_spring(disk: str) -> str:
    """Return the name of the spring that a wall has for a disk's site."""
    return f"wall-{disk}"


def loaded_body(body: HingeChain, loads: Loads, scale: float) -> HingeChain:
    """Return a copy of the body with payload, wall and set coupling, `scale` times as stiff.

    The payload is a point mass at the tip; wall and coupling are MuJoCo tendons.
    """
    spec = body.spec.copy()
    for joint in spec.joints:
        joint.stiffness = scale * joint.stiffness
    for one, other in hinge_pairs(body) if body.straight_tendons else ():
        stiffness = 0.5 * SET_COUPLING * (spec.joint(one).stiffness[0] + spec.joint(other).stiffness[0])
        spring = spec.add_tendon(name=pair_spring(one, other))
        spring.stiffness = [stiffness, 0, 0]
        spring.wrap_joint(one, 1.0)
        spring.wrap_joint(other, -1.0)
    normal, offset, stiffness = loads.wall[:3], loads.wall[3], loads.wall[4]
    if stiffness > 0.0:
        spec.worldbody.add_site(name=WALL_POST, pos=(offset + POST_DISTANCE) * normal)
        for disk in body.disks:
            wall = spec.add_tendon(name=wall_spring(disk))
            wall.stiffness, wall.springlength = [stiffness, 0, 0], [0.0, POST_DISTANCE]
            wall.wrap_site(WALL_POST)
            wall.wrap_site(disk)
    if loads.payload > 0.0:
        site = spec.site(body.tip)
        mass = site.parent.add_body(name=PAYLOAD_BODY, pos=site.pos, mass=loads.payload, inertia=[1e-9, 1e-9, 1e-9])
        mass.ipos, mass.explicitinertial = [0, 0, 0], True
    return replace(body, spec=spec)
