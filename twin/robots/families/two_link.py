"""Family "two_link": a planar finger of two rigid links on sprung hinges, with pulleys at both joints.

Tendon 1 bends it, tendon 2 straightens it. With q the joint angles, p(q) the places of masses m, F a force at the tip, a = +1, -1
for the two tendons and r_j the pulleys:

    s k_j (q_j - rest_j) - sum m g . dp/dq_j - F . dp_tip/dq_j - r_j sum_i a_i T_ij = 0,          s: stiffness over that described
    T_ij = T_i exp(-mu sum_{l<=j} z_il (wrap + a_i q_l)),     z_il = clip(z_il + travel / presliding, -1, 1)

T_ij is the tension of tendon i beyond joint j, z_il the slip state of `tendon_friction` at joint l, where the tendon travels by
a_i sum_{m>=l} r_m q_m. Source: statics of an open chain; capstan law as in `twin.effects.tendon_friction`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import mujoco
import numpy as np
from pydantic import Field

from twin.body import DIRECT, NOT_FOUND, Body, Drive, Port, Problem, Sense, Solution, marker_senses
from twin.effects.tendon_friction import rounded_turn_angle, slip_state
from twin.foundation.compiled import assign, jit
from twin.foundation.parameters import parameter_array
from twin.robots.schema import FULL_TURN, Row, Schema, Structure

LINK_COLOUR, TWO_LINK_TENDON_COLOUR = [0.72, 0.74, 0.78, 1.0], [0.85, 0.6, 0.15, 1.0]
RAMP_STEPS = 8  # from slack to the first tensions, as for all robots
DIFFERENCE_STEP = 1e-7  # rad, for the tangent
ANGLE_TOLERANCE = 1e-11  # rad
MAX_ITERATIONS = 60
MAX_STEP = 0.3  # rad, of a Newton step
MIN_TENSION_SHARE = 1e-4  # of a change of tension: smaller parts are given up
TENDON_SIDES = (1.0, -1.0)  # a of tendons 1 and 2
TWO_LINK_DIAGRAM = """\
         tendon 1  --------------------------
               joint 1           joint 2
     base =====(o)===============(o)=============> tip
         tendon 2  --------------------------
     x ^
       |
       o----> z    y away from you: joints turn about y, towards +x. Tendon 1 bends, tendon 2 straightens.
"""


class TwoLink(Structure):
    """[structure] of family "two_link"."""

    tendons: Literal[2] = Field(description="one that bends, one that straightens")

    def counts(self) -> dict[str, int]:
        return {"tendon": 2, "joint": 2}


TWO_LINK_ROWS = (
    Row("links.length", "m", "mm", "length of each link, from its joint to the next or to the tip", 1e-3, 1.0, ("joint",)),
    Row("links.mass", "kg", "g", "mass of each link, in its middle", 1e-6, 10.0, ("joint",)),
    Row("joints.stiffness", "N*m", "N*mm", "of the spring at each joint, per radian", 1e-6, 10.0, ("joint",)),
    Row(
        "joints.rest",
        "rad",
        "deg",
        "angle at which each joint's spring is at rest",
        -FULL_TURN / 4,
        FULL_TURN / 4,
        ("joint",),
        default=0.0,
    ),
    Row("pulleys.radius", "m", "mm", "of the pulleys at each joint, both tendons alike", 1e-4, 0.5, ("joint",)),
    Row(
        "pulleys.wrap",
        "rad",
        "deg",
        "by which a tendon turns at each pulley of the straight finger; counts with friction",
        0.0,
        FULL_TURN,
    ),
)
SCHEMA = Schema(
    structure=TwoLink,
    rows=TWO_LINK_ROWS,
    accuracy=Row("accuracy", "m", "mm", "what the description is believed to be good for: no smaller effect is claimed", 1e-9, 0.1),
    find_conflicts=lambda structure, values: [],
    usual_channels=lambda structure: [
        ("tendon_1_tension", "input", "N", 0.01), ("tendon_2_tension", "input", "N", 0.01), ("joint_1_angle", "output", "deg", 0.1),
        ("joint_2_angle", "output", "deg", 0.1), *((f"tip_{a}", "output", "mm", 0.2) for a in "xyz"),
    ],
    diagram=TWO_LINK_DIAGRAM,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Finger(Body):
    """The finger's numbers, (2,) for links, joints and pulleys."""

    length: np.ndarray  # m
    mass: np.ndarray  # kg
    stiffness: np.ndarray  # N m/rad
    rest: np.ndarray  # rad
    radius: np.ndarray  # m, of the pulleys
    wrap: float  # rad that a tendon turns at each pulley of the straight finger


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> Finger:
    """Build the finger from `values` (SI, by parameter name) that SCHEMA allows."""
    length, mass, stiffness, rest, radius = (np.array(parameter_array(values, row.name, 2)) for row in TWO_LINK_ROWS[:-1])
    return Finger(
        spec=_spec(length, mass, stiffness, rest, radius),
        n_tendon=2,
        features=frozenset({"weight", "elasticity", "markers", "load cells", "drives that saturate", "slack", "lines"}),
        ports=tuple((Port(f"tendon_{i + 1}_tension", Drive.TENSION, tuple(np.eye(2)[i])),) for i in (0, 1)),
        senses={
            **{f"tendon_{i}_{group}": Sense(group, i - 1) for i in (1, 2) for group in ("tension", "displacement")},
            **{f"joint_{j}_angle": Sense("angle", j - 1) for j in (1, 2)},
            **marker_senses(["tip"]),
        },
        tendon_sites=tuple(tuple(f"tendon_{i}_{place}" for place in ("base", "joint_2", "anchor")) for i in (1, 2)),
        marker_sites=("tip",),
        length=length,
        mass=mass,
        stiffness=stiffness,
        rest=rest,
        radius=radius,
        wrap=values["pulleys.wrap"],
    )  # fmt: skip


def _spec(length: np.ndarray, mass: np.ndarray, stiffness: np.ndarray, rest: np.ndarray, radius: np.ndarray) -> mujoco.MjSpec:
    """Return the finger in MuJoCo: point masses in the middle of the links, tendons tied to the joints by their pulleys."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    parent, place = spec.worldbody, 0.0
    for j in (0, 1):
        link = parent.add_body(name=f"link_{j + 1}", pos=[0, 0, place])
        joint = link.add_joint(name=f"joint_{j + 1}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        joint.stiffness, joint.springref = [stiffness[j], 0, 0], rest[j]
        link.mass, link.ipos, link.explicitinertial = mass[j], [0, 0, 0.5 * length[j]], True
        link.inertia = [1e-9, 1e-9, 1e-9]
        along, capsule = [0, 0, 0, 0, 0, length[j]], mujoco.mjtGeom.mjGEOM_CAPSULE
        link.add_geom(type=capsule, size=[0.4 * radius[j], 0, 0], fromto=along, mass=0, contype=0, conaffinity=0, rgba=LINK_COLOUR)
        parent, place = link, length[j]
    parent.add_site(name="tip", pos=[0, 0, place], size=[1e-3, 0, 0])
    ends = (
        ("base", spec.worldbody, radius[0], 0.0),
        ("joint_2", parent, radius[1], 0.0),
        ("anchor", parent, radius[1], 0.8 * place),
    )
    for i, side in enumerate(TENDON_SIDES, 1):
        for name, body, arm, z in ends:
            body.add_site(name=f"tendon_{i}_{name}", pos=[side * arm, 0, z], size=[5e-4, 0, 0])
        tendon = spec.add_tendon(name=f"tendon_{i}", rgba=TWO_LINK_TENDON_COLOUR)
        for j in (0, 1):
            tendon.wrap_joint(f"joint_{j + 1}", -side * radius[j])
        motor = spec.add_actuator(name=f"tendon_{i}", target=f"tendon_{i}", trntype=mujoco.mjtTrn.mjTRN_TENDON)
        motor.gear = [-1, 0, 0, 0, 0, 0]
    return spec


class Links(NamedTuple):
    """The finger and its loads for compiled functions; in the plane, (x, z)."""

    length: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    radius: np.ndarray
    weight: np.ndarray  # (2, 2) N of each link
    tip: np.ndarray  # (2,) N, payload and force
    friction: np.ndarray  # wrap (rad), mu, presliding (m)


@jit
def joint_moments(q, links, T, z0, q0, z):
    """Return the unbalanced moments (2,) N m about the joints at q, and write the slip states z (2, 2), from z0 at q0."""
    wrap, mu, presliding = links.friction
    s1, c1, s2, c2 = math.sin(q[0]), math.cos(q[0]), math.sin(q[0] + q[1]), math.cos(q[0] + q[1])
    L1, L2 = links.length
    (w1x, w1z), (w2x, w2z), (fx, fz) = links.weight[0], links.weight[1], links.tip
    second = (0.5 * w2x + fx) * L2 * c2 - (0.5 * w2z + fz) * L2 * s2
    first = (0.5 * w1x + w2x + fx) * L1 * c1 - (0.5 * w1z + w2z + fz) * L1 * s1 + second
    out = [links.stiffness[0] * (q[0] - links.rest[0]) - first, links.stiffness[1] * (q[1] - links.rest[1]) - second]
    for i in range(2):
        a, lost = TENDON_SIDES[i], 0.0
        for j in range(2):
            travel = 0.0
            for m in range(j, 2):
                travel += a * links.radius[m] * (q[m] - q0[m])
            z[i, j] = slip_state(z0[i, j], travel, presliding)
            lost += z[i, j] * rounded_turn_angle(max(0.0, wrap + a * q[j]))[0]
            out[j] -= a * links.radius[j] * T[i] * math.exp(-mu * lost)
    return out[0], out[1]


@jit
def solve_equilibrium(links, T, z, q):
    """Solve for equilibrium by Newton's method from q (2,), with halved steps if the error grows.

    Writes q and z. Returns False if it does not converge.
    """
    z0, q0, z1, now = z.copy(), q.copy(), np.empty((2, 2)), q.copy()
    step, a, b = 1.0, 0.0, 0.0
    best = 1e300
    for _ in range(MAX_ITERATIONS):
        f, g = joint_moments(now, links, T, z0, q0, z1)
        size = max(abs(f) / links.stiffness[0], abs(g) / links.stiffness[1])
        if size < ANGLE_TOLERANCE:
            assign(q, now)
            assign(z[0], z1[0])
            assign(z[1], z1[1])
            return True
        if not size < best:
            step *= 0.5
            if step < 1e-4:
                return False
            now[0], now[1] = q[0] - step * a, q[1] - step * b
            continue
        best, step = size, 1.0
        assign(q, now)
        now[0] += DIFFERENCE_STEP
        f1, g1 = joint_moments(now, links, T, z0, q0, z1)
        now[0], now[1] = q[0], q[1] + DIFFERENCE_STEP
        f2, g2 = joint_moments(now, links, T, z0, q0, z1)
        A, B, C, D = (f1 - f) / DIFFERENCE_STEP, (f2 - f) / DIFFERENCE_STEP, (g1 - g) / DIFFERENCE_STEP, (g2 - g) / DIFFERENCE_STEP
        det = A * D - B * C
        a, b = (D * f - B * g) / det, (A * g - C * f) / det
        longest = max(abs(a), abs(b), MAX_STEP) / MAX_STEP
        a, b = a / longest, b / longest
        now[0], now[1] = q[0] - a, q[1] - b
    return False


@jit
def change_tension(links, T0, T1, z, q):
    """Move from equilibrium under T0 to that under T1, in smaller parts if needed: short pre-sliding makes kinks.

    Returns False if it fails.
    """
    done, part = 0.0, 1.0
    while done < 1.0:
        if solve_equilibrium(links, T0 + (T1 - T0) * (done + part), z, q):
            done += part
            part = min(2.0 * part, 1.0 - done)
        else:
            part *= 0.5
            if part < MIN_TENSION_SHARE:
                return False
    return True


@jit
def solve_trial(links, T, scale, q_out, status):
    """Solve a trial of tensions T (n, 2) N, from slack to the first in equal steps; `scale` (n,) multiplies the stiffness."""
    q, z = links.rest.copy(), np.zeros((2, 2))
    described = links.stiffness.copy()
    assign(links.stiffness, described * scale[0])
    solve_equilibrium(links, 0.0 * T[0], z, q)
    for k in range(RAMP_STEPS):
        change_tension(links, T[0] * (k / RAMP_STEPS), T[0] * ((k + 1) / RAMP_STEPS), z, q)
    for i in range(T.shape[0]):
        assign(links.stiffness, described * scale[i])
        status[i] = change_tension(links, T[max(0, i - 1)], T[i], z, q)
        assign(q_out[i], q)


class Statics:
    """Static solver of the finger. Rigid links do not creep."""

    n_delayed = 0

    def __init__(self, body: Finger) -> None:
        self.body = body
        self.straight_path = np.zeros(2)

    def solve(self, problem: Problem) -> Solution:
        """Solve for equilibrium under base tensions (n, 2) N; the solution shows the joint angles (n, 2) rad and the tip."""
        body, loads, route, n = self.body, problem.loads, problem.route, len(problem.time)
        plane = [0, 2]
        links = Links(
            body.length, body.stiffness.copy(), body.rest, body.radius, np.outer(body.mass, loads.gravity[plane]),
            loads.payload * loads.gravity[plane] + loads.force[plane], np.array([body.wrap, route.mu, route.presliding]),
        )  # fmt: skip
        q, status = np.empty((n, 2)), np.empty(n, bool)
        scale = np.ones(n) if problem.stiffness is None else np.array(problem.stiffness, float)
        T = np.maximum(np.ascontiguousarray(problem.command, float), 0.0)
        solve_trial(links, T, scale, q, status)
        both = q.sum(axis=1)
        tip = np.zeros((n, 1, 3))
        tip[:, 0, 0] = body.length[0] * np.sin(q[:, 0]) + body.length[1] * np.sin(both)
        tip[:, 0, 2] = body.length[0] * np.cos(q[:, 0]) + body.length[1] * np.cos(both)
        shortening = q @ body.radius
        return Solution(
            tension=T, path=np.column_stack([-shortening, shortening]), markers=tip, q=q,
            status=np.where(status & np.isfinite(both), DIRECT, NOT_FOUND), others={"angle": q},
        )  # fmt: skip


statics, dynamics = Statics, None  # statics only: its first mode is some 5 Hz, and it is for slow logs
figure = chain = silicone = hand = None
