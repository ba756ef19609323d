"""Dynamic prediction: MuJoCo steps with the tension laws computed between them, in one compiled loop.

Per step: slip states from the tendons' travel, segment tensions to `ctrl`; tip force and what the hinges' springs lack of the true
elastic moment (elastic.py) to `qfrc_applied`; `mj_step`. The slip state is explicit here: it is stable while the pre-sliding length
in mm is at least half the step in ms, so the step shrinks with a short pre-sliding length. `discrete` integrates springs, those of
hinges and wall, implicitly, so that none of them bounds the step; it damps: 2 % of critical at 1 ms on the first mode.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from twin.compiled import assign, dot, jit
from twin.effects import Creep, Loads, Route
from twin.equilibrium import DIRECT, Equilibrium, Path
from twin.equilibrium.chain import Law, lay, lever, pass_on
from twin.equilibrium.elastic import COUPLING, bendings, springs
from twin.equilibrium.engine import mj_step
from twin.equilibrium.newton import place
from twin.equilibrium.trial import creep as advance_creep
from twin.equilibrium.trial import rested
from twin.robots import Body, hinge_pairs

STEP_PER_PRESLIDING = 2.0  # s/m
# m, from a wall to a post before it, to which slack springs of that length tie the disks: the sphere they cannot leave is flat to
# x^2 / (2 FAR) = 1e-7 m at a robot's length, and lengths keep 1e-11 m of their 16 digits.
FAR = 1e5
REFRESH = 2  # steps between evaluations of the applied forces, which change by per cents a step


@jit
def route_tension(chain, tension, law, z, s, ctrl, motor):
    """Segment tensions to ctrl for base tensions (n_tendon,) at the present geometry; slip states z, s advance."""
    nt, nd = motor.shape
    u, length, theta, T, now = np.empty((nd, 3)), np.empty(nd), np.empty(nd), np.empty(nd), np.empty(nd)
    for t in range(nt):
        lay(chain, t, u, length, theta, now)
        pass_on(tension[t], law, theta, z[t], s[t], now, z[t], T)
        assign(s[t], now)
        for d in range(nd):
            ctrl[motor[t, d]] = T[d]


@jit
def step_through(
    model, data, chain, step, law, force, amplitude, retardation, delayed, fixed, spring, velocity, ctrl, applied, motor, z, s,
    time, tension, marker, path, q_out,
):  # fmt: skip
    """Step from time[0], tensions linear between samples; markers (n, n_marker, 3) and path (n, n_tendon) at the samples."""
    n, nv = time.size, velocity.size
    now, T, r, q = time[0], np.empty(tension.shape[1]), np.zeros(nv), np.empty(nv)
    tip, taken = chain.disk[-1], 0
    none, K, D = np.empty((0, 0)), chain.stiffness, np.empty((chain.hand.size, 3, 3))
    nd = motor.shape[1]
    u, length, theta, distal = np.empty((nd, 3)), np.empty(nd), np.empty(nd), np.empty(nd)
    for i in range(n):
        while i > 0 and now + step <= time[i]:
            w = (now + step - time[i - 1]) / (time[i] - time[i - 1])
            for t in range(T.size):
                T[t] = (1.0 - w) * tension[i - 1, t] + w * tension[i, t]
            route_tension(chain, T, law, z, s, ctrl, motor)
            if taken % REFRESH == 0:
                pressure = T.sum()
                springs(chain.qpos, spring, chain, pressure, r, none)
                for k in range(nv):
                    p = chain.partner[k]
                    native = K[k] * (chain.qpos[k] - spring[k]) + chain.coupling[k] * (
                        chain.qpos[k] - chain.qpos[p] - fixed[k] + fixed[p]
                    )
                    applied[k] = native - r[k] + dot(force, lever(chain, k, chain.site[tip]))
            taken += 1
            mj_step(model, data)
            now += step
        q[:] = chain.qpos
        place(model, data, chain, q + (time[i] - now) * velocity)
        for k in range(chain.marker.size):
            marker[i, k] = chain.site[chain.marker[k]]
        bowing = springs(chain.qpos, spring, chain, tension[i].sum(), r, none)
        for t in range(T.size):
            lay(chain, t, u, length, theta, distal)
            path[i, t] = distal[0] + bowing
        q_out[i] = chain.qpos
        place(model, data, chain, q)
        if amplitude.size and i > 0:
            bendings(q, chain, r, D)
            for k in range(nv):
                r[k] -= spring[k]
            advance_creep(delayed, r, amplitude, retardation, time[i] - time[i - 1])
            rested(fixed, delayed, spring)


class Dynamics:
    """A compiled robot ready to be stepped, with the calling convention of `Equilibrium`."""

    def __init__(self, body: Body) -> None:
        self.statics = Equilibrium(body)
        self.model, self.straight_path, self._body = self.statics.model, self.statics.straight_path, body

    def solve(
        self, time: np.ndarray, tension: np.ndarray, loads: Loads, route: Route, creep: Creep, delayed: np.ndarray,
        near: Path | None = None, keep: bool = False, tolerance: float = 0.0, by_length: np.ndarray | None = None,
        stiffness: np.ndarray | None = None, once: bool = False,
    ) -> Path:  # fmt: skip
        """The motion under base tensions (n, n_tendon) N at times (n,) s, from rest in equilibrium under the first ones.

        `near`, `keep`, `tolerance`, `by_length` and `once` are of the static solve only: a motion has no neighbour to start from.
        The body's `stiffness` (n,) counts with its mean: temperature changes little in a fast trial.
        """
        scale = 1.0 if stiffness is None else float(np.mean(stiffness))
        start = self.statics.solve(time[:1], tension[:1], loads, route, creep, delayed, stiffness=np.array([scale]))
        moving = Equilibrium(_loaded(self._body, loads, scale))
        model, data = moving.model, moving.data
        step = min(model.opt.timestep, STEP_PER_PRESLIDING * route.presliding) if route.mu > 0.0 else model.opt.timestep
        model.opt.timestep = step
        model.opt.gravity[:] = loads.gravity
        amplitude, retardation = np.array(creep.amplitude, float), np.array(creep.time, float)
        fixed = model.qpos_spring.copy()
        model.qpos_spring[:] = fixed + delayed.sum(axis=0)
        data.qpos[:] = start.q[0]
        mujoco.mj_forward(model, data)
        n, (nt, nd) = len(time), start.slip.shape
        motor = np.array([[model.actuator(f"tendon_{t}_segment_{d}").id for d in range(1, nd + 1)] for t in range(1, nt + 1)])
        marker, path, q = np.empty((n, moving.chain.marker.size, 3)), np.empty((n, nt)), np.empty((n, model.nv))
        slip, distal = start.slip.copy(), start.distal.copy()
        law = Law(float(route.mu), float(route.presliding), np.array(loads.wall, float))
        step_through(
            model._address, data._address, moving.chain, float(step), law, np.array(loads.force, float), amplitude, retardation,
            delayed, fixed, model.qpos_spring, data.qvel, data.ctrl, data.qfrc_applied, motor, slip, distal,
            np.array(time, float), np.maximum(tension, 0.0, order="C"), marker, path, q,
        )  # fmt: skip
        finite = np.isfinite(marker).all(axis=(1, 2))
        no_springs, status = np.full((n, nt), np.nan), np.where(finite, DIRECT, 0)
        return Path(np.array(tension), marker, path, q, no_springs, status, start.started, slip, distal, start.LU)


def _loaded(body: Body, loads: Loads, scale: float) -> Body:
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
