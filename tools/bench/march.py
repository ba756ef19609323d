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

from tools.bench.frames import Mesh, integrate
from tools.bench.statics import Body, Load, Pose, equilibrium, new_pose
from tools.bench.tendons import Friction, lay

SMALLEST = 1.0 / 1024  # of a load step; below, the march gives up


class NoEquilibrium(RuntimeError):
    """Newton found no balance, even when the load came in 1024 parts: the rod has buckled or the load is absurd."""


class Creep(NamedTuple):
    share: np.ndarray  # (P,) a_n
    time: np.ndarray  # (P,) s, tau_n
    delayed: np.ndarray  # (P, N, G, 3) 1/m, v_n: state, overwritten


class Path(NamedTuple):
    """A sequence of loads; row 0 is reached from the unloaded straight robot."""

    drive: np.ndarray  # (n, T) base tension in N, or free length in m
    weight: np.ndarray  # (n,) factor on the dead loads
    softness: np.ndarray  # (n,) factor on the compliance
    dt: np.ndarray  # (n,) s taken to reach the row


class Record(NamedTuple):
    """What is kept of each row with keep[row] true."""

    keep: np.ndarray  # (n,) bool
    disk_r: np.ndarray  # (m, N+1, 3) m, base plate first
    disk_R: np.ndarray  # (m, N+1, 3, 3)
    length: np.ndarray  # (m, T) m, base hole to tip hole
    tension: np.ndarray  # (m, N, T) N, of every segment
    curvature: np.ndarray  # (m, N, G, 3) 1/m
    moment: np.ndarray  # (m, N, G, 3) N m, carried by the rod, world frame


def march(mesh: Mesh, body: Body, load: Load, friction: Friction, creep: Creep | None, path: Path, record: Record) -> None:
    """March and fill `record`, from the unloaded rod at rest: curvature = rest + delayed strain, zero slip."""
    N, G = body.rest.shape[:2]
    T = body.holes.shape[1]
    pose = new_pose(N, G, T, len(friction.stroke))
    delayed = np.zeros((0, N, G, 3)) if creep is None else creep.delayed
    share, tau = (np.zeros(0), np.zeros(0)) if creep is None else (creep.share, creep.time)
    share, tau = share[:, None, None, None], tau[:, None, None, None]
    u = body.rest + delayed.sum(axis=0)
    elastic = np.zeros_like(u)
    T_base = np.zeros(T)
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    friction.z[:] = 0.0
    friction.distal[:] = distal_lengths(pose.length)
    drive = pose.length.sum(axis=0) if load.by_length else np.zeros(T)
    before = (drive, 0.0, path.softness[0])
    stored = 0
    for row in range(len(path.drive)):
        after = (path.drive[row], path.weight[row], path.softness[row])
        done, part = 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            drive, weight, softness = (a + (done + part) * (b - a) for a, b in zip(before, after, strict=True))
            step = load._replace(
                disk_force=weight * load.disk_force,
                line_force=weight * load.line_force,
                tension=drive,
                free_length=drive,
            )
            keep, early, late = _creep_weights(path.dt[row] * part, tau)
            raised = 1.0 + float((share * late).sum())
            rest = body.rest + (keep * delayed + share * early * elastic).sum(axis=0)
            now = body._replace(compliance=body.compliance * (softness * raised), rest=rest)
            u_old, T_old = u.copy(), T_base.copy()
            if not equilibrium(u, T_base, mesh, now, step, friction, pose):
                u[:], T_base[:] = u_old, T_old
                part *= 0.5
                if part < SMALLEST:
                    raise NoEquilibrium(f"row {row} of {len(path.drive)}: no balance at drive {drive}, weight {weight}")
                continue
            _commit(friction, pose)
            elastic_old, elastic = elastic, (u - rest) / raised
            delayed[:] = keep * delayed + share * (early * elastic_old + late * elastic)
            done += part
            part *= 2.0
        before = after
        if record.keep[row]:
            record.disk_r[stored] = pose.disk_r
            record.disk_R[stored] = pose.disk_R
            record.length[stored] = pose.length.sum(axis=0)
            record.tension[stored] = T_base * pose.ratio
            record.curvature[stored] = u
            record.moment[stored] = pose.moment
            stored += 1


def _commit(friction: Friction, pose: Pose) -> None:
    friction.z[:] = pose.z
    friction.distal[:] = distal_lengths(pose.length)


def distal_lengths(length: np.ndarray) -> np.ndarray:
    """Path length (N-1, T) from the hole of each inner disk to the tip, from the segments' lengths (N, T)."""
    return np.cumsum(length[:0:-1], axis=0)[::-1]


def _creep_weights(dt: float, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """keep, early, late of the module's docstring."""
    if dt <= 0.0:
        return np.ones_like(tau), np.zeros_like(tau), np.zeros_like(tau)
    x = dt / tau
    keep, mean = np.exp(-x), -np.expm1(-x) / x
    return keep, mean - keep, 1.0 - mean
