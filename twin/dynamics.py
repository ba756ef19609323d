"""Dynamic prediction: MuJoCo steps with the tension laws computed between them, in one compiled loop.

Per step: slip states from the tendons' travel, segment tensions to `ctrl`; wall, tip force and what the hinges' springs lack of the
true elastic moment (elastic.py) to `qfrc_applied`; `mj_step`. The slip state is explicit here: it is stable while the pre-sliding
length in mm is at least half the step in ms, so the step shrinks with a short pre-sliding length. `discrete` integrates implicitly
and damps: 2 % of critical at 1 ms on the first mode.
"""

from __future__ import annotations

import mujoco
import numpy as np

from twin.compiled import dot, jit, put
from twin.effects import Creep, Loads, Route
from twin.effects.tendon_friction import slip_state, turn
from twin.equilibrium import DIRECT, Equilibrium, Path
from twin.equilibrium.chain import Law, Load, lever, wall_force
from twin.equilibrium.elastic import COUPLING, bendings, springs
from twin.equilibrium.engine import mj_step
from twin.equilibrium.newton import place
from twin.equilibrium.trial import creep as advance_creep
from twin.equilibrium.trial import rested
from twin.robots import Body, hinge_pairs

STEP_PER_PRESLIDING = 2.0  # s/m
REFRESH = 2  # steps between evaluations of the applied forces, which change by per cents a step


@jit
def route_tension(chain, tension, law, z, s, ctrl, motor):
    """Segment tensions to ctrl for base tensions (n_tendon,) at the present geometry; slip states z, s advance."""
    nt, nd = chain.hole.shape[0], chain.hole.shape[1] - 1
    u, length = np.empty((nd, 3)), np.empty(nd)
    for t in range(nt):
        for d in range(nd):
            a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
            v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
            length[d] = np.sqrt(dot(v, v))
            put(u[d], (v[0] / length[d], v[1] / length[d], v[2] / length[d]))
        distal = 0.0
        for d in range(nd - 1, -1, -1):
            distal += length[d]
            z[t, d] = slip_state(z[t, d], s[t, d] - distal, law.presliding)
            s[t, d] = distal
        wrapped = 0.0
        ctrl[motor[t, 0]] = tension[t]
        for d in range(1, nd):
            theta = np.arccos(min(1.0, dot(u[d - 1], u[d])))
            wrapped += z[t, d] * turn(theta)[0]
            ctrl[motor[t, d]] = tension[t] * np.exp(-law.mu * wrapped)


@jit
def step_through(
    model, data, chain, step, law, load, amplitude, retardation, delayed, fixed, spring, velocity, ctrl, applied, motor, z, s, time,
    tension, marker, path, q_out,
):  # fmt: skip
    """Step from time[0], tensions linear between samples; markers (n, n_marker, 3) and path (n, n_tendon) at the samples."""
    n, nv = time.size, velocity.size
    now, T, r, q = time[0], np.empty(tension.shape[1]), np.zeros(nv), np.empty(nv)
    tip, taken = chain.disk[-1], 0
    none, K, D = np.empty((0, 0)), chain.stiffness, np.empty((chain.hand.size, 3, 3))
    for i in range(n):
        while i > 0 and now + step <= time[i]:
            w = (now + step - time[i - 1]) / (time[i] - time[i - 1])
            for t in range(T.size):
                T[t] = (1.0 - w) * tension[i - 1, t] + w * tension[i, t]
            route_tension(chain, T, law, z, s, ctrl, motor)
            if taken % REFRESH == 0:
                pressure = T.sum()
                springs(chain.qpos, spring, K, chain.slender, pressure, chain.partner, chain.coupling, chain.hand, r, none)
                if law.wall[4] > 0.0:
                    wall_force(chain, law.wall, r, none)
                for k in range(nv):
                    p = chain.partner[k]
                    native = K[k] * (chain.qpos[k] - spring[k]) + chain.coupling[k] * (
                        chain.qpos[k] - chain.qpos[p] - fixed[k] + fixed[p]
                    )
                    applied[k] = native - r[k] + dot(load.force, lever(chain.axis[k], chain.site[tip], chain.anchor[k]))
            taken += 1
            mj_step(model, data)
            now += step
        q[:] = chain.qpos
        place(model, data, chain, q + (time[i] - now) * velocity)
        for k in range(chain.marker.size):
            marker[i, k] = chain.site[chain.marker[k]]
        for t in range(T.size):
            path[i, t] = 0.0
            for d in range(chain.hole.shape[1] - 1):
                v = chain.site[chain.hole[t, d + 1]] - chain.site[chain.hole[t, d]]
                path[i, t] += np.sqrt(dot(v, v))
        q_out[i] = chain.qpos
        place(model, data, chain, q)
        if amplitude.size and i > 0:
            bendings(q, chain.hand, r, D)
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
        moving = Equilibrium(_loaded(self._body, loads.payload))
        model, data = moving.model, moving.data
        for spring in (model.jnt_stiffness, model.tendon_stiffness, moving.chain.stiffness, moving.chain.coupling):
            spring *= scale
        moving.chain.slender[:] /= scale
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
        load = Load(np.array(loads.gravity, float), float(loads.payload), np.array(loads.force, float))
        step_through(
            model._address, data._address, moving.chain, float(step), law, load, amplitude, retardation, delayed,
            fixed, model.qpos_spring, data.qvel, data.ctrl, data.qfrc_applied, motor, slip, distal, np.array(time, float),
            np.maximum(tension, 0.0, order="C"), marker, path, q,
        )  # fmt: skip
        finite = np.isfinite(marker).all(axis=(1, 2))
        return Path(np.array(tension), marker, path, q, np.where(finite, DIRECT, 0), start.started, slip, distal, start.LU)


def _loaded(body: Body, payload: float) -> Body:
    """A copy of the body with a point mass at its tip and, as fixed tendons, the coupling springs of elastic.py."""
    spec = body.spec.copy()
    for one, other in hinge_pairs(body):
        stiffness = 0.5 * COUPLING * (spec.joint(one).stiffness[0] + spec.joint(other).stiffness[0])
        spring = spec.add_tendon(name=f"{one}-{other}")
        spring.stiffness = [stiffness, 0, 0]
        spring.wrap_joint(one, 1.0)
        spring.wrap_joint(other, -1.0)
    if payload > 0.0:
        site = spec.site(body.tip)
        mass = site.parent.add_body(name="payload", pos=site.pos, mass=payload, inertia=[1e-9, 1e-9, 1e-9])
        mass.ipos, mass.explicitinertial = [0, 0, 0], True
    return Body(spec, body.joints, body.tendons, body.markers, body.disks, body.tip, body.length)
