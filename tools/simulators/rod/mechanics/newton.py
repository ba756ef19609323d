"""Newton on the moment balance of `statics.py`.

Everything distal to a bent element turns rigidly about it, which gives the Jacobian in closed form.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.rod.mechanics.frames import cross
from tools.simulators.rod.mechanics.statics import TAUT, balance, longer

BALANCE = 1e-8  # 1/m, curvature residual at which Newton stops: below 1e-7 mm at the tip


class Turns(NamedTuple):
    """What each of m columns of the Jacobian changes: an element turns with all beyond it; at interval N tensions alone change."""

    interval: np.ndarray  # (m,)
    node: np.ndarray  # (m,)
    point: np.ndarray  # (m, 3) m, on the axis
    angle: np.ndarray  # (m, 3) rotation vector per unit of the element's curvature, m
    log_tension: np.ndarray  # (m, N, T) change of a segment's log tension by friction
    tension: np.ndarray  # (m, T) change of the base tension


class Moved(NamedTuple):
    """What a turn changes, by interval."""

    force: np.ndarray  # (m, N, 3) external force beyond the cut
    moment: np.ndarray  # (m, N, 3) its moment about the origin
    nodes: np.ndarray  # (m, N, G, 3) displacement of the nodes


@njit(cache=True, error_model="numpy")
def _move_loads(turns, problem, pose, moved):
    """Change of the external force and moment beyond every cut, and of the places of the nodes."""
    mesh, w, N = problem.mesh, problem.load.line_force, pose.length.shape[0]
    dr, df, c, d = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    dn, dM = np.empty(3), np.empty(3)
    for m in range(turns.interval.shape[0]):
        p, turned, kb, qb, nodes = turns.point[m], turns.angle[m], turns.interval[m], turns.node[m], moved.nodes[m]
        dn[:] = 0.0
        dM[:] = 0.0
        for k in range(N - 1, -1, -1):
            if k >= kb:
                r, gradient = pose.disk_r[k + 1], pose.gradient[k]
                for a in range(3):
                    d[a] = r[a] - p[a]
                cross(turned, d, dr)
                cross(dr, pose.force[k], c)
                for a in range(3):
                    df[a] = gradient[a, 0] * dr[0] + gradient[a, 1] * dr[1] + gradient[a, 2] * dr[2]
                    dn[a] += df[a]
                    dM[a] += c[a]
                cross(r, df, c)
                for a in range(3):
                    dM[a] += c[a]
            for a in range(3):
                moved.force[m, k, a] = dn[a]
                moved.moment[m, k, a] = dM[a]
            if k >= kb:
                for q in range(mesh.weight.shape[0]):
                    part = 1.0 if k > kb else mesh.before[q, qb] / mesh.weight[qb]
                    for a in range(3):
                        d[a] = part * (pose.node_r[k, q, a] - p[a])
                    cross(turned, d, nodes[k, q])
                for q in range(mesh.weight.shape[0]):
                    cross(nodes[k, q], w, c)
                    for a in range(3):
                        dM[a] += mesh.weight[q] * problem.body.pitch[k] * c[a]


@njit(cache=True, error_model="numpy")
def _move_tendons(turns, T_base, pose, moved):
    """Add the tendons' change to that of force and moment through every cut."""
    dr, df, c, d, f = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for m in range(turns.interval.shape[0]):
        p, turned, kb = turns.point[m], turns.angle[m], turns.interval[m]
        for k in range(pose.length.shape[0] - 1, -1, -1):
            moves, cut, moment = k >= kb, moved.force[m, k], moved.moment[m, k]
            for i in range(T_base.shape[0]):
                tension = T_base[i] * pose.ratio[k, i]
                rise = tension * turns.log_tension[m, k, i] + pose.ratio[k, i] * turns.tension[m, i]
                if not moves and rise == 0.0:
                    continue
                t, P = pose.toward_base[k, i], pose.hole[k + 1, i]
                if moves:
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
                        moment[a] += c[a]
                else:
                    for a in range(3):
                        df[a] = rise * t[a]
                cross(P, df, c)
                for a in range(3):
                    cut[a] += df[a]
                    moment[a] += c[a]


@njit(cache=True, error_model="numpy")
def _fill(J, turns, problem, pose, moved):
    """Fill the moment balance's rows of the Jacobian (3NG, m)."""
    mesh, w, G = problem.mesh, problem.load.line_force, problem.mesh.weight.shape[0]
    c, d, dm, dth = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for m in range(turns.interval.shape[0]):
        turned, kb, qb, nodes = turns.angle[m], turns.interval[m], turns.node[m], moved.nodes[m]
        for k in range(pose.length.shape[0] - 1, -1, -1):
            h = problem.body.pitch[k]
            for q in range(G):
                cross(pose.node_r[k, q], moved.force[m, k], c)
                for a in range(3):
                    dm[a] = moved.moment[m, k, a] - c[a]
                if k >= kb:
                    cross(nodes[k, q], pose.cut[k], c)
                    d[:] = 0.0
                    for j in range(G):
                        for a in range(3):
                            d[a] += mesh.after[q, j] * h * (nodes[k, j, a] - nodes[k, q, a])
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
                R, C = pose.node_R[k, q], problem.body.compliance[k, q]
                for a in range(3):
                    d[a] = R[0, a] * dm[0] + R[1, a] * dm[1] + R[2, a] * dm[2]
                for a in range(3):
                    J[3 * (k * G + q) + a, m] = -(C[a, 0] * d[0] + C[a, 1] * d[1] + C[a, 2] * d[2])


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
def _turns(T_base, problem, pose, J):
    """Return what each column of J changes, and fill the rows of the tendons' conditions where lengths drive."""
    mesh, body, load, friction = problem
    (N, T), G, m = pose.length.shape, mesh.weight.shape[0], J.shape[0]
    interval, node = np.full(m, N), np.zeros(m, np.int64)
    turns = Turns(interval, node, np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, N, T)), np.zeros((m, T)))
    size = 3 * N * G
    for col in range(size):
        kb, qb, c = col // (3 * G), col // 3 % G, col % 3
        interval[col], node[col] = kb, qb
        turns.point[col] = pose.node_r[kb, qb]
        turns.angle[col] = mesh.weight[qb] * body.pitch[kb] * pose.node_R[kb, qb, :, c].copy()
        dlength = _friction_change(kb, turns.angle[col], turns.point[col], friction, pose, turns.log_tension[col])
        for i in range(m - size):
            gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
            if T_base[i] > TAUT * gap:
                J[size + i, col] = -TAUT * dlength[i]
    for i in range(m - size):
        turns.tension[size + i, i] = 1.0
        gap = load.free_length[i] + longer(load, i, T_base[i])[0] - pose.length[:, i].sum()
        J[size + i, size + i] = TAUT * longer(load, i, T_base[i])[1] if T_base[i] > TAUT * gap else 1.0
    return turns


@njit(cache=True, error_model="numpy")
def jacobian(T_base, problem, pose, J):
    """Fill J, the derivative of `balance` by curvatures and, driven by length, base tensions."""
    (N, G), m = pose.node_r.shape[:2], J.shape[0]
    J[:] = 0.0
    turns = _turns(T_base, problem, pose, J)
    moved = Moved(np.empty((m, N, 3)), np.empty((m, N, 3)), np.empty((m, N, G, 3)))
    _move_loads(turns, problem, pose, moved)
    _move_tendons(turns, T_base, pose, moved)
    _fill(J, turns, problem, pose, moved)
    for col in range(3 * N * G):
        J[col, col] += 1.0


@njit(cache=True, error_model="numpy")
def equilibrium(u, T_base, problem, pose, most=30):
    """Newton from the start values u (N, G, 3), T_base (T,), both overwritten. Returns whether it balanced."""
    load, pitch = problem.load, problem.body.pitch
    N, G, T = u.shape[0], u.shape[1], T_base.shape[0]
    size = 3 * N * G
    n = size + (T if load.driven_by_length else 0)
    F = np.zeros(n)
    J = np.zeros((n, n))
    if not load.driven_by_length:
        T_base[:] = load.tension
    balance(u, T_base, problem, pose, F)
    for _ in range(most):
        error = np.abs(F).max()
        if error < BALANCE:
            return True
        jacobian(T_base, problem, pose, J)
        step = np.linalg.solve(J, F)
        # An interval must not turn by more than 0.3 rad in one step: beyond, the linearisation says nothing.
        bend = np.abs(step[:size]).max() * pitch.max()
        scale = min(1.0, 0.3 / bend) if bend > 0.0 else 1.0
        u_old, T_old, best = u.copy(), T_base.copy(), error
        for _ in range(6):
            u[:] = u_old - scale * step[:size].reshape(N, G, 3)
            if load.driven_by_length:
                T_base[:] = T_old - scale * step[size:]
            balance(u, T_base, problem, pose, F)
            best = np.abs(F).max()
            if best < error * (1.0 - 1e-3 * scale) or best < BALANCE:
                break
            scale *= 0.5
    return np.abs(F).max() < BALANCE
