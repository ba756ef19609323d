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

from tools.simulators.rod.mechanics.frames import integrate
from tools.simulators.rod.mechanics.newton import equilibrium
from tools.simulators.rod.mechanics.statics import Pose, Problem, new_pose
from tools.simulators.rod.mechanics.tendons import Friction, lay

SMALLEST_LOAD_PART = 1.0 / 1024  # of a load step; below, the march gives up


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

    @classmethod
    def of(cls, keep: np.ndarray, problem: Problem) -> Record:
        """Return an empty record of the rows to keep (n,)."""
        (N, G), T, m = problem.body.rest.shape[:2], problem.body.holes.shape[1], int(keep.sum())
        return cls(
            keep, np.zeros((m, N + 1, 3)), np.zeros((m, N + 1, 3, 3)), np.zeros((m, T)), np.zeros((m, N, T)),
            np.zeros((m, N, G, 3)), np.zeros((m, N, G, 3)),
        )  # fmt: skip

    def store(self, n: int, pose: Pose, u: np.ndarray, tension: np.ndarray) -> None:
        """Copy a pose with its curvature (N, G, 3) and base tensions (T,) to place n of those kept."""
        self.disk_r[n], self.disk_R[n] = pose.disk_r, pose.disk_R
        self.length[n] = pose.length.sum(axis=0)
        self.tension[n] = tension * pose.ratio
        self.curvature[n], self.moment[n] = u, pose.moment


def start_pose(problem: Problem, u: np.ndarray) -> Pose:
    """Return the pose of curvature u (N, G, 3); friction starts there without slip."""
    mesh, body, _, friction = problem
    pose = new_pose(u.shape[0], u.shape[1], body.holes.shape[1], len(friction.stroke))
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    friction.z[:] = 0.0
    friction.distal[:] = distal_lengths(pose.length)
    return pose


class Standing:
    """A rod in equilibrium with the slip and the delayed strain of its way there, led on row by row."""

    def __init__(self, problem: Problem, creep: Creep | None, softness: float = 1.0) -> None:
        """Unloaded, at rest: curvature = rest + delayed strain, zero slip."""
        body = problem.body
        T = body.holes.shape[1]
        self._problem = problem
        self._delayed = np.zeros((0, *body.rest.shape)) if creep is None else creep.delayed
        share, tau = (np.zeros(0), np.zeros(0)) if creep is None else (creep.share, creep.time)
        self._share, self._tau = share[:, None, None, None], tau[:, None, None, None]
        self.u = body.rest + self._delayed.sum(axis=0)
        self._elastic = np.zeros_like(self.u)
        self.tension = np.zeros(T)  # at the base
        self.pose = start_pose(problem, self.u)
        self._before: tuple = (self.pose.length.sum(axis=0) if problem.load.driven_by_length else np.zeros(T), 0.0, softness)

    def to(self, drive: np.ndarray, weight: float, softness: float, dt: float) -> None:
        """One row on, in parts where that is too far at once. Raises NoEquilibrium."""
        after, share = (drive, weight, softness), self._share
        mesh, body, load, friction = self._problem
        done, part = 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            drive, weight, softness = (a + (done + part) * (b - a) for a, b in zip(self._before, after, strict=True))
            step = load._replace(
                disk_force=weight * load.disk_force, line_force=weight * load.line_force, tension=drive, free_length=drive
            )
            keep, early, late = _creep_weights(dt * part, self._tau)
            raised = 1.0 + float((share * late).sum())
            rest = body.rest + (keep * self._delayed + share * early * self._elastic).sum(axis=0)
            now = body._replace(compliance=body.compliance * (softness * raised), rest=rest)
            u_old, T_old = self.u.copy(), self.tension.copy()
            if not equilibrium(self.u, self.tension, Problem(mesh, now, step, friction), self.pose):
                self.u[:], self.tension[:] = u_old, T_old
                part *= 0.5
                if part < SMALLEST_LOAD_PART:
                    raise NoEquilibrium(f"no balance at drive {drive}, weight {weight}")
                continue
            commit(friction, self.pose)
            elastic_old, self._elastic = self._elastic, (self.u - rest) / raised
            self._delayed[:] = keep * self._delayed + share * (early * elastic_old + late * self._elastic)
            done += part
            part *= 2.0
        self._before = after


def march(problem: Problem, creep: Creep | None, path: Path, record: Record) -> None:
    """March and fill `record`, from the unloaded rod at rest."""
    rod = Standing(problem, creep, path.softness[0])
    stored = 0
    for row in range(len(path.drive)):
        try:
            rod.to(path.drive[row], path.weight[row], path.softness[row], path.dt[row])
        except NoEquilibrium as fault:
            raise NoEquilibrium(f"row {row} of {len(path.drive)}: {fault}") from None
        if record.keep[row]:
            record.store(stored, rod.pose, rod.u, rod.tension)
            stored += 1


def commit(friction: Friction, pose: Pose) -> None:
    """Let friction remember the pose as its last equilibrium."""
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
