"""Force balance of a chain of hinges (and slides) pulled by tendons, and its exact tangent.

Energy of the chain without friction, with elastic energy E_el (elastic.py), tendon segments l_d under tension T_d, masses m at x,
dead forces F at the tip and P at a disk, and disks at a distance `gap` from a wall or post of stiffness k:

    E(q) = E_el(q) + sum_d T_d l_d(q) - sum m g.x - F.x_tip - P.x_disk + 1/2 k sum max(0, -gap)^2

`force_balance` returns r = dE/dq with T_d the tensions that friction leaves, and J = dr/dq. A segment's length depends only on the
hinges between its two holes (none in a thick disk), so its geometric stiffness is a small block. Gravity's Hessian follows from one
vector a hinge, n_i = a_i x M_i (C_i - p_i), with M_i, C_i mass and centre of everything distal of hinge i at p_i with axis a_i:
turning hinge j <= i turns n_i with it. A slide moves along its a_i and turns nothing. Friction adds an unsymmetric rank-one block a
segment.
"""

from typing import NamedTuple

import numpy as np

from twin.effects.contact import obstacle_gap
from twin.effects.tendon_friction import rounded_turn_angle, slip_state
from twin.foundation.by_reference import by_reference, refer_to
from twin.foundation.compiled import assign, assign_vector3, cross, dot, jit, jit_internal
from twin.mechanics.rod.balance.elastic import elastic_forces


@by_reference
class Chain(NamedTuple):
    """Arrays of the compiled model. The first five are views of MuJoCo's arrays and change with its state."""

    anchor: np.ndarray  # (nv, 3) joint positions, m
    axis: np.ndarray  # (nv, 3) joint axes
    subtree_centre: np.ndarray  # (nbody, 3) centre of mass of each subtree, m
    site: np.ndarray  # (nsite, 3) m
    qpos: np.ndarray  # (nv,) rad; m of slides
    stiffness: np.ndarray  # (nv,) N m/rad; N/m
    unit: np.ndarray  # (nv,) scale of each joint: 1 rad; for a slide the length of body that it stretches, m
    is_hinge: np.ndarray  # (nv,) 1 for a hinge, 0 for a slide (float, so that loops have no branch)
    is_twist: np.ndarray  # (nv,) whether a hinge twists
    slenderness: np.ndarray  # (nv,) h^2 / EI of the piece of backbone, 1/N; 0 for twist
    partner: np.ndarray  # (nv,) the hinge about the same axis in the other set of the same piece
    coupling: np.ndarray  # (nv,) N m/rad
    first_bend: np.ndarray  # (n_set,) first of the three hinges of each set
    slide: np.ndarray  # (n_set,) slide of each set, or empty where the body does not stretch
    channel_lever: np.ndarray  # (n_tendon, nv) m, dpath/dq of the straight body; (0, nv) where tendons run from disk to disk
    stiffening: float  # of a body that stretches: 0 for Hooke's law, 1 for the neo-Hookean
    handedness: np.ndarray  # (n_set,) 1 where a set's hinges are right-handed, else -1
    body: np.ndarray  # (nv,) the body each joint moves
    mass: np.ndarray  # (nv,) of everything distal of the joint, kg
    hole: np.ndarray  # (n_tendon, n_hole) sites from the base to the tendon's end; shorter tendons repeat their last site
    n_piece: np.ndarray  # (n_tendon,) number of pieces of each tendon, from hole to hole
    first_joint: np.ndarray  # (n_hole,) joints that move each hole: piece d is on joints first_joint[d] to first_joint[d + 1]
    disk: np.ndarray  # (n_disk,) sites
    disk_joints: np.ndarray  # (n_disk,) how many joints move each disk
    arc: np.ndarray | None  # (n_bend, 4) of rods: a bending hinge, its set, the piece that it bends and the axis, 0 or 1
    arc_length: np.ndarray | None  # (n_tendon, n_piece) m, of rods' pieces on the straight body; 0 beyond their ends
    marker: np.ndarray  # (n_marker,) sites


@by_reference
class ContactLaw(NamedTuple):
    """Friction of the tendons in their holes, and the wall or post that disks press."""

    mu: float  # tendon friction coefficient; 0: none
    presliding: float  # m of travel from sticking to sliding
    wall: np.ndarray  # (10,) as in `Loads`: normal towards the free side, offset (m), stiffness (N/m; 0: no wall), ...


@by_reference
class StaticLoad(NamedTuple):
    """Dead loads of the chain."""

    gravity: np.ndarray  # (3,) m/s^2
    payload: float  # kg at the tip
    force: np.ndarray  # (3,) N at the tip
    push: np.ndarray  # (3,) N at a disk
    pushed: int  # index of that disk, from 0


@by_reference
class StaticSystem(NamedTuple):
    """The system in balance: MuJoCo's model and data by address, the chain, its rest shape, contacts and loads."""

    model: int
    data: int
    chain: Chain
    rest: np.ndarray  # (nv,) phi0 of elastic.py
    law: ContactLaw
    load: StaticLoad


@by_reference
class ChainState(NamedTuple):
    """State of the chain. A solve advances it in place."""

    T: np.ndarray  # (n_tendon,) base tensions, N
    q: np.ndarray  # (nv,) rad; m of slides
    z: np.ndarray  # (n_tendon, n_piece) slip states when last at rest
    s: np.ndarray  # (n_tendon, n_piece) distal tendon lengths then, m; [:, 0] is dE/dT instead; 0 beyond a tendon's end


class TendonPath(NamedTuple):
    """A tendon's course, piece by piece: direction, length (m), turning angle at the piece's start (rad), tension (N)."""

    u: np.ndarray  # (n_piece, 3)
    length: np.ndarray  # (n_piece,)
    theta: np.ndarray  # (n_piece,)
    T: np.ndarray  # (n_piece,)


@jit_internal
def empty_tendon_path(nd):
    """Return uninitialised arrays for a tendon of nd pieces."""
    return TendonPath(np.empty((nd, 3)), np.empty(nd), np.empty(nd), np.empty(nd))


@jit_internal
def first_pieces(path, nd):
    """Return views of the first nd pieces of a longer tendon's arrays."""
    return TendonPath(path.u[:nd], path.length[:nd], path.theta[:nd], path.T[:nd])


@jit
def copy_state(state):
    """Return a copy of the state."""
    return refer_to(ChainState(state.T.copy(), state.q.copy(), state.z.copy(), state.s.copy()))


@jit
def set_state(state, other):
    """Copy `other` into `state`, in place."""
    assign(state.T, other.T)
    assign(state.q, other.q)
    commit_slip(state, other.z, other.s)


@jit_internal
def commit_slip(state, z, s):
    """Store slip states z and distal lengths s as those of the last rest."""
    for t in range(state.T.size):
        assign(state.z[t], z[t])
        assign(state.s[t], s[t])


@jit_internal
def point_velocity(chain, i, point):
    """Return the velocity of `point`, distal of joint i, for unit speed of that joint."""
    axis, anchor, h = chain.axis[i], chain.anchor[i], chain.is_hinge[i]
    c = cross(axis, (point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]))
    s = 1.0 - h  # no branch: it would prevent vectorisation of the loops over joints
    return h * c[0] + s * axis[0], h * c[1] + s * axis[1], h * c[2] + s * axis[2]


@jit_internal
def vector_velocity(chain, i, v):
    """Return the velocity of a vector v fixed distal of joint i, for unit speed of that joint. A slide turns nothing."""
    c = cross(chain.axis[i], v)
    h = chain.is_hinge[i]
    return h * c[0], h * c[1], h * c[2]


@jit_internal
def add_weight(chain, load, r, J):
    """Add gravity of body and payload and the tip force to r and, unless J is empty, to J."""
    nv = r.shape[0]
    g, tip = load.gravity, chain.site[chain.disk[-1]]
    n = np.empty((nv, 3))
    f = np.empty((nv, 3))
    for i in range(nv):
        p, c, m = chain.anchor[i], chain.subtree_centre[chain.body[i]], chain.mass[i]
        b = (tip[0] - p[0], tip[1] - p[1], tip[2] - p[2])
        m_lever = (
            m * (c[0] - p[0]) + load.payload * b[0],
            m * (c[1] - p[1]) + load.payload * b[1],
            m * (c[2] - p[2]) + load.payload * b[2],
        )
        if chain.is_hinge[i] == 0.0:
            a, m = chain.axis[i], m + load.payload
            assign_vector3(n[i], (m * a[0], m * a[1], m * a[2]))
            assign_vector3(f[i], a)
        else:
            assign_vector3(n[i], cross(chain.axis[i], m_lever))
            assign_vector3(f[i], cross(chain.axis[i], b))
        r[i] -= dot(g, n[i]) + dot(load.force, f[i])
    if J.size:
        for j in range(nv):
            b = vector_velocity(chain, j, g)
            c = vector_velocity(chain, j, load.force)
            for i in range(j, nv):
                h = b[0] * n[i, 0] + b[1] * n[i, 1] + b[2] * n[i, 2] + c[0] * f[i, 0] + c[1] * f[i, 1] + c[2] * f[i, 2]
                J[i, j] += h
                if i > j:
                    J[j, i] += h


@jit_internal
def add_push(chain, load, r, J):
    """Add the dead force on a disk to r and, unless J is empty, to J."""
    x, n = chain.site[chain.disk[load.pushed]], chain.disk_joints[load.pushed]
    X = np.empty((n, 3))
    for i in range(n):
        assign_vector3(X[i], point_velocity(chain, i, x))
        r[i] -= dot(load.push, X[i])
    if J.size:
        for j in range(n):
            b = vector_velocity(chain, j, load.push)
            for i in range(j, n):
                h = dot(b, X[i])
                J[i, j] += h
                if i > j:
                    J[j, i] += h


@jit_internal
def add_wall(chain, wall, r, J):
    """Add the penalty force k max(0, -gap) at each disk centre, along the gap's gradient, to r and to J.

    An empty J is left out.
    """
    stiffness = wall[4]
    for k in range(chain.disk.shape[0]):
        x = chain.site[chain.disk[k]]
        gap, normal, across, bend = obstacle_gap(wall, x)
        if gap >= 0.0:
            continue
        f = -stiffness * gap
        n = chain.disk_joints[k]
        X = np.empty((n, 3))
        for i in range(n):
            assign_vector3(X[i], point_velocity(chain, i, x))
            r[i] -= f * dot(normal, X[i])
        if J.size:
            for j in range(n):
                b = vector_velocity(chain, j, normal)  # normal . (a_j x X_i) = -(a_j x normal) . X_i
                push, slip = stiffness * dot(normal, X[j]), f * bend * dot(across, X[j])
                for i in range(j, n):
                    h = f * dot(b, X[i]) + push * dot(normal, X[i]) - slip * dot(across, X[i])
                    J[i, j] += h
                    if i > j:
                        J[j, i] += h


@jit_internal
def trace_tendon(chain, t, tendon, distal):
    """Fill the course of tendon t, all but its tensions, and the length distal of each piece's start, distal (n_piece,) m."""
    u, length, theta = tendon.u, tendon.length, tendon.theta
    nd = length.size
    for d in range(nd):
        a, b = chain.site[chain.hole[t, d]], chain.site[chain.hole[t, d + 1]]
        v = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
        length[d] = np.sqrt(dot(v, v))
        assign_vector3(u[d], (v[0] / length[d], v[1] / length[d], v[2] / length[d]))
    beyond = 0.0
    for d in range(nd - 1, -1, -1):
        beyond += length[d]
        distal[d] = beyond
    theta[0] = 0.0
    for d in range(1, nd):
        v = cross(u[d - 1], u[d])
        theta[d] = np.arctan2(np.sqrt(dot(v, v)), dot(u[d - 1], u[d]))


@jit_internal
def friction_of(law, tension):
    """Return mu with the sign of a base tension: T_d = T_0 exp(-mu sign(T_0) sum z theta).

    Friction on a tendon that slides towards the base points to its tip. So its tension falls from the base on, whether it pulls,
    and |T| falls, or pushes, and |T| rises.
    """
    return law.mu if tension >= 0.0 else -law.mu


@jit_internal
def apply_friction(tension, law, tendon, z0, s0, s, z):
    """Fill the pieces' tensions for a base tension, and slip states z at distal lengths s, after (z0, s0)."""
    T, theta = tendon.T, tendon.theta
    T[0], z[0], wrapped = tension, 0.0, 0.0
    mu = friction_of(law, tension)
    for d in range(1, T.size):
        z[d] = slip_state(z0[d], s0[d] - s[d], law.presliding)
        wrapped += z[d] * rounded_turn_angle(theta[d])[0]
        T[d] = tension * np.exp(-mu * wrapped)


@jit
def force_balance(system, state, z, s, r, J):
    """Compute the residual r (nv,) in N m and, unless J is empty, its derivative J (nv, nv).

    The angles of `state` must be in MuJoCo's data already. Fills z and s (n_tendon, n_piece), the slip states and distal lengths at
    this shape. Returns what the bowing of the compressed backbone takes from each tendon's path (n_tendon,) m, negative.
    """
    chain, law, tension = system.chain, system.law, state.T
    nt, nv, tangent = chain.hole.shape[0], state.q.size, J.size > 0
    bowing = np.zeros(nt)
    elastic_forces(state.q, system.rest, chain, tension, bowing, r, J)
    add_weight(chain, system.load, r, J)
    if system.load.push[0] != 0.0 or system.load.push[1] != 0.0 or system.load.push[2] != 0.0:
        add_push(chain, system.load, r, J)
    if law.wall[4] > 0.0:
        add_wall(chain, law.wall, r, J)
    longest_path, X, dl = empty_tendon_path(chain.hole.shape[1] - 1), np.empty((nv, 3)), np.zeros(nv)
    for t in range(nt):
        nd = chain.n_piece[t]
        tendon = first_pieces(longest_path, nd)
        u, T = tendon.u, tendon.T
        trace_tendon(chain, t, tendon, s[t])
        s[t, 0] += bowing[t]
        apply_friction(tension[t], law, tendon, state.z[t], state.s[t], s[t], z[t])
        for d in range(nd, s.shape[1]):
            s[t, d] = z[t, d] = 0.0
        for d in range(nd):
            b = chain.site[chain.hole[t, d + 1]]
            for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
                assign_vector3(X[i], point_velocity(chain, i, b))
                dl[i] = dot(u[d], X[i])
        for d in range(nd):
            for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
                r[i] += T[d] * dl[i]
                if tangent:
                    b = vector_velocity(chain, i, u[d])
                    for k in range(i, chain.first_joint[d + 1]):
                        h = T[d] * ((dot(X[i], X[k]) - dl[i] * dl[k]) / tendon.length[d] - dot(b, X[k]))
                        J[k, i] += h
                        if k > i:
                            J[i, k] += h
        if tangent and law.mu > 0.0 and tension[t] != 0.0:
            add_friction_tangent(chain, law, tendon, z[t], X, dl, J)
    return bowing


@jit_internal
def add_friction_tangent(chain, law, tendon, z, X, dl, J):
    """Add to J the change with the angles of the tensions that friction leaves: a rank-one block a piece of the tendon."""
    u, length = tendon.u, tendon.length
    nv = chain.first_joint[length.size]  # joints beyond the tendon's end do not change it
    dlog = np.zeros(nv)  # derivative of sum_{j<=d} z_j turn(theta_j)
    for d in range(1, length.size):
        p, v, theta = u[d - 1], u[d], tendon.theta[d]
        co = dot(p, v)
        rounded, slope = rounded_turn_angle(theta)
        f = -z[d] * slope / np.sin(theta) if theta > 1e-9 else -z[d] * 1e3
        w = (p[0] - co * v[0], p[1] - co * v[1], p[2] - co * v[2])
        y = (v[0] - co * p[0], v[1] - co * p[1], v[2] - co * p[2])
        m = cross(v, p)
        for i in range(chain.first_joint[d - 1], chain.first_joint[d]):
            dlog[i] += f * (dot(y, X[i]) / length[d - 1] + chain.is_hinge[i] * dot(chain.axis[i], m))
        for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
            dlog[i] += f * dot(w, X[i]) / length[d]
        if abs(z[d]) < 1.0:
            for i in range(chain.first_joint[d], nv):
                dlog[i] -= rounded / law.presliding * dl[i]
        for i in range(chain.first_joint[d], chain.first_joint[d + 1]):
            f = -law.mu * abs(tendon.T[d]) * dl[i]
            for j in range(nv):
                J[i, j] += f * dlog[j]
