"""Friction of joints and tendons between MuJoCo's steps, compiled; both hold still without creeping.

A joint rubs with F z, z its slip state in [-1, 1] that follows Dahl's law over a turn dq,

    z' = s + (z - s) exp(-|dq| / presliding),    s = sign dq,
    F = (torque + breakaway exp(-(v / stribeck)^2) + load |torque through its gear (`geared`)|),

so that short of sliding it is a spring F / presliding, in which a light joint swings many times in one of MuJoCo's steps. What rubs
is therefore followed in short steps d between the rates before and after a step, all other forces f standing still,

    (M + d^2 / 4 F / presliding) dv = d (f - D (v - v_0) - F z),    dq = d v,

D the joints' damping; MuJoCo then steps under the mean of F z. The inertia that is added keeps any spring stable.

A tendon that its actuator pulls with T_0 at its first point loses tension where it turns by theta_k at its points (capstan),

    T_k = T_0 exp(-mu sum_(j<=k) z_j theta_j),    z_k = clip(z_k + travel_k / presliding, -1, 1),

travel_k towards the first point being how much shorter the path beyond point k became. MuJoCo applies T_0 all along; here
sum_k (T_0 - T_k) dl_k/dq comes on top, l_k the length between two points. The steps are implicit in what sticks, by a damping of
each joint that is h T_0 mu theta_k / presliding |dD_k/dq_i| sum_j |dD_k/dq_j| at most, D_k the path beyond k.

Source: Dahl (1968); Stribeck (1902); Euler-Eytelwein; all as in `twin.effects`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit_internal

MUJOCO_SITE = 3  # mjtWrap
PULLEY_POINT, SITE_POINT = -2, -1  # of mjData.wrap_obj; others are geoms
LARGEST_LOSS = 40.0  # exponents of a capstan: beyond it nothing is left of a pull
TENDON_SHARE = 0.4  # of the damping that would make a step implicit in what sticks: steps are stable from a quarter on
SHORT_STEP = 2.5e-4  # s, in which joints rub: light fingers swing in what sticks at some 1,000 rad/s


@by_reference
class JointLaws(NamedTuple):
    """Joints that rub: their number in dof, and the law of each, (n,)."""

    dof: np.ndarray
    torque: np.ndarray
    breakaway: np.ndarray
    load: np.ndarray
    gears: np.ndarray  # (n, nu) torque per force of the actuators that turn a joint by itself
    stribeck: float
    presliding: float


@by_reference
class Tree(NamedTuple):
    """What a model's tendons run over, as MuJoCo stores it."""

    tendon_adr: np.ndarray
    tendon_num: np.ndarray
    wrap_type: np.ndarray
    wrap_objid: np.ndarray
    site_body: np.ndarray
    geom_body: np.ndarray
    body_root: np.ndarray
    body_last_dof: np.ndarray  # of a body or the nearest ancestor that moves, -1 for none
    dof_parent: np.ndarray


@by_reference
class Paths(NamedTuple):
    """Views of a data's tendon paths and motion axes."""

    ten_wrapadr: np.ndarray
    ten_wrapnum: np.ndarray
    wrap_obj: np.ndarray  # (2 nwrap,)
    wrap_xpos: np.ndarray  # (2 nwrap, 3)
    cdof: np.ndarray  # (nv, 6)
    subtree_com: np.ndarray


@by_reference
class Slip(NamedTuple):
    """Slip states of tendons' points, the paths beyond them in the step before, and room to work in."""

    z: np.ndarray  # (ntendon, most points)
    beyond: np.ndarray  # (ntendon, most points) m
    body: np.ndarray  # (most points,) of each point of one tendon
    u: np.ndarray  # (most points, 3) direction to the next point
    length: np.ndarray  # (most points,) m to the next point
    turn: np.ndarray  # (most points,) rad at each point


@jit_internal
def joint_forces(laws, z, h, smooth, motion, applied):
    """Add the mean friction (nv,) of joints over a step of h s, found in short steps that begin and end between two angles.

    `smooth` is (force without friction (nv,), mass matrix (nv, nv), which is overwritten, damping (nv,), actuators' forces (nu,)),
    `motion` (rates before the step (nv,), rates after it and their mean (nv,), which are written). Advances the slip states z (n,).
    """
    (free, M, damping, force), (rate, after, mean) = smooth, motion
    nv, parts = rate.size, max(1, math.ceil(h / SHORT_STEP - 1e-6))
    d, level = h / parts, np.empty(laws.dof.size)
    for j in range(laws.dof.size):
        geared = 0.0
        for k in range(force.size):
            geared += laws.gears[j, k] * force[k]
        level[j] = laws.torque[j] + laws.load[j] * abs(geared)
        M[laws.dof[j], laws.dof[j]] += 0.25 * d * d * (level[j] + laws.breakaway[j]) / laws.presliding
    pushed, turned, W = np.empty(nv), np.zeros(laws.dof.size), np.linalg.inv(M)
    for k in range(nv):
        after[k], mean[k] = rate[k], 0.0
    for _ in range(parts):
        for k in range(nv):
            pushed[k] = free[k] - damping[k] * (after[k] - rate[k])
        for j in range(laws.dof.size):
            r = after[laws.dof[j]] / laws.stribeck
            rubbed = (level[j] + laws.breakaway[j] * math.exp(-r * r)) * z[j]
            pushed[laws.dof[j]] -= rubbed
            turned[j] += rubbed
        for i in range(nv):
            mean[i] += 0.5 * after[i] / parts
            for k in range(nv):
                after[i] += d * W[i, k] * pushed[k]
            mean[i] += 0.5 * after[i] / parts
        for j in range(laws.dof.size):
            z[j] = slid(z[j], d * after[laws.dof[j]], laws.presliding)
    for j in range(laws.dof.size):
        applied[laws.dof[j]] -= turned[j] / parts


@jit_internal
def slid(z, dq, presliding):
    """Return the slip state after a turn dq."""
    s = 1.0 if dq > 0.0 else -1.0
    return s + (z - s) * math.exp(-abs(dq) / presliding)


@jit_internal
def follow_joints(laws, z, h, after, rate):
    """Advance the slip states (n,) by what a step turned more than `joint_forces` foresaw: it ended at `rate`, not at `after`."""
    for j in range(laws.dof.size):
        z[j] = slid(z[j], 0.5 * h * (rate[laws.dof[j]] - after[laws.dof[j]]), laws.presliding)


@jit_internal
def path_bodies(t, tree, paths, body):
    """Write the body (or -2 for a pulley) of each point of tendon t; return how many there are."""
    first, n, at = paths.ten_wrapadr[t], paths.ten_wrapnum[t], tree.tendon_adr[t]
    for k in range(n):
        what = paths.wrap_obj[first + k]
        if what == PULLEY_POINT:
            body[k] = PULLEY_POINT
        elif what == SITE_POINT:
            while tree.wrap_type[at] != MUJOCO_SITE:
                at += 1
            body[k] = tree.site_body[tree.wrap_objid[at]]
            at += 1
        else:
            body[k] = tree.geom_body[what]
    return n


@jit_internal
def add_point(point, u, sign, body, tree, paths, out):
    """Add sign * (u . dp/dq) of a point of a body to `out` (nv,)."""
    if body < 0:
        return
    i = tree.body_last_dof[body]
    root = tree.body_root[body]
    while i >= 0:
        c = paths.cdof[i]
        a, b, d = (
            point[0] - paths.subtree_com[root, 0],
            point[1] - paths.subtree_com[root, 1],
            point[2] - paths.subtree_com[root, 2],
        )
        x, y, w = c[3] + c[1] * d - c[2] * b, c[4] + c[2] * a - c[0] * d, c[5] + c[0] * b - c[1] * a
        out[i] += sign * (u[0] * x + u[1] * y + u[2] * w)
        i = tree.dof_parent[i]


@jit_internal
def tendon_forces(pulled, law, tree, paths, slip, started, work):
    """Add what a tendon's friction changes of the generalised forces (nv,) while it is pulled, and the damping (nv,).

    `pulled` is (tendon, tension in N), `law` (mu, presliding in m, step in s), `work` (gradient, forces, damping), (nv,) each.
    Advances the slip states by the travel since the step before, unless not yet `started`.
    """
    (t, T), (mu, presliding, h), (gradient, applied, damping) = pulled, law, work
    nv, (body, u, length, turn) = applied.size, (slip.body, slip.u, slip.length, slip.turn)
    n = path_bodies(t, tree, paths, body)
    first = paths.ten_wrapadr[t]
    for k in range(n - 1):
        turn[k], length[k], u[k, 0], u[k, 1], u[k, 2] = 0.0, 0.0, 0.0, 0.0, 0.0
        if body[k] == PULLEY_POINT or body[k + 1] == PULLEY_POINT:
            continue
        for c in range(3):
            u[k, c] = paths.wrap_xpos[first + k + 1, c] - paths.wrap_xpos[first + k, c]
        length[k] = math.sqrt(u[k, 0] * u[k, 0] + u[k, 1] * u[k, 1] + u[k, 2] * u[k, 2])
        for c in range(3):
            u[k, c] /= max(length[k], 1e-12)
    for i in range(nv):
        gradient[i] = 0.0
    beyond = 0.0
    for k in range(n - 2, 0, -1):
        beyond += length[k]
        if body[k] != body[k + 1]:
            add_point(paths.wrap_xpos[first + k + 1], u[k], 1.0, body[k + 1], tree, paths, gradient)
            add_point(paths.wrap_xpos[first + k], u[k], -1.0, body[k], tree, paths, gradient)
        dot = u[k - 1, 0] * u[k, 0] + u[k - 1, 1] * u[k, 1] + u[k - 1, 2] * u[k, 2]
        if length[k] > 0.0 and length[k - 1] > 0.0:
            turn[k] = math.acos(min(1.0, max(-1.0, dot)))
        travel = slip.beyond[t, k] - beyond if started else 0.0
        slip.beyond[t, k] = beyond
        s = 1.0 if travel > 0.0 else -1.0 if travel < 0.0 else 0.0
        slip.z[t, k] = s + (slip.z[t, k] - s) * math.exp(-abs(travel) / presliding)
        if T > 0.0 and mu > 0.0:
            size = 0.0
            for i in range(nv):
                size += abs(gradient[i])
            for i in range(nv):
                damping[i] += TENDON_SHARE * h * T * mu * turn[k] * (1.0 - s * slip.z[t, k]) / presliding * abs(gradient[i]) * size
    lost = 0.0
    for k in range(1, n - 1):
        lost += mu * slip.z[t, k] * turn[k]
        if body[k] != body[k + 1] and T > 0.0:
            less = T * (1.0 - math.exp(-min(lost, LARGEST_LOSS)))
            add_point(paths.wrap_xpos[first + k + 1], u[k], less, body[k + 1], tree, paths, applied)
            add_point(paths.wrap_xpos[first + k], u[k], -less, body[k], tree, paths, applied)
