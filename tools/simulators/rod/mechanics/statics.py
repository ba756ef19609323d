"""Moment balance, at the Gauss nodes, of a rod with rigid disks and tendons.

    u(s) = u_rest(s) + C(s) R(s)^T m(s)                               Kirchhoff rod, C = compliance (1/(N m^2))
    m(s) = sum_{j distal of s} (r_j - r(s)) x F_j  +  int_s^L (r - r(s)) x w ds  +  sum_i (p_ik - r(s)) x T_ik t_ik

The cut at s in interval k goes through rod and tendons, so of all tendon forces only those of segment k remain. F_j are
dead loads or fields on the disks, w the backbone's weight per length, p_ik the hole of tendon i in the distal disk of
interval k and t_ik the unit vector along its segment towards the base.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.rod.mechanics.fields import act
from tools.simulators.rod.mechanics.frames import Mesh, cross, integrate
from tools.simulators.rod.mechanics.tendons import Friction, lay, transmit

TAUT = 1e3  # N/m, weighs a tendon's gap against its tension in the slack condition; any positive number is exact


class Body(NamedTuple):
    pitch: np.ndarray  # (N,) m
    compliance: np.ndarray  # (N, G, 3, 3) 1/(N m^2)
    rest: np.ndarray  # (N, G, 3) 1/m
    holes: np.ndarray  # (N+1, T, 3) m, in the disk's frame, base plate first


class Load(NamedTuple):
    disk_force: np.ndarray  # (N, 3) N, dead
    line_force: np.ndarray  # (3,) N/m, dead
    fields: np.ndarray  # (M, 10), see fields.py
    tension: np.ndarray  # (T,) N at the base; ignored if by_length
    share: np.ndarray  # (N, T) prescribed tension of a segment over that at the base
    free_length: np.ndarray  # (T,) m of tendon between base hole and tip, unstretched
    stretch: np.ndarray  # (T,) m/N
    bedding: float  # m by which a tendon beds in, half of it at
    bedding_tension: float  # N
    driven_by_length: bool


@njit(cache=True, error_model="numpy")
def longer(load, i, tension):
    """By how much (m) tendon i is longer under a tension (N), and the slope: s T + b T / (T + T_b)."""
    over = max(tension, 0.0) + load.bedding_tension
    bedded = load.bedding * (1.0 - load.bedding_tension / over)
    return load.stretch[i] * tension + bedded, load.stretch[i] + load.bedding * load.bedding_tension / over**2


class Problem(NamedTuple):
    """A rod with its loads and tendons: all that an equilibrium depends on."""

    mesh: Mesh
    body: Body
    load: Load
    friction: Friction


class Pose(NamedTuple):
    """Everything that follows from curvature and tension; overwritten by `balance`."""

    node_R: np.ndarray  # (N, G, 3, 3)
    node_r: np.ndarray  # (N, G, 3)
    disk_R: np.ndarray  # (N+1, 3, 3)
    disk_r: np.ndarray  # (N+1, 3)
    hole: np.ndarray  # (N+1, T, 3)
    toward_base: np.ndarray  # (N, T, 3)
    length: np.ndarray  # (N, T)
    ratio: np.ndarray  # (N, T) segment tension over base tension
    z: np.ndarray  # (N-1, T, S)
    turns: np.ndarray  # (N-1, T)
    grip: np.ndarray  # (N-1, T)
    grip_slope: np.ndarray  # (N-1, T)
    force: np.ndarray  # (N, 3) on the disks
    gradient: np.ndarray  # (N, 3, 3)
    cut: np.ndarray  # (N, 3) force through the cut of an interval, without its own weight
    moment: np.ndarray  # (N, G, 3) rod moment at the nodes, world frame


@njit(cache=True, error_model="numpy")
def new_pose(N, G, T, S):
    """Return a pose of N intervals with G nodes, T tendons and S sliders a hole, all zero."""
    return Pose(
        np.zeros((N, G, 3, 3)), np.zeros((N, G, 3)), np.zeros((N + 1, 3, 3)), np.zeros((N + 1, 3)), np.zeros((N + 1, T, 3)),
        np.zeros((N, T, 3)), np.zeros((N, T)), np.zeros((N, T)), np.zeros((N - 1, T, S)), np.zeros((N - 1, T)),
        np.zeros((N - 1, T)), np.zeros((N - 1, T)), np.zeros((N, 3)), np.zeros((N, 3, 3)), np.zeros((N, 3)), np.zeros((N, G, 3)),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def balance(u, T_base, problem, pose, F):
    """Residual F of the moment balance (3NG,), followed by the tendons' conditions (T,) if driven by length."""
    mesh, body, load, friction = problem
    N, G, T = u.shape[0], u.shape[1], T_base.shape[0]
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    transmit(load.share, friction, pose)
    pose.force[:] = load.disk_force
    pose.gradient[:] = 0.0
    act(load.fields, pose.disk_r, pose.force, pose.gradient)
    w = load.line_force
    n = np.zeros(3)  # external force distal of the cut, and its moment about the origin
    M = np.zeros(3)
    f = np.empty(3)
    c = np.empty(3)
    m = np.empty(3)
    d = np.empty(3)
    for k in range(N - 1, -1, -1):
        h = body.pitch[k]
        cross(pose.disk_r[k + 1], pose.force[k], c)
        n += pose.force[k]
        M += c
        cut = pose.cut[k]
        cut[:] = n
        Mk = M.copy()
        for i in range(T):
            for a in range(3):
                f[a] = T_base[i] * pose.ratio[k, i] * pose.toward_base[k, i, a]
            cross(pose.hole[k + 1, i], f, c)
            cut += f
            Mk += c
        for q in range(G):
            r = pose.node_r[k, q]
            cross(r, cut, c)
            for a in range(3):
                m[a] = Mk[a] - c[a]
            d[:] = 0.0
            for j in range(G):
                for a in range(3):
                    d[a] += mesh.after[q, j] * h * (pose.node_r[k, j, a] - r[a])
            cross(d, w, c)
            m += c
            pose.moment[k, q] = m
            R, C = pose.node_R[k, q], body.compliance[k, q]
            for a in range(3):
                d[a] = R[0, a] * m[0] + R[1, a] * m[1] + R[2, a] * m[2]
            for a in range(3):
                elastic = C[a, 0] * d[0] + C[a, 1] * d[1] + C[a, 2] * d[2]
                F[3 * (k * G + q) + a] = u[k, q, a] - body.rest[k, q, a] - elastic
        for q in range(G):
            cross(pose.node_r[k, q], w, c)
            for a in range(3):
                M[a] += mesh.weight[q] * h * c[a]
        for a in range(3):
            n[a] += h * w[a]
    if load.driven_by_length:
        for i in range(T):
            gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
            F[3 * N * G + i] = min(T_base[i], TAUT * gap)
