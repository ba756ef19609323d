"""Quasi-static march through a sequence of loads, carrying the slip state of friction and the delayed strain of creep.

Creep is a Prony series in the compliance, J(t) = C (1 + sum_n a_n (1 - exp(-t / tau_n))), one Kelvin-Voigt element per
term: tau_n v_n' + v_n = a_n e, e = C R^T m. Over a step in which e runs linearly the solution is exact,

    v+ = E v + a (early e_old + late e_new),   E = exp(-dt/tau),  x = dt/tau,
    late = 1 - (1 - E)/x,   early = (1 - E)/x - E

so the step is implicit: it only raises the compliance by 1 + sum a late and shifts the curvature at rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.bench.frames import integrate
from tools.bench.statics import Body, Load, equilibrium, new_pose
from tools.bench.tendons import lay

SMALLEST = 1.0 / 1024  # of a load step; below, the march gives up


class Creep(NamedTuple):
    share: np.ndarray  # (P,) a_n
    time: np.ndarray  # (P,) s, tau_n
    delayed: np.ndarray  # (P, N, G, 3) 1/m, v_n: state, overwritten
    elastic: np.ndarray  # (N, G, 3) 1/m, e at the last equilibrium: state, overwritten


class Path(NamedTuple):
    """A sequence of loads; row 0 is reached from the unloaded straight robot."""

    drive: np.ndarray  # (n, T) base tension in N, or free length in m
    weight: np.ndarray  # (n,) factor on the dead loads
    softness: np.ndarray  # (n,) factor on the compliance
    dt: np.ndarray  # (n,) s taken to reach the row


@njit(cache=True)
def distal_lengths(length, out):
    N, T = length.shape
    for i in range(T):
        s = 0.0
        for k in range(N - 2, -1, -1):
            s += length[k + 1, i]
            out[k, i] = s


class Record(NamedTuple):
    """What is kept of each row with keep[row] true."""

    keep: np.ndarray  # (n,) bool
    disk_r: np.ndarray  # (m, N+1, 3) m, base plate first
    disk_R: np.ndarray  # (m, N+1, 3, 3)
    length: np.ndarray  # (m, T) m, base hole to tip hole
    tension: np.ndarray  # (m, N, T) N, of every segment
    curvature: np.ndarray  # (m, N, G, 3) 1/m
    moment: np.ndarray  # (m, N, G, 3) N m, carried by the rod, world frame


@njit(cache=True)
def march(mesh, body, load, friction, creep, path, record):
    """March and fill `record`. Returns the first row that found no balance, or -1.

    The rod starts unloaded at rest: curvature = rest + delayed strain, zero slip.
    """
    n, T = path.drive.shape
    N, G = body.rest.shape[0], body.rest.shape[1]
    P = creep.time.shape[0]
    pose = new_pose(N, G, T, friction.stroke.shape[0])
    u = body.rest.copy()
    for p in range(P):
        u += creep.delayed[p]
    T_base = np.zeros(T)
    creep.elastic[:] = 0.0
    now = Body(body.pitch, body.compliance.copy(), body.rest.copy(), body.holes)
    step = Load(
        load.disk_force.copy(),
        load.line_force.copy(),
        load.fields,
        np.zeros(T),
        load.share,
        np.zeros(T),
        load.stretch,
        load.by_length,
    )
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    friction.z[:] = 0.0
    distal_lengths(pose.length, friction.distal)
    last_drive = np.zeros(T)
    if load.by_length:
        for i in range(T):
            last_drive[i] = pose.length[:, i].sum()
    last_weight, last_soft = 0.0, path.softness[0]
    early, late, keep = np.empty(P), np.empty(P), np.empty(P)
    stored = 0
    for row in range(n):
        done, part = 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            x = done + part
            weight = last_weight + x * (path.weight[row] - last_weight)
            soft = last_soft + x * (path.softness[row] - last_soft)
            step.disk_force[:] = weight * load.disk_force
            step.line_force[:] = weight * load.line_force
            for i in range(T):
                drive = last_drive[i] + x * (path.drive[row, i] - last_drive[i])
                step.tension[i] = drive
                step.free_length[i] = drive
            now.rest[:] = body.rest
            raised = 1.0
            for p in range(P):
                ratio = path.dt[row] * part / creep.time[p]
                keep[p] = np.exp(-ratio)
                mean = -np.expm1(-ratio) / ratio if ratio > 0.0 else 1.0
                late[p], early[p] = 1.0 - mean, mean - keep[p]
                raised += creep.share[p] * late[p]
                now.rest[:] += keep[p] * creep.delayed[p] + creep.share[p] * early[p] * creep.elastic
            now.compliance[:] = body.compliance * (soft * raised)
            u_old, T_old = u.copy(), T_base.copy()
            if not equilibrium(u, T_base, mesh, now, step, friction, pose):
                u[:] = u_old
                T_base[:] = T_old
                part *= 0.5
                if part < SMALLEST:
                    return row
                continue
            friction.z[:] = pose.z
            distal_lengths(pose.length, friction.distal)
            elastic = (u - now.rest) / raised
            for p in range(P):
                creep.delayed[p] = keep[p] * creep.delayed[p] + creep.share[p] * (
                    early[p] * creep.elastic + late[p] * elastic
                )
            creep.elastic[:] = elastic
            done = x
            part *= 2.0
        last_drive[:] = path.drive[row]
        last_weight, last_soft = path.weight[row], path.softness[row]
        if record.keep[row]:
            record.disk_r[stored] = pose.disk_r
            record.disk_R[stored] = pose.disk_R
            for i in range(T):
                record.length[stored, i] = pose.length[:, i].sum()
                record.tension[stored, :, i] = T_base[i] * pose.ratio[:, i]
            record.curvature[stored] = u
            record.moment[stored] = pose.moment
            stored += 1
    return -1
