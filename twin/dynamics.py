"""Dynamic prediction: MuJoCo steps with the tension laws computed between them, in one compiled loop.

Per step: slip states from the tendons' travel, segment tensions to `ctrl`; tip force, push and what the hinges' springs lack of
the true elastic moment (elastic.py) to `qfrc_applied`; `mj_step`. Tendons that motors or SMA springs hold at lengths are in
winding.py. The slip state is explicit here: it is stable while the pre-sliding length in mm is at least half the step in ms, so
the step shrinks with a short pre-sliding length. `discrete` integrates springs, those of hinges and wall, implicitly, so that none
of them bounds the step; it damps: 2 % of critical at 1 ms on the first mode.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from twin.body import DIRECT, NOT_FOUND, Problem
from twin.compiled import assign, dot, inner, jit
from twin.effects import Drive, Loads
from twin.engine import mj_step
from twin.equilibrium import ChainPath, Equilibrium
from twin.equilibrium.chain import State, laid, lay, lever, pass_on, shorter
from twin.equilibrium.elastic import COUPLING, bendings, springs
from twin.equilibrium.holder import linearise
from twin.equilibrium.newton import place
from twin.equilibrium.trial import Slow, rested, some
from twin.equilibrium.trial import creep as advance_creep
from twin.errors import SolveError
from twin.hinges import HingeChain, hinge_pairs
from twin.winding import hang, heat, let_go, press, pulled, winding

STEP_PER_PRESLIDING = 2.0  # s/m
# m, from a wall to a post before it, to which slack springs of that length tie the disks: the sphere they cannot leave is flat to
# x^2 / (2 FAR) = 1e-7 m at a robot's length, and lengths keep 1e-11 m of their 16 digits.
FAR = 1e5
FASTEST = 1e5  # rad/s: a hinge that turns sixteen times in a step of a millisecond is lost, long before its numbers overflow
REFRESH = 2  # steps between evaluations of the applied forces, which change by per cents a step


class Motion(NamedTuple):
    """MuJoCo's own arrays that the loop reads and writes between steps, and what drives it."""

    now: float  # s, the time MuJoCo's state is at
    step: float  # s
    velocity: np.ndarray  # (nv,)
    ctrl: np.ndarray
    applied: np.ndarray  # (nv,)
    motor: np.ndarray  # (n_tendon, n_piece) actuators
    fixed: np.ndarray  # (nv,) rest shape without creep
    time: np.ndarray  # (n,) s
    command: np.ndarray  # (n, n_tendon) N, m or A
    ambient: np.ndarray  # (n,) K, around SMA springs


class Seen(NamedTuple):
    """The motion at the samples."""

    markers: np.ndarray  # (n, n_marker, 3) m
    path: np.ndarray  # (n, n_tendon) m
    tension: np.ndarray  # (n, n_tendon) N
    temperature: np.ndarray  # (n, n_tendon) K
    q: np.ndarray  # (n, nv)


@jit
def route_tension(at, state, motion, winding):
    """Segment tensions to ctrl for the state's base tensions, those of held tendons found, at the present geometry; its slip
    advances. What a held tendon's own spring pulls is not the motors'."""
    nt, most = motion.motor.shape
    room, now = laid(most), np.zeros(most)
    for t in range(nt):
        tendon, by_spring = shorter(room, at.chain.pieces[t]), 0.0
        lay(at.chain, t, tendon, now)
        if winding.held.which[t]:
            state.T[t] = by_spring = pulled(winding, t, now[0])
            now[0] += winding.bowing[t]
        pass_on(state.T[t], at.law, tendon, state.z[t], state.s[t], now, state.z[t])
        for d in range(tendon.T.size):
            state.s[t, d] = now[d]
            motion.ctrl[motion.motor[t, d]] = tendon.T[d] - by_spring


@inner
def take(at, state, winding):
    """The held tendons' tensions at the present geometry."""
    room, distal = laid(state.s.shape[1]), np.empty(state.s.shape[1])
    for t in range(state.T.size):
        if winding.held.which[t]:
            lay(at.chain, t, shorter(room, at.chain.pieces[t]), distal)
            state.T[t] = pulled(winding, t, distal[0])


@inner
def hold(state, motion, winding, i, w):
    """The held tendons' springs for a step that ends the share w of the way from sample i - 1 to i."""
    command, held = motion.command, winding.held
    press(winding, state.T)
    for t in range(state.T.size):
        if held.by_spring[t]:
            heat(winding, state, t, command[i - 1, t], motion.ambient[i - 1], motion.step)
        elif held.which[t]:
            held.free[t] = held.straight[t] - (1.0 - w) * command[i - 1, t] - w * command[i, t]
    linearise(held, state.s, state.T)
    for t in range(state.T.size):
        if held.which[t]:
            let_go(winding, state, t)


@jit
def apply(at, state, motion, bowing, r):
    """To qfrc_applied: the tip's force, the push, and what the hinges' springs lack of the true elastic moment."""
    chain, fixed, tip = at.chain, motion.fixed, at.chain.disk[-1]
    springs(chain.qpos, at.rest, chain, state.T, bowing, r, np.empty((0, 0)))
    for k in range(r.size):
        p = chain.partner[k]
        native = chain.stiffness[k] * (chain.qpos[k] - at.rest[k]) + chain.coupling[k] * (
            chain.qpos[k] - chain.qpos[p] - fixed[k] + fixed[p]
        )
        motion.applied[k] = native - r[k] + dot(at.load.force, lever(chain, k, chain.site[tip]))
    for k in range(chain.below[at.load.pushed]):
        motion.applied[k] += dot(at.load.push, lever(chain, k, chain.site[chain.disk[at.load.pushed]]))


@jit
def look(at, state, motion, winding, i, seen):
    """What is seen at sample i, the motion carried on straight for the rest of a step."""
    chain, most, held = at.chain, motion.motor.shape[1], winding.held
    room, distal, bowing, r = laid(most), np.empty(most), np.empty(state.T.size), np.empty(state.q.size)
    T = seen.tension[i]
    for k in range(chain.marker.size):
        for a in range(3):
            seen.markers[i, k, a] = chain.site[chain.marker[k], a]
    for t in range(state.T.size):
        T[t] = state.T[t] if held.which[t] else motion.command[i, t]
        seen.temperature[i, t] = held.temperature[t]
    springs(chain.qpos, at.rest, chain, T, bowing, r, np.empty((0, 0)))
    for t in range(state.T.size):
        lay(chain, t, shorter(room, chain.pieces[t]), distal)
        seen.path[i, t] = distal[0] + bowing[t]
    assign(seen.q[i], chain.qpos)


@jit
def step_through(at, motion, winding, slow, state, seen):
    """Step on through the samples, commands linear between them but for currents, which are constant. `at.rest` are MuJoCo's rest
    angles, which creep moves.

    Returns how many samples were seen, the time reached, and the joint that ran away in the last step, or -1.
    """
    chain, time, command, step, holds = at.chain, motion.time, motion.command, motion.step, some(winding.held.which)
    now, r, taken = motion.now, np.zeros(state.q.size), 0
    D = np.empty((chain.hand.size, 3, 3))
    for i in range(time.size):
        while i > 0 and now + step <= time[i]:
            w = (now + step - time[i - 1]) / (time[i] - time[i - 1])
            for t in range(state.T.size):
                if not winding.held.which[t]:
                    state.T[t] = (1.0 - w) * command[i - 1, t] + w * command[i, t]
            if holds:
                place(at, chain.qpos)
            route_tension(at, state, motion, winding)
            if taken % REFRESH == 0:
                apply(at, state, motion, winding.bowing, r)
            if holds:
                hold(state, motion, winding, i, w)
            taken += 1
            mj_step(at.model, at.data)
            now += step
            for k in range(r.size):
                if not abs(motion.velocity[k]) < FASTEST:
                    return i, now, k
        assign(state.q, chain.qpos)
        if holds:
            place(at, state.q)
            take(at, state, winding)
        place(at, state.q + (time[i] - now) * motion.velocity)
        look(at, state, motion, winding, i, seen)
        place(at, state.q)
        if slow.amplitude.size and i > 0:
            bendings(state.q, chain, r, D)
            for k in range(r.size):
                r[k] -= at.rest[k]
            advance_creep(slow, r, time[i] - time[i - 1])
            rested(motion.fixed, slow.delayed, at.rest)
    return time.size, now, -1


class Moving:
    """A body in motion under given loads: what MuJoCo, the slip of its tendons and its creep carry from one call to the next."""

    def __init__(self, dynamics: Dynamics, problem: Problem) -> None:
        """At rest in equilibrium under the problem's first commands. The body's stiffness counts with its mean: temperature changes
        little in a fast trial. Raises SolveError where there is no such equilibrium, and for a round post."""
        loads, route = problem.loads, problem.route
        if loads.wall[4] > 0.0 and loads.wall[9] > 0.0:
            raise SolveError("motion against a round post is not stepped here; use static equilibria, or a contact of curvature 0")
        scale = 1.0 if problem.stiffness is None else float(np.mean(problem.stiffness))
        amplitude = np.array(problem.creep.amplitude, float)
        delayed = np.zeros((amplitude.size, dynamics.n_slow)) if problem.delayed is None else problem.delayed
        first = replace(
            problem, time=problem.time[:1], command=problem.command[:1], stiffness=np.array([scale]), delayed=delayed, near=None
        )
        self.start = start = dynamics.statics.solve(first)
        self.drives = problem.drives or (Drive.TENSION,) * problem.command.shape[1]
        if not start.status.all():
            raise SolveError(f"no equilibrium to start from under {self._shown(problem.command[0])}")
        body = _loaded(dynamics.body, loads, scale)
        self._pulled = problem.which(Drive.TENSION)
        hang(body.spec, body, ~self._pulled)
        moving = Equilibrium(body)
        self.model, self.data = model, data = moving.model, moving.data
        step = min(model.opt.timestep, STEP_PER_PRESLIDING * route.presliding) if route.mu > 0.0 else model.opt.timestep
        model.opt.timestep = step
        model.opt.gravity[:] = loads.gravity
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a state that is lost must be seen as such
        fixed = model.qpos_spring.copy()
        model.qpos_spring[:] = fixed + delayed.sum(axis=0)
        data.qpos[:] = start.q[0]
        mujoco.mj_forward(model, data)
        springs = None if problem.heating is None else problem.heating.spring
        self._winding = winding(problem, moving, start, dynamics.statics.zero_path(route, problem.which(Drive.CURRENT), springs))
        motor, self._began = np.zeros(start.slip.shape, np.int64), float(problem.time[0])
        for t, d in ((t, d) for t, n in enumerate(moving.chain.pieces) for d in range(n)):
            motor[t, d] = model.actuator(f"tendon_{t + 1}_segment_{d + 1}").id
        nt = problem.command.shape[1]
        self._motion = Motion(
            self._began,
            float(step),
            data.qvel,
            data.ctrl,
            data.qfrc_applied,
            motor,
            fixed,
            np.zeros(0),
            np.zeros((0, nt)),
            np.zeros(0),
        )
        self.state = State(start.tension[0].copy(), start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self._slow = Slow(amplitude, np.array(problem.creep.time, float), delayed)
        self._at, self._n_marker = moving.statics(problem)._replace(rest=model.qpos_spring), moving.chain.marker.size

    def run(self, time: np.ndarray, command: np.ndarray, ambient: np.ndarray | None = None) -> tuple[Seen, int, str]:
        """On through times (n,) s under commands (n, n_tendon), N and m linear in between, from where it stands at the first; A in
        surroundings at `ambient` (n,) K are constant from one to the next.

        Returns what was seen, at how many samples, and why no further, in words.
        """
        n, nt = command.shape
        tension, path, temperature = np.full((3, n, nt), np.nan)
        seen = Seen(np.full((n, self._n_marker, 3), np.nan), path, tension, temperature, np.full((n, self.model.nv), np.nan))
        command = np.ascontiguousarray(np.where(self._pulled, np.maximum(command, 0.0), command))
        motion = self._motion._replace(
            time=np.array(time, float), command=command, ambient=np.zeros(n) if ambient is None else np.array(ambient, float)
        )
        samples, now, lost = step_through(self._at, motion, self._winding, self._slow, self.state, seen)
        self._motion = self._motion._replace(now=now)
        return seen, samples, "" if lost < 0 else self._lost(now, lost)

    def _shown(self, command: np.ndarray) -> str:
        shown = (d.shown for d in self.drives)
        return ", ".join(f"{factor * c:.3g} {unit}" for c, (unit, factor) in zip(command, shown, strict=True))

    def _lost(self, now: float, k: int) -> str:
        """What became of joint k in the last step."""
        speed, at, step = float(self.data.qvel[k]), float(self.data.qpos[k]), self._motion.step
        pull = ", ".join(f"{T:.4g}" for T in self.state.T)
        what = f"turns at {speed:.2g} rad/s" if np.isfinite(speed) else "has no finite speed"
        return (
            f"the motion is lost at step {round((now - self._began) / step)} (t = {now:.4g} s, step {1e3 * step:g} ms): joint "
            f"{self.model.joint(k).name} {what}, at {at:.3g} rad, under tensions {pull} N; smoother or smaller tensions, or a "
            "shorter step, may keep it"
        )


class Dynamics:
    """A compiled chain ready to be stepped."""

    def __init__(self, body: HingeChain) -> None:
        self.statics = Equilibrium(body)
        self.model, self.straight_path, self.body = self.statics.model, self.statics.straight_path, body

    @property
    def n_slow(self) -> int:
        return self.statics.n_slow

    def solve(self, problem: Problem) -> ChainPath:
        """The motion under commands, from rest in equilibrium under the first ones.

        A motion has no neighbour to start from: `near`, `keep`, `once` and `tolerance` are of statics only. Where the motion is
        lost `ended` says how; samples from there on are NaN.
        """
        moving = Moving(self, problem)
        seen, samples, ended = moving.run(
            problem.time, problem.command, None if problem.heating is None else problem.heating.ambient
        )
        status = np.where(np.arange(len(problem.time)) < samples, DIRECT, NOT_FOUND)
        return ChainPath(
            tension=seen.tension, path=seen.path, markers=seen.markers, status=status, q=seen.q, ended=ended,
            others={"temperature": seen.temperature}, started=moving.start.started, slip=moving.state.z, distal=moving.state.s,
        )  # fmt: skip


def _loaded(body: HingeChain, loads: Loads, scale: float) -> HingeChain:
    """A copy of the body, `scale` times as stiff, with a point mass at its tip and, as tendons, the coupling springs of elastic.py
    and the wall."""
    spec = body.spec.copy()
    for joint in spec.joints:
        joint.stiffness = scale * joint.stiffness
    for one, other in hinge_pairs(body) if body.bows else ():
        stiffness = 0.5 * COUPLING * (spec.joint(one).stiffness[0] + spec.joint(other).stiffness[0])
        spring = spec.add_tendon(name=f"{one}-{other}")
        spring.stiffness = [stiffness, 0, 0]
        spring.wrap_joint(one, 1.0)
        spring.wrap_joint(other, -1.0)
    normal, offset, stiffness = loads.wall[:3], loads.wall[3], loads.wall[4]
    if stiffness > 0.0:
        spec.worldbody.add_site(name="post", pos=(offset + FAR) * normal)
        for disk in body.disks:
            wall = spec.add_tendon(name=f"wall-{disk}")
            wall.stiffness, wall.springlength = [stiffness, 0, 0], [0.0, FAR]
            wall.wrap_site("post")
            wall.wrap_site(disk)
    if loads.payload > 0.0:
        site = spec.site(body.tip)
        mass = site.parent.add_body(name="payload", pos=site.pos, mass=loads.payload, inertia=[1e-9, 1e-9, 1e-9])
        mass.ipos, mass.explicitinertial = [0, 0, 0], True
    return replace(body, spec=spec)
