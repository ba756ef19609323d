"""Elastic energy of the hinge chain, in terms of the true bending of each joint set instead of its hinge angles.

Three successive hinges q turn a set by R = exp(e1 q1) exp(e2 q2) exp(e3 q3). The rod there is bent and twisted by the rotation
vector phi = log R. Springs on q would make bending in a diagonal plane too stiff by phi^2/12 (0.2 % at 9 degrees, 0.5 mm at the tip
under 4 N), so the energy is written in phi:

    E = sum_sets 1/2 (phi - phi0)' K (phi - phi0) + sum_pieces 1/2 (D - D0)' K/6 (D - D0),   D = phi_1 - phi_2

    K -> K (1 - (P h^2 / EI)^2 / 720)

The second term couples the two sets of a piece of backbone. Sets at 1/6 and 5/6 carry a curvature that changes linearly along the
piece with a first moment of 1/9 instead of 1/12; stiffening the antisymmetric bending by 4/3 restores it.

The tendons that reach so far compress the rod together with P. A bowed piece of length h keeps u cot u = 1 - u^2/3 - u^4/45 ... of
its stiffness, u^2 = P h^2 / (4 EI) (beam-column theory). Two sets at 1/6 and 5/6 have the second term by their position; the third
is the factor on K.

Where tendons run in channels of the body it cannot bow away from them. Neither term applies then, and sets may also stretch
(hyperelastic.py).

Rods that push follow the backbone from disk to disk. Where an interval bends by theta such an arc is longer than its chord by
l theta^2/24, l = h + sum of lever and bend, and E has T times that more. Of a rod under P this takes back the second term, and the
third does not apply.
"""

import numpy as np

from twin.foundation.compiled import jit_internal
from twin.mechanics.rod.balance.hyperelastic import BentChain, add_stretch_forces

SET_COUPLING = 1.0 / 6.0  # of a set's stiffness, between the two sets of a piece
BEAM_COLUMN = 720.0  # divisor of the third term of beam-column theory
SERIES_LIMIT = 0.02  # sin^2 of half the angle (16 degrees) below which the series are exact to 1e-9
DERIVATIVE_STEP = 1e-6  # rad, finite difference of dphi/dq


@jit_internal
def rotation_vector(q, i, hand, phi, D):
    """Compute phi (3,) and dphi/dq, D (3, 3), of the set whose hinges are i, i+1, i+2, in its hinge axes.

    `hand` = e1 x e2 . e3. phi' = J_r^-1(phi) w, with w the angular velocity in the distal frame and J_r^-1 = 1 + [phi]/2 + k
    [phi]^2.
    """
    c1, s1 = np.cos(0.5 * q[i]), np.sin(0.5 * q[i])
    c2, s2 = np.cos(0.5 * q[i + 1]), np.sin(0.5 * q[i + 1])
    c3, s3 = np.cos(0.5 * q[i + 2]), np.sin(0.5 * q[i + 2])
    w = c1 * c2 * c3 - hand * s1 * s2 * s3
    x = s1 * c2 * c3 + hand * c1 * s2 * s3
    y = c1 * s2 * c3 - hand * s1 * c2 * s3
    z = c1 * c2 * s3 + hand * s1 * s2 * c3
    n2 = x * x + y * y + z * z
    if n2 < SERIES_LIMIT:  # series of 2 asin(n) / n
        scale = 2.0 + n2 * (1.0 / 3.0 + n2 * (3.0 / 20.0 + n2 * (5.0 / 56.0 + n2 * 35.0 / 576.0)))
    else:
        n = np.sqrt(n2)
        scale = 2.0 * np.arctan2(n, w) / n
    phi[0], phi[1], phi[2] = scale * x, scale * y, scale * z
    t2 = scale * scale * n2
    if n2 < SERIES_LIMIT:
        k = 1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 + t2 / 1209600.0))
    else:
        half = 0.5 * np.sqrt(t2)
        k = (1.0 - half * np.cos(half) / np.sin(half)) / t2
    C2, S2 = c2 * c2 - s2 * s2, 2.0 * s2 * c2
    C3, S3 = c3 * c3 - s3 * s3, 2.0 * s3 * c3
    a, b, c = phi[0], phi[1], phi[2]
    for m in range(3):
        if m == 0:
            u0, u1, u2 = C2 * C3, -hand * C2 * S3, hand * S2
        elif m == 1:
            u0, u1, u2 = hand * S3, C3, 0.0
        else:
            u0, u1, u2 = 0.0, 0.0, 1.0
        v0, v1, v2 = hand * (b * u2 - c * u1), hand * (c * u0 - a * u2), hand * (a * u1 - b * u0)
        D[0, m] = u0 + 0.5 * v0 + k * hand * (b * v2 - c * v1)
        D[1, m] = u1 + 0.5 * v1 + k * hand * (c * v0 - a * v2)
        D[2, m] = u2 + 0.5 * v2 + k * hand * (a * v1 - b * v0)


@jit_internal
def rotation_vectors(q, chain, phi, D):
    """Compute phi (nv,) and dphi/dq, D (n_set, 3, 3), of all sets. A slide is its own phi."""
    for j in range(chain.handedness.size):
        o = chain.first_bend[j]
        rotation_vector(q, o, chain.handedness[j], phi[o : o + 3], D[j])
    for i in chain.slide:
        phi[i] = q[i]


@jit_internal
def joint_compression(chain, tension, P):
    """Fill P (nv,) N, the compression at each joint: the sum of the tensions of the tendons that reach beyond it."""
    for i in range(P.size):
        P[i] = 0.0
    for t in range(tension.size):
        for i in range(chain.first_joint[chain.n_piece[t]]):
            P[i] += tension[t]


@jit_internal
def arc_excess(arc, chain, phi, excess, gradient):
    """Fill by how much rods' arcs exceed their chords, excess (n_tendon,) m, and its derivative by phi, gradient (n_tendon, nv)."""
    nt, nd = chain.arc_length.shape
    theta, length = np.zeros((nd, 2)), chain.arc_length.copy()
    for i, _, d, a in arc:
        theta[d, a] += phi[i]
        for t in range(nt):
            length[t, d] += chain.channel_lever[t, i] * phi[i]
    for t in range(nt):
        excess[t] = 0.0
        for d in range(nd):
            if chain.arc_length[t, d] > 0.0:
                excess[t] += length[t, d] * (theta[d, 0] ** 2 + theta[d, 1] ** 2) / 24.0
        for i in range(phi.size):
            gradient[t, i] = 0.0
        for i, _, d, a in arc:
            if chain.arc_length[t, d] > 0.0:
                square = theta[d, 0] ** 2 + theta[d, 1] ** 2
                gradient[t, i] = chain.channel_lever[t, i] * square / 24.0 + length[t, d] * theta[d, a] / 12.0


@jit_internal
def add_arc_moments(arc, chain, tension, bent, bowing):
    """Add rods' arcs to the moments bent.m (nv,) and to bowing (n_tendon,) m."""
    if arc is not None:  # tendons' type is None: none of this is compiled for them
        excess, gradient = np.empty(tension.size), np.empty((tension.size, bent.phi.size))
        arc_excess(arc, chain, bent.phi, excess, gradient)
        for t in range(tension.size):
            bowing[t] += excess[t]
            for i in range(bent.phi.size):
                bent.m[i] += tension[t] * gradient[t, i]


@jit_internal
def add_arc_stiffness(arc, chain, tension, bent, J):
    """Add to J what the moments of rods' arcs change with phi."""
    if arc is not None:  # tendons' type is None: none of this is compiled for them
        phi, D, first = bent.phi, bent.D, chain.first_bend
        nt, nd = chain.arc_length.shape
        theta, pull = np.zeros((nd, 2)), np.zeros(nd)  # bends, and sum of T l
        lever = np.zeros(phi.size)  # sum of T lever
        for t in range(nt):
            for d in range(nd):
                pull[d] += tension[t] * chain.arc_length[t, d]
            for i, _, d, _ in arc:
                if chain.arc_length[t, d] > 0.0:
                    pull[d] += tension[t] * chain.channel_lever[t, i] * phi[i]
                    lever[i] += tension[t] * chain.channel_lever[t, i]
        for i, _, d, a in arc:
            theta[d, a] += phi[i]
        for i, j, d, a in arc:
            for k, n, e, b in arc:
                if d == e:
                    h = (lever[i] * theta[d, b] + lever[k] * theta[d, a] + (pull[d] if a == b else 0.0)) / 12.0
                    for p in range(3):
                        for q in range(3):
                            J[first[j] + p, first[n] + q] += D[j, i - first[j], p] * h * D[n, k - first[n], q]


@jit_internal
def add_arc_gradients(arc, chain, path_gradient, pull):
    """Add rods' arcs to dpath/dq and to dr/dT, (n_tendon, nv) each, at the angles in MuJoCo's data."""
    if arc is not None:  # tendons' type is None: none of this is compiled for them
        nt, nv = path_gradient.shape
        phi, D = np.empty(nv), np.empty((chain.handedness.size, 3, 3))
        excess, gradient = np.empty(nt), np.empty((nt, nv))
        rotation_vectors(chain.qpos, chain, phi, D)
        arc_excess(arc, chain, phi, excess, gradient)
        for t in range(nt):
            for i, j, _, _ in arc:
                o = chain.first_bend[j]
                for p in range(3):
                    change = D[j, i - o, p] * gradient[t, i]
                    path_gradient[t, o + p] += change
                    pull[t, o + p] += change


@jit_internal
def elastic_forces(q, rest, chain, tension, bowing, r, J):
    """Write r = dE/dq (nv,) and, unless J is empty, J = d2E/dq2 (nv, nv).

    Also writes bowing (n_tendon,), dE/dT (m): the change of each tendon's path by bowing and by the spreading of its channel.
    `rest` is phi0 (nv,), `tension` (n_tendon,) N at the base.
    """
    nv, hand, partner, coupling, stiffness = q.size, chain.handedness, chain.partner, chain.coupling, chain.stiffness
    bent = BentChain(q, rest, np.empty(nv), np.empty((hand.size, 3, 3)), np.empty(nv), np.empty(nv))
    phi, D, K, m, bowed = bent.phi, bent.D, bent.K, bent.m, np.empty(nv)
    rotation_vectors(q, chain, phi, D)
    joint_compression(chain, tension, K)
    for i in range(nv):
        p, P = partner[i], K[i]
        softer = stiffness[i] * P * chain.slenderness[i] ** 2 / BEAM_COLUMN
        K[i] = stiffness[i] - softer * P
        bowed[i] = softer * (phi[i] - rest[i]) ** 2
        m[i] = K[i] * (phi[i] - rest[i]) + coupling[i] * (phi[i] - rest[i] - phi[p] + rest[p])
    for t in range(tension.size):
        bowing[t] = 0.0
        for i in range(chain.first_joint[chain.n_piece[t]]):
            bowing[t] -= bowed[i]
    if J.size:
        for i in range(nv):
            for k in range(nv):
                J[i, k] = 0.0
    add_arc_moments(chain.arc, chain, tension, bent, bowing)
    for j in range(hand.size):
        if chain.slide.size:
            add_stretch_forces(j, chain, tension, bent, bowing, r, J)
        o = chain.first_bend[j]
        for b in range(3):
            r[o + b] = D[j, 0, b] * m[o] + D[j, 1, b] * m[o + 1] + D[j, 2, b] * m[o + 2]
    if J.size == 0:
        return
    add_arc_stiffness(chain.arc, chain, tension, bent, J)
    phi1, D1, moved = np.empty(3), np.empty((3, 3)), np.empty(3)
    for j in range(hand.size):
        o = chain.first_bend[j]
        for b in range(3):
            for k in range(3):
                moved[k] = q[o + k]
            moved[b] += DERIVATIVE_STEP
            rotation_vector(moved, 0, hand[j], phi1, D1)
            for a in range(3):
                h = 0.0
                for c in range(3):
                    h += (
                        D[j, c, a] * (K[o + c] + coupling[o + c]) * D[j, c, b]
                        + m[o + c] * (D1[c, a] - D[j, c, a]) / DERIVATIVE_STEP
                    )
                J[o + a, o + b] += 0.5 * h
                J[o + b, o + a] += 0.5 * h
        for c in range(3):
            p = partner[o + c]
            if p == o + c:  # a set without a partner
                continue
            other = j ^ 1  # of its piece
            for a in range(3):
                for b in range(3):
                    J[o + a, chain.first_bend[other] + b] -= D[j, c, a] * coupling[o + c] * D[other, p - chain.first_bend[other], b]
