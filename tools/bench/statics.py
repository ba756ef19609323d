"""Equilibrium of the rod with rigid disks and tendons: Newton on the moment balance at the Gauss nodes.

    u(s) = u_rest(s) + C(s) R(s)^T m(s)                               Kirchhoff rod, C = compliance (1/(N m^2))
    m(s) = sum_{j distal of s} (r_j - r(s)) x F_j  +  int_s^L (r - r(s)) x w ds  +  sum_i (p_ik - r(s)) x T_ik t_ik

The cut at s in interval k goes through rod and tendons, so of all tendon forces only those of segment k remain. F_j are
dead loads or fields on the disks, w the backbone's weight per length, p_ik the hole of tendon i in the distal disk of
interval k and t_ik the unit vector along its segment towards the base. Everything distal to a bent element turns rigidly
about it, which gives the Jacobian in closed form.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.bench.fields import act
from tools.bench.frames import cross, integrate
from tools.bench.tendons import lay, transmit

BALANCE = 1e-8  # 1/m, curvature residual at which Newton stops: below 1e-7 mm at the tip
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
    by_length: bool


@njit(cache=True, error_model="numpy")
def longer(load, i, tension):
    """By how much (m) tendon i is longer under a tension (N), and the slope: s T + b T / (T + T_b)."""
    over = max(tension, 0.0) + load.bedding_tension
    bedded = load.bedding * (1.0 - load.bedding_tension / over)
    return load.stretch[i] * tension + bedded, load.stretch[i] + load.bedding * load.bedding_tension / over**2


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
    return Pose(
        np.zeros((N, G, 3, 3)),
        np.zeros((N, G, 3)),
        np.zeros((N + 1, 3, 3)),
        np.zeros((N + 1, 3)),
        np.zeros((N + 1, T, 3)),
        np.zeros((N, T, 3)),
        np.zeros((N, T)),
        np.zeros((N, T)),
        np.zeros((N - 1, T, S)),
        np.zeros((N - 1, T)),
        np.zeros((N - 1, T)),
        np.zeros((N - 1, T)),
        np.zeros((N, 3)),
        np.zeros((N, 3, 3)),
        np.zeros((N, 3)),
        np.zeros((N, G, 3)),
    )


@njit(cache=True, error_model="numpy")
def balance(u, T_base, mesh, body, load, friction, pose, F):
    """Residual F of the moment balance (3NG,), followed by the tendons' conditions (T,) if driven by length."""
    N, G, T = u.shape[0], u.shape[1], T_base.shape[0]
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    transmit(load.share, friction, pose.toward_base, pose.length, pose.z, pose.ratio, pose.turns, pose.grip, pose.grip_slope)
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
    if load.by_length:
        for i in range(T):
            gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
            F[3 * N * G + i] = min(T_base[i], TAUT * gap)


@njit(cache=True, error_model="numpy")
def _fill(J, col, bent, T_base, dlog, dT, own, mesh, body, load, pose):
    """Column `col` of the Jacobian.

    bent = (k', q', a, p): an element at node (k', q') turns about axis a through p; k' = N for a tension column.
    dlog (N, T): change of log tension by friction; dT (T,): change of base tension.
    """
    N, G, T = body.pitch.shape[0], mesh.weight.shape[0], T_base.shape[0]
    kb, qb, axis, p = bent
    w = load.line_force
    dn = np.zeros(3)
    dM = np.zeros(3)
    dcut = np.empty(3)
    dMk = np.empty(3)
    dr = np.zeros(3)
    df = np.empty(3)
    f = np.empty(3)
    c = np.empty(3)
    d = np.empty(3)
    dm = np.empty(3)
    drq = np.zeros((G, 3))
    dth = np.zeros(3)
    turned = np.zeros(3)
    if kb < N:
        for a in range(3):
            turned[a] = mesh.weight[qb] * body.pitch[kb] * axis[a]
    for k in range(N - 1, -1, -1):
        h = body.pitch[k]
        moved = k >= kb
        if moved:
            r = pose.disk_r[k + 1]
            for a in range(3):
                d[a] = r[a] - p[a]
            cross(turned, d, dr)
            cross(dr, pose.force[k], c)
            G3 = pose.gradient[k]
            for a in range(3):
                df[a] = G3[a, 0] * dr[0] + G3[a, 1] * dr[1] + G3[a, 2] * dr[2]
                dn[a] += df[a]
                dM[a] += c[a]
            cross(r, df, c)
            for a in range(3):
                dM[a] += c[a]
        for a in range(3):
            dcut[a] = dn[a]
            dMk[a] = dM[a]
        for i in range(T):
            tension = T_base[i] * pose.ratio[k, i]
            rise = tension * dlog[k, i] + pose.ratio[k, i] * dT[i]
            if not moved and rise == 0.0:
                continue
            t, P = pose.toward_base[k, i], pose.hole[k + 1, i]
            if moved:
                for a in range(3):
                    d[a] = P[a] - p[a]
                cross(turned, d, dr)
                if k > kb:
                    cross(turned, t, df)
                else:
                    along = t[0] * dr[0] + t[1] * dr[1] + t[2] * dr[2]
                    for a in range(3):
                        df[a] = (t[a] * along - dr[a]) / pose.length[k, i]
                for a in range(3):
                    f[a] = tension * t[a]
                    df[a] = tension * df[a] + rise * t[a]
                cross(dr, f, c)
                for a in range(3):
                    dMk[a] += c[a]
            else:
                for a in range(3):
                    df[a] = rise * t[a]
            cross(P, df, c)
            for a in range(3):
                dcut[a] += df[a]
                dMk[a] += c[a]
        if moved:
            for q in range(G):
                part = 1.0 if k > kb else mesh.before[q, qb] / mesh.weight[qb]
                for a in range(3):
                    d[a] = part * (pose.node_r[k, q, a] - p[a])
                cross(turned, d, drq[q])
        for q in range(G):
            r = pose.node_r[k, q]
            cross(r, dcut, c)
            for a in range(3):
                dm[a] = dMk[a] - c[a]
            if moved:
                cross(drq[q], pose.cut[k], c)
                d[:] = 0.0
                for j in range(G):
                    for a in range(3):
                        d[a] += mesh.after[q, j] * h * (drq[j, a] - drq[q, a])
                for a in range(3):
                    dm[a] -= c[a]
                cross(d, w, c)
                part = 1.0 if k > kb else mesh.before[q, qb] / mesh.weight[qb]
                for a in range(3):
                    dm[a] += c[a]
                    dth[a] = part * turned[a]
                cross(dth, pose.moment[k, q], c)
                for a in range(3):
                    dm[a] -= c[a]
            R, C = pose.node_R[k, q], body.compliance[k, q]
            for a in range(3):
                d[a] = R[0, a] * dm[0] + R[1, a] * dm[1] + R[2, a] * dm[2]
            for a in range(3):
                J[3 * (k * G + q) + a, col] = -(C[a, 0] * d[0] + C[a, 1] * d[1] + C[a, 2] * d[2])
        if moved:
            for q in range(G):
                cross(drq[q], w, c)
                for a in range(3):
                    dM[a] += mesh.weight[q] * h * c[a]
    if own >= 0:
        J[own, col] += 1.0


@njit(cache=True, error_model="numpy")
def _friction_change(kb, turned, p, friction, pose, dlog):
    """Change of every segment's log tension when all beyond an element of interval kb turns; also of segment kb's length."""
    N, T = pose.length.shape
    dt = np.zeros((2, 3))  # of segments kb and kb+1
    c = np.empty(3)
    d = np.empty(3)
    dlength = np.empty(T)
    for i in range(T):
        t = pose.toward_base[kb, i]
        for a in range(3):
            d[a] = pose.hole[kb + 1, i, a] - p[a]
        cross(turned, d, c)
        along = t[0] * c[0] + t[1] * c[1] + t[2] * c[2]
        dlength[i] = -along
        if friction.mu <= 0.0:
            continue
        for a in range(3):
            dt[0, a] = (t[a] * along - c[a]) / pose.length[kb, i]
        if kb + 1 < N:
            cross(turned, pose.toward_base[kb + 1, i], dt[1])
        loss = 0.0
        for k in range(N - 1):
            if k < kb:  # the hole lies before the bent interval, which is part of its distal length
                loss -= friction.mu * pose.turns[k, i] * pose.grip_slope[k, i] * dlength[i]
            if k in (kb - 1, kb):
                chord, dchord = 0.0, 0.0
                for a in range(3):
                    e = pose.toward_base[k, i, a] - pose.toward_base[k + 1, i, a]
                    chord += e * e
                    dchord += e * (-dt[0, a] if k == kb - 1 else dt[0, a] - dt[1, a])
                chord = np.sqrt(chord)
                if chord > 1e-12:
                    loss += friction.mu * pose.grip[k, i] * dchord / (chord * np.sqrt(1.0 - 0.25 * chord * chord))
            dlog[k + 1, i] = -loss
    return dlength


@njit(cache=True, error_model="numpy")
def jacobian(T_base, mesh, body, load, friction, pose, J):
    N, T = pose.length.shape
    G = mesh.weight.shape[0]
    dlog = np.zeros((N, T))
    dT = np.zeros(T)
    J[:] = 0.0
    size = 3 * N * G
    for kb in range(N):
        for qb in range(G):
            p = pose.node_r[kb, qb]
            for c in range(3):
                col = 3 * (kb * G + qb) + c
                axis = pose.node_R[kb, qb, :, c].copy()
                dlength = _friction_change(kb, mesh.weight[qb] * body.pitch[kb] * axis, p, friction, pose, dlog)
                _fill(J, col, (kb, qb, axis, p), T_base, dlog, dT, col, mesh, body, load, pose)
                if load.by_length:
                    for i in range(T):
                        gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
                        if T_base[i] > TAUT * gap:
                            J[size + i, col] = -TAUT * dlength[i]
    if load.by_length:
        dlog[:] = 0.0
        nowhere = np.zeros(3)
        for i in range(T):
            dT[:] = 0.0
            dT[i] = 1.0
            _fill(J, size + i, (N, 0, nowhere, nowhere), T_base, dlog, dT, -1, mesh, body, load, pose)
            gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
            J[size + i, size + i] = TAUT * longer(load, i, T_base[i])[1] if T_base[i] > TAUT * gap else 1.0


@njit(cache=True, error_model="numpy")
def equilibrium(u, T_base, mesh, body, load, friction, pose, most=30):
    """Newton from the start values u (N, G, 3), T_base (T,), both overwritten. Returns whether it balanced."""
    N, G, T = u.shape[0], u.shape[1], T_base.shape[0]
    size = 3 * N * G
    n = size + (T if load.by_length else 0)
    F = np.zeros(n)
    J = np.zeros((n, n))
    if not load.by_length:
        T_base[:] = load.tension
    balance(u, T_base, mesh, body, load, friction, pose, F)
    for _ in range(most):
        error = np.abs(F).max()
        if error < BALANCE:
            return True
        jacobian(T_base, mesh, body, load, friction, pose, J)
        step = np.linalg.solve(J, F)
        # An interval must not turn by more than 0.3 rad in one step: beyond, the linearisation says nothing.
        bend = np.abs(step[:size]).max() * body.pitch.max()
        scale = min(1.0, 0.3 / bend) if bend > 0.0 else 1.0
        u_old, T_old, best = u.copy(), T_base.copy(), error
        for _ in range(6):
            u[:] = u_old - scale * step[:size].reshape(N, G, 3)
            if load.by_length:
                T_base[:] = T_old - scale * step[size:]
            balance(u, T_base, mesh, body, load, friction, pose, F)
            best = np.abs(F).max()
            if best < error * (1.0 - 1e-3 * scale) or best < BALANCE:
                break
            scale *= 0.5
    return np.abs(F).max() < BALANCE
