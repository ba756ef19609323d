"""A trial by MuJoCo's steps, with the laws between them, compiled: a step of three joints and three tendons takes 5 to 8 us."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal
from twin.mechanics.mjcf.friction import JointLaws, follow_joints, joint_forces, tendon_forces
from twin.mechanics.mujoco_symbols import mj_full_m, mj_fwd_actuation, mj_step1, mj_step2

RATE_AT_REST = 1e-7  # rad/s or m/s: slower than this in all coordinates for `REST_STEPS` steps a body has settled
REST_STEPS = 30
LARGEST_RATE = 1e5  # rad/s or m/s: faster bodies have diverged


@by_reference
class Views(NamedTuple):
    """Views of a data's and a model's arrays."""

    ctrl: np.ndarray
    qvel: np.ndarray
    applied: np.ndarray  # qfrc_applied
    force: np.ndarray  # actuator_force
    smooth: tuple  # qfrc_passive, qfrc_actuator, qfrc_constraint, qfrc_bias
    damping: np.ndarray  # dof_damping of the model
    shown: tuple  # arrays that are recorded in every row, in the order of the solver's columns
    rates: tuple  # (qvel, velocities of actuators, of tendons), recorded after those
    force_column: int  # of `actuator_force` among the columns
    slope: np.ndarray  # (nu,) of an actuator's force over its velocity
    forcerange: np.ndarray  # (nu, 2), infinite where it is not limited
    moment: tuple  # of actuators: rownnz, rowadr, colind, values
    implicit: bool  # whether actuators' damping acts at the rates after a step
    length: np.ndarray  # actuator_length
    affine: np.ndarray  # (nu, 3) of an actuator's force without its damping: per control, alone, per length


@by_reference
class Laws(NamedTuple):
    """All laws between the steps; `pull` (ntendon, nu) is the tension per force of each actuator."""

    joints: JointLaws
    mu: np.ndarray  # (ntendon,) of capstan friction
    presliding: float  # m, of tendons
    tree: object
    paths: object
    pull: np.ndarray
    lag: np.ndarray  # (nu,) s, of a winch's force behind its control, by its line


@by_reference
class Memory(NamedTuple):
    """What is remembered from step to step: the states of the laws, and the rates and the added damping of the step before."""

    z: np.ndarray  # (n_joint,)
    slip: object
    started: np.ndarray  # (1,) whether tendons' paths are those of a step before
    raised: np.ndarray  # (nv,) N m s/rad, by what sticks
    rate: np.ndarray  # (nv,)
    moving: np.ndarray  # (1,) whether these rates are those of a step before
    # Of actuators behind lines (4, nu): the rates that their drums follow, before and after the last step; their forces without
    # damping; the lengths that slack lines leave to their drums, NaN of taut ones.
    late: np.ndarray
    heard: np.ndarray  # (2, nu) controls after the lag, and the controls before it; NaN before the first


@jit_internal
def center_damping(views, own, ahead, behind, applied):
    """Add to the forces (nv,) what makes damping act at the mean of the rates in a step.

    Else it acts at those after it (implicit integrators), which are `ahead` (nv,) of the mean, or, of actuators, at those before it
    (Euler), which are `behind` (nv,) it. Steps become of second order by it. An actuator at its limit has no damping.
    """
    rownnz, rowadr, colind, values = views.moment
    for k in range(applied.size):
        applied[k] += own[k] * ahead[k]
    for k in range(views.force.size):
        if views.slope[k] != 0.0 and views.forcerange[k, 0] < views.force[k] < views.forcerange[k, 1]:
            change = 0.0
            for e in range(rowadr[k], rowadr[k] + rownnz[k]):
                change += values[e] * (-ahead[colind[e]] if views.implicit else behind[colind[e]])
            for e in range(rowadr[k], rowadr[k] + rownnz[k]):
                applied[colind[e]] += values[e] * views.slope[k] * change


@jit_internal
def pull_lines(views, lag, h, memory, behind, applied):
    """Add to the forces (nv,) what lines that stretch (`lag` > 0 s, `ModelBody.stretch_lines`) pull otherwise than their actuators.

    Of a taut line, compliance c, the force is that of the actuator at a rate that comes late, since its drum, at x, follows by

        kv x' = kp (u - x) + (l - x)/c,    F = -(l - x)/c.

    Beyond a limit at zero it is slack, and its drum moves alone, kv x' = kp (u - x), until l has caught up.
    """
    rownnz, rowadr, colind, values = views.moment
    late, heard = memory.late, memory.heard
    for k in range(lag.size):
        if lag[k] == 0.0:
            continue
        low, high, l, D = views.forcerange[k, 0], views.forcerange[k, 1], views.length[k], -views.slope[k]
        per_control, alone, K = views.affine[k, 0], views.affine[k, 1], -views.affine[k, 2]
        taut = 1.0 / (1.0 + K * lag[k] / D)  # 1 / (1 + kp c): K = kp taut, D = kv taut^2, lag = kv c taut
        c, static, rate = taut * lag[k] / D, per_control * views.ctrl[k] + alone - K * l, views.rates[1][k]
        for e in range(rowadr[k], rowadr[k] + rownnz[k]):
            rate += values[e] * behind[colind[e]]
        force, left = 0.0, math.exp(-h / lag[k])
        if math.isfinite(late[3, k]):
            goal = (per_control * heard[1, k] + alone) / K
            late[3, k] = goal + (late[3, k] - goal) * math.exp(-h * K * taut / D)
            force = (late[3, k] - l) / c
            if low < force < high:
                late[1, k], late[3, k] = (static - force) / D, np.nan
        if not math.isfinite(late[3, k]):
            force = static - D * (rate + (late[1, k] - rate) * (1.0 - left) * lag[k] / h)
            late[0, k], late[1, k] = late[1, k], rate + (late[1, k] - rate) * left
            if (high == 0.0 and force > 0.0) or (low == 0.0 and force < 0.0):
                late[3, k] = l + c * force
        late[2, k] = static
        free = low < views.force[k] < high
        change = min(high, max(low, force)) - (static - D * rate if free else views.force[k])
        for e in range(rowadr[k], rowadr[k] + rownnz[k]):
            applied[colind[e]] += values[e] * change


@jit_internal
def center_rates(views, lag, late, out):
    """Replace the rates of a row, those before it, by the mean with those now, and its actuators' forces by those at that mean.

    Behind a line that stretches (`lag` > 0) it is the mean of the rates that its drum follows, `late` (4, nu).
    """
    at = 0
    for array in views.shown:
        at += array.size
    for j in range(3):
        array = views.rates[j]
        for k in range(array.size):
            change = 0.5 * (array[k] - out[at])
            out[at] += change
            if j == 1:
                at_force, low, high = views.force_column + k, views.forcerange[k, 0], views.forcerange[k, 1]
                if lag[k] > 0.0:
                    slack = math.isfinite(late[3, k])
                    force = 0.0 if slack else late[2, k] + 0.5 * views.slope[k] * (late[0, k] + late[1, k])
                    out[at_force] = min(high, max(low, force))
                elif low < out[at_force] < high:
                    out[at_force] = min(high, max(low, out[at_force] + views.slope[k] * change))
            at += 1


@jit_internal
def hear(asked, lag, h, heard, ctrl):
    """Let controls (nu,) through filters of the first order, exactly where they run straight: lag x' + x = u."""
    for k in range(ctrl.size):
        u, before = asked[k], heard[1, k]
        ctrl[k] = u
        if lag[k] > 0.0 and math.isfinite(before):
            behind = (u - before) / h * lag[k]
            ctrl[k] = u - behind + (heard[0, k] - before + behind) * math.exp(-h / lag[k])
        heard[0, k], heard[1, k] = ctrl[k], u


@jit_internal
def write_row(views, out):
    """Write the shown arrays and the rates one after another."""
    at = 0
    for array in views.shown:
        for k in range(array.size):
            out[at] = array[k]
            at += 1
    for array in views.rates:
        for k in range(array.size):
            out[at] = array[k]
            at += 1


@jit_internal
def foresee_rates(engine, views, laws, memory, room):
    """Foresee the rates of the step ahead, and let joints rub in it.

    `room` is (rates after the step, their mean, how far ahead of the mean those after it are, how far behind those before it, and
    room to work in): each (nv,), the last (nv, nv). Where nothing rubs rates change as in the step before.
    """
    model, data, h = engine
    after, mean, ahead, behind, free, mass = room
    for k in range(after.size):
        behind[k] = ahead[k] = 0.5 * (views.qvel[k] - memory.rate[k]) if memory.moving[0] else 0.0
        memory.rate[k] = views.qvel[k]
    memory.moving[0] = True
    if laws.joints.dof.size == 0:
        return
    mj_full_m(model, data, mass.ctypes)
    for k in range(after.size):
        free[k] = views.applied[k] - views.smooth[3][k]
        for f in range(3):
            free[k] += views.smooth[f][k]
    smooth, motion = (free, mass, views.damping, views.force), (views.qvel, after, mean)
    joint_forces(laws.joints, memory.z, h, smooth, motion, views.applied)
    for k in range(after.size):
        ahead[k], behind[k] = after[k] - mean[k], mean[k] - views.qvel[k]


@jit
def run(engine, views, laws, memory, commands, rows, out):
    """Step through commands (n, nu), the state before step i being that at command i. `engine` is (model, data, step in s).

    Where rows[i] >= 0 the shown arrays go to out[rows[i]], and the rates after them. The steps are a leapfrog: rates belong to the
    moments between the steps, so that their means before and after a row are shown, and forces are corrected for that. The last row
    needs one step more. With `rows` empty it settles under commands[0] until it is at rest. Returns the number of steps.
    """
    model, data, h = engine
    nv, nt = views.qvel.size, laws.pull.shape[0]
    own, raised, gradient, slow = views.damping.copy(), memory.raised, np.zeros(nv), 0
    mu = laws.mu.max() if nt else 0.0
    rubs, room = (
        laws.joints.dof.size > 0,
        (np.zeros(nv), np.zeros(nv), np.zeros(nv), np.zeros(nv), np.zeros(nv), np.zeros((nv, nv))),
    )
    settling, last, limited = rows.size == 0, -1, False
    for k in range(views.force.size):
        limited = limited or math.isfinite(views.forcerange[k, 0]) or math.isfinite(views.forcerange[k, 1])
    done = commands.shape[0]
    for i in range(commands.shape[0]):
        for k in range(nv):
            views.applied[k] = 0.0
            views.damping[k] = own[k] + raised[k]
            raised[k] = 0.0
        hear(commands[i], laws.lag, h, memory.heard, views.ctrl)
        mj_step1(model, data)
        if last >= 0:
            center_rates(views, laws.lag, memory.late, out[last])
        row = -1 if settling else rows[i]
        last = row
        if mu > 0.0 or row >= 0 or limited or rubs:  # which actuator is at its limit is asked below
            mj_fwd_actuation(model, data)
        if mu > 0.0:
            for t in range(nt):
                T = 0.0
                for k in range(views.force.size):
                    T += laws.pull[t, k] * views.force[k]
                law, work = (laws.mu[t], laws.presliding, h), (gradient, views.applied, raised)
                tendon_forces((t, T), law, laws.tree, laws.paths, memory.slip, memory.started[0], work)
            memory.started[0] = True
        foresee_rates(engine, views, laws, memory, room)
        center_damping(views, own, room[2], room[3], views.applied)
        pull_lines(views, laws.lag, h, memory, room[3], views.applied)
        if row >= 0:
            write_row(views, out[row])
        mj_step2(model, data)
        fastest = 0.0
        for k in range(nv):
            fastest = max(fastest, abs(views.qvel[k])) if math.isfinite(views.qvel[k]) else np.inf
        if rubs:
            follow_joints(laws.joints, memory.z, h, room[0], views.qvel)
        if not fastest < LARGEST_RATE:
            done = i
            break
        slow = slow + 1 if fastest < RATE_AT_REST else 0
        if settling and slow > REST_STEPS:
            break
    for k in range(nv):
        views.damping[k] = own[k]
    return done
