"""The balance of forces of a chain of hinges (and slides) pulled by tendons, and its exact tangent.

Energy of the chain without friction, with elastic energy E_el (elastic.py), tendon segments l_d under tension T_d,
masses m at x, dead forces F at the tip and P at a disk, and disks at a distance `gap` from a wall or post of stiffness k:

    E(q) = E_el(q) + sum_d T_d l_d(q) - sum m g.x - F.x_tip - P.x_disk + 1/2 k sum max(0, -gap)^2

`balance` returns r = dE/dq with T_d the tensions that friction leaves, and J = dr/dq. A segment's length depends only on
the hinges between its two holes (none in a thick disk), so its geometric stiffness is a small block; gravity's Hessian follows
from one vector a hinge, n_i = a_i x M_i (C_i - p_i) (M_i, C_i mass and centre of everything distal of hinge i at p_i with axis
a_i), since turning hinge j <= i turns n_i with it (a slide moves along its a_i and turns nothing); friction adds an unsymmetric
rank-one block a segment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import assign, cross, dot, inner, jit, put
from twin.effects.contact import touch
from twin.effects.tendon_friction import slip_state, turn
from twin.equilibrium.elastic import springs


class Chain(NamedTuple):
    """The compiled model as the solver sees it; the first five are views of MuJoCo's arrays and move with it."""

    anchor: np.ndarray  # (nv, 3) joint positions, m
    axis: np.ndarray  # (nv, 3) joint axes
    centre: np.ndarray  # (nbody, 3) centre of mass of each subtree, m
    site: np.ndarray  # (nsite, 3) m
    qpos: np.ndarray  # (nv,) rad; m of slides
    stiffness: np.ndarray  # (nv,) N m/rad; N/m
    unit: np.ndarray  # (nv,) what counts as one: 1 rad; the length of body a slide stretches, m
    hinge: np.ndarray  # (nv,) 1 for a hinge, 0 for a slide
    twists: np.ndarray  # (nv,) whether a hinge twists
    slender: np.ndarray  # (nv,) h^2 / EI of the piece of backbone, 1/N; 0 for twist
    partner: np.ndarray  # (nv,) the hinge about the same axis in the other set of the piece
    coupling: np.ndarray  # (nv,) N m/rad
    bends: np.ndarray  # (n_set,) first of the three hinges of each set
    slide: np.ndarray  # (n_set,) slide of each set, or empty
    lever: np.ndarray  # (n_tendon, nv) m, dpath/dq of the straight body at rest; or (0, nv) where tendons run from disk to disk
    stiffening: float  # of a body that stretches: 0 Hooke's law, 1 the neo-Hookean
    hand: np.ndarray  # (n_set,) 1 where a set's hinges are right-handed, else -1
    body: np.ndarray  # (nv,) the body each joint moves
    mass: np.ndarray  # (nv,) of everything distal of the joint, kg
    hole: np.ndarray  # (n_tendon, n_hole) sites, base to where the tendon ends, then that one again
    pieces: np.ndarray  # (n_tendon,) how many pieces each tendon has, from hole to hole
    first: np.ndarray  # (n_hole,) how many joints move each hole: piece d lies on joints first[d] to first[d + 1], if any
    disk: np.ndarray  # (n_disk,) sites
    below: np.ndarray  # (n_disk,) how many joints move each disk
    marker: np.ndarray  # (n_marker,) sites


class Law(NamedTuple):
    """What acts on the chain besides springs, tendons and weight."""

    mu: float  # tendon friction coefficient; 0: none
    presliding: float  # m of travel from sticking to sliding
    wall: np.ndarray  # (10,) of `Loads`: normal towards the free side, offset (m), stiffness (N/m; 0: no wall), ...


class Load(NamedTuple):
    gravity: np.ndarray  # (3,) m/s^2
    payload: float  # kg at the tip
    force: np.ndarray  # (3,) N at the tip
    push: np.ndarray  # (3,) N at a disk
    pushed: int  # which, from 0


class Statics(NamedTuple):
    """What is in balance: MuJoCo's model and data by address, the chain, its rest shape, and what acts on it."""

    model: int
    data: int
    chain: Chain
    rest: np.ndarray  # (nv,) phi0 of elastic.py
    law: Law
    load: Load


class State(NamedTuple):
    """Where the chain stands; a solve moves it in place."""

    T: np.ndarray  # (n_tendon,) base tensions, N
    q: np.ndarray  # (nv,) rad; m of slides
    z: np.ndarray  # (n_tendon, n_piece) slip states when last at rest
    s: np.ndarray  # (n_tendon, n_piece) distal tendon lengths then, m; [:, 0], which no hole needs, is dE/dT; 0 beyond the end


class Laid(NamedTuple):
    """A tendon as it lies, by piece: direction, length (m), the angle it turns at the piece's start (rad), tension (N)."""

    u: np.ndarray  # (n_piece, 3)
    length: np.ndarray  # (n_piece,)
    theta: np.ndarray  # (n_piece,)
    T: np.ndarray  # (n_piece,)


@inner
def laid(nd):
    """Room for a tendon of nd pieces."""
    return Laid(np.empty((nd, 3)), np.empty(nd), np.empty(nd), np.empty(nd))


@inner
def shorter(room, nd):
    """The room for one of nd pieces, in the room for a longer one."""
    return Laid(room.u[:nd], room.length[:nd], room.theta[:nd], room.T[:nd])


@jit
def copied(state):
    return State(state.T.copy(), state.q.copy(), state.z.copy(), state.s.copy())


@jit
def become(state, other):
    """state = other, in place."""
    assign(state.T, other.T)
    assign(state.q, other.q)
    settle(state, other.z, other.s)


@inner
def settle(state, z, s):
    """The slip states and distal lengths the state comes to rest with."""
    for t in range(state.T.size):
        assign(state.z[t], z[t])
        assign(state.s[t], s[t])


@inner
def lever(chain, i, point):
    """Velocity of `point`, distal of joint i, for unit speed of that joint."""
    axis, anchor, h = chain.axis[i], chain.anchor[i], chain.hinge[i]
    c = cross(axis, (point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]))
    s = 1.0 - h  # no branch: it would keep the loops over joints from being vectorised
    return h * c[0] + s * axis[0], h * c[1] + s * axis[1], h * c[2] + s * axis[2]


@inner
def turned(chain, i, v):
    """Velocity of a vector v that is fixed distal of joint i, for unit speed of that joint: a slide turns nothing."""
    c = cross(chain.axis[i], v)
    h = chain.hinge[i]
    return h * c[0], h * c[1], h * c[2]


@inner
def _add_weight(chain, load, r, J):
    nv = r.shape[0]
    g, tip = load.gravity, chain.site[chain.disk[-1]]
    n = np.empty((nv, 3))
    f = np.empty((nv, 3))
    for i in range(nv):
        p, c, m = chain.anchor[i], chain.centre[chain.body[i]], chain.mass[i]
        b = (tip[0] - p[0], tip[1] - p[1], tip[2] - p[2])
        m_lever = (
            m * (c[0] - p[0]) + load.payload * b[0],
            m * (c[1] - p[1]) + load.payload * b[1],
            m * (c[2] - p[2]) + load.payload * b[2],
        )
        if chain.hinge[i] == 0.0:
            a, m = chain.axis[i], m + load.payload
            put(n[i], (m * a[0], m * a[1], m * a[2]))
            put(f[i], a)
        else:
            put(n[i], cross(chain.axis[i], m_lever))
            put(f[i], cross(chain.axis[i], b))
        r[i] -= dot(g, n[i]) + dot(load.force, f[i])
    if J.size:
        for j in range(nv):
            b = turned(chain, j, g)
            c = turned(chain, j, load.force)
            for i in range(j, nv):
                h = b[0] * n[i, 0] + b[1] * n[i, 1] + b[2] * n[i, 2] + c[0] * f[i, 0] + c[1] * f[i, 1] + c[2] * f[i, 2]
                J[i, j] += h
                if i > j:
                    J[j, i] += h


@inner
def push_force(chain, load, r, J):
    """The dead force on a disk, added to r and, unless it is empty, J."""
    x, n = chain.site[chain.disk[load.pushed]], chain.below[load.pushed]
    X = np.empty((n, 3))
    for i in range(n):
        put(X[i], lever(chain, i, x))
        r[i] -= dot(load.push, X[i])
    if J.size:
        for j in range(n):
            b = turned(chain, j, load.push)
            for i in range(j, n):
                h = dot(b, X[i])
                J[i, j] += h
                if i > j:
                    J[j, i] += h


@inner
def wall_force(chain, wall, r, J):
    """Penalty force k max(0, -gap) along the gap's gradient at each disk centre, added to r and, unless it is empty, J."""
    stiffness = wall[4]
    for k in range(chain.disk.shape[0]):
        x = chain.site[chain.disk[k]]
        gap, normal, across, bend = touch(wall, x)
        if gap >= 0.0:
            continue
        f = -stiffness * gap
        n = chain.below[k]
        X = np.empty((n, 3))
        for i in range(n):
            put(X[i], lever(chain, i, x))
            r[i] -= f * dot(normal, X[i])
        if J.size:
            for j in range(n):
                b = turned(chain, j, normal)  # normal . (a_j x X_i) = -(a_j x normal) . X_i
                push, slip = stiffness * dot(normal, X[j]), f * bend * dot(across, X[j])
                for i in range(j, n):
                    h = f * dot(b, X[i]) + push * dot(normal, X[i]) - slip * dot(across, X[i])
                    J[i, j] += h
                    if i > j:
                        J[j, i] += h


@inner
def lay(chain, t, tendon, distal):
    """Lays tendon t: all of `tendon` but its tensions, and what lies beyond the start of each piece, distal (n_piece,) m."""
    u, length, theta = tendon.u, tendon.length, tendon.theta
    nd = length.size
    for d in range(nd):
        a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
        v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
        length[d] = np.sqrt(dot(v, v))
        put(u[d], (v[0] / length[d], v[1] / length[d], v[2] / length[d]))
    beyond = 0.0
    for d in range(nd - 1, -1, -1):
        beyond += length[d]
        distal[d] = beyond
    theta[0] = 0.0
    for d in range(1, nd):
        v = cross(u[d - 1], u[d])
        theta[d] = np.arctan2(np.sqrt(dot(v, v)), dot(u[d - 1], u[d]))


@inner
def pass_on(tension, law, tendon, z0, s0, s, z):
    """Tensions of the pieces under that at the base, and slip states z at distal lengths s, after (z0, s0)."""
    T, theta = tendon.T, tendon.theta
    T[0], z[0], wrapped = tension, 0.0, 0.0
    for d in range(1, T.size):
        z[d] = slip_state(z0[d], s0[d] - s[d], law.presliding)
        wrapped += z[d] * turn(theta[d])[0]
        T[d] = tension * np.exp(-law.mu * wrapped)


@jit
def balance(at, state, z, s, r, J):
    """Residual r (nv,) in N m and, unless J is empty, its derivative J (nv, nv), of the `state` whose angles are in MuJoCo's data
    already; returns what the bowing of the pressed backbone takes from each tendon's path (n_tendon,) m, negative.

    (z, s) (n_tendon, n_piece) is what slip states and distal lengths become there.
    """
    chain, law, tension = at.chain, at.law, state.T
    nt, nv, tangent = chain.hole.shape[0], state.q.size, J.size > 0
    bowing = np.zeros(nt)
    springs(state.q, at.rest, chain, tension, bowing, r, J)
    _add_weight(chain, at.load, r, J)
    if at.load.push[0] != 0.0 or at.load.push[1] != 0.0 or at.load.push[2] != 0.0:
        push_force(chain, at.load, r, J)
    if law.wall[4] > 0.0:
        wall_force(chain, law.wall, r, J)
    room, X, dl = laid(chain.hole.shape[1] - 1), np.empty((nv, 3)), np.zeros(nv)
    for t in range(nt):
        nd = chain.pieces[t]
        tendon = shorter(room, nd)
        u, T = tendon.u, tendon.T
        lay(chain, t, tendon, s[t])
        s[t, 0] += bowing[t]
        pass_on(tension[t], law, tendon, state.z[t], state.s[t], s[t], z[t])
        for d in range(nd, s.shape[1]):
            s[t, d] = z[t, d] = 0.0
        for d in range(nd):
            b = chain.site[chain.hole[t, d + 1]]
            for i in range(chain.first[d], chain.first[d + 1]):
                put(X[i], lever(chain, i, b))
                dl[i] = dot(u[d], X[i])
        for d in range(nd):
            for i in range(chain.first[d], chain.first[d + 1]):
                r[i] += T[d] * dl[i]
                if tangent:
                    b = turned(chain, i, u[d])
                    for k in range(i, chain.first[d + 1]):
                        h = T[d] * ((dot(X[i], X[k]) - dl[i] * dl[k]) / tendon.length[d] - dot(b, X[k]))
                        J[k, i] += h
                        if k > i:
                            J[i, k] += h
        if tangent and law.mu > 0.0 and tension[t] > 0.0:
            _add_friction(chain, law, tendon, z[t], X, dl, J)
    return bowing


@inner
def _add_friction(chain, law, tendon, z, X, dl, J):
    """What J gains as the tension that friction leaves changes with the angles: a rank-one block a piece of the tendon."""
    u, length = tendon.u, tendon.length
    nv = chain.first[length.size]  # joints beyond the tendon's end do not change it
    dlog = np.zeros(nv)  # derivative of sum_{j<=d} z_j turn(theta_j)
    for d in range(1, length.size):
        p, v, theta = u[d - 1], u[d], tendon.theta[d]
        co = dot(p, v)
        rounded, slope = turn(theta)
        f = -z[d] * slope / np.sin(theta) if theta > 1e-9 else -z[d] * 1e3
        w = (p[0] - co * v[0], p[1] - co * v[1], p[2] - co * v[2])
        y = (v[0] - co * p[0], v[1] - co * p[1], v[2] - co * p[2])
        m = cross(v, p)
        for i in range(chain.first[d - 1], chain.first[d]):
            dlog[i] += f * (dot(y, X[i]) / length[d - 1] + chain.hinge[i] * dot(chain.axis[i], m))
        for i in range(chain.first[d], chain.first[d + 1]):
            dlog[i] += f * dot(w, X[i]) / length[d]
        if abs(z[d]) < 1.0:
            for i in range(chain.first[d], nv):
                dlog[i] -= rounded / law.presliding * dl[i]
        for i in range(chain.first[d], chain.first[d + 1]):
            f = -law.mu * tendon.T[d] * dl[i]
            for j in range(nv):
                J[i, j] += f * dlog[j]
