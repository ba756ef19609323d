"""Tendons through silicone: straight between material points, anchored in the last; their effect on the nodes.

The tension of tendon t beyond point d is T_t share_td, share = exp(-mu sum_{j<=d} z_j theta_j), by the law of `tendon_friction`:
theta_j is the angle it turns at inner point j, z_j the slip state there, which follows the travel past j.
"""

from typing import NamedTuple

import numpy as np

from twin.effects.tendon_friction import rounded_turn_angle, slip_state
from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal

SHORTEST_SEGMENT = 1e-9  # m, of a segment


@by_reference
class Cables(NamedTuple):
    """Points at rest (t, p, 3) m and their weights of the free nodes, (t, p, n_free)."""

    rest: np.ndarray
    weights: np.ndarray


@by_reference
class TendonForces(NamedTuple):
    """The tendons at a shape. Slip states and distal lengths are those that they would commit there."""

    path: np.ndarray  # (t,) m
    gradient: np.ndarray  # (t, n) dpath/du
    pull: np.ndarray  # (t, n) force of a unit tension
    tangent: np.ndarray  # (t, p - 1, 3)
    segment: np.ndarray  # (t, p - 1) m
    share: np.ndarray  # (t, p - 1) of the tension
    slip: np.ndarray  # (t, p - 2) slip states
    distal: np.ndarray  # (t, p - 2) m, lengths distal of each inner point


def unloaded_tendons(cables: Cables) -> TendonForces:
    """Return arrays for the tendons, without tension or travel."""
    nt, points, free = cables.weights.shape
    return TendonForces(
        np.zeros(nt), np.zeros((nt, 3 * free)), np.zeros((nt, 3 * free)), np.zeros((nt, points - 1, 3)), np.zeros((nt, points - 1)),
        np.ones((nt, points - 1)), np.zeros((nt, points - 2)), np.zeros((nt, points - 2)),
    )  # fmt: skip


@jit
def trace_tendons(cables, u, slip, before, mu, presliding, out):
    """Fill `out` for nodal displacements u (n_free, 3) m.

    `slip` and `before` are the slip states and distal lengths at the last rest.
    """
    nt, points, _ = cables.weights.shape
    for t in range(nt):
        x = cables.rest[t] + np.dot(cables.weights[t], u)
        out.path[t] = 0.0
        for d in range(points - 1):
            length = 0.0
            for i in range(3):
                out.tangent[t, d, i] = x[d + 1, i] - x[d, i]
                length += out.tangent[t, d, i] ** 2
            length = max(np.sqrt(length), SHORTEST_SEGMENT)
            out.segment[t, d] = length
            out.path[t] += length
            for i in range(3):
                out.tangent[t, d, i] /= length
        friction_shares(t, slip, before, mu, presliding, out)
        push = np.zeros((2, points, 3))
        for d in range(points - 1):
            for i in range(3):
                push[0, d + 1, i] += out.tangent[t, d, i]
                push[0, d, i] -= out.tangent[t, d, i]
                push[1, d + 1, i] += out.share[t, d] * out.tangent[t, d, i]
                push[1, d, i] -= out.share[t, d] * out.tangent[t, d, i]
        out.gradient[t] = np.dot(cables.weights[t].T, push[0]).ravel()
        out.pull[t] = np.dot(cables.weights[t].T, push[1]).ravel()


@jit_internal
def friction_shares(t, slip, before, mu, presliding, out):
    """Fill the share of the tension of tendon t that friction leaves in each segment, and its slip."""
    distal, wrapped = out.path[t], 0.0
    n = out.segment.shape[1]
    out.share[t, 0] = 1.0
    for d in range(1, n):
        distal -= out.segment[t, d - 1]
        out.distal[t, d - 1] = distal
        cosine = 0.0
        for i in range(3):
            cosine += out.tangent[t, d - 1, i] * out.tangent[t, d, i]
        z = slip_state(slip[t, d - 1], before[t, d - 1] - distal, presliding)
        out.slip[t, d - 1] = z
        wrapped += z * rounded_turn_angle(np.arccos(min(1.0, cosine)))[0]
        out.share[t, d] = np.exp(-mu * wrapped)


@jit
def add_geometric_stiffness(cables, tension, tendons, K):
    """Add to K (n, n) the geometric stiffness of the tendons' own directions."""
    nt, points, free = cables.weights.shape
    for t in range(nt):
        if tension[t] <= 0.0:
            continue
        difference = cables.weights[t, 1:] - cables.weights[t, :-1]  # (p - 1, n_free)
        scaled = np.empty_like(difference)
        for i in range(3):
            for k in range(3):
                for d in range(points - 1):
                    v = tendons.tangent[t, d]
                    across = (1.0 if i == k else 0.0) - v[i] * v[k]
                    across *= tension[t] * tendons.share[t, d] / tendons.segment[t, d]
                    for a in range(free):
                        scaled[d, a] = across * difference[d, a]
                K[i::3, k::3] += np.dot(difference.T, scaled)


@jit
def add_sticking_stiffness(cables, tension, tendons, mu, presliding, K):
    """Add to K the change of friction where tendons stick: d share_d = -mu share_d sum_{j<=d} theta_j dz_j."""
    nt, points, free = cables.weights.shape
    tail, front = np.empty((points - 2, 3 * free)), np.empty((points - 2, 3 * free))
    for t in range(nt):
        if tension[t] <= 0.0:
            continue
        back, gained = np.zeros(3 * free), np.zeros(3 * free)
        for d in range(points - 2, 0, -1):  # inner points, from the tip
            for a in range(free):
                w = cables.weights[t, d + 1, a] - cables.weights[t, d, a]
                for i in range(3):
                    back[3 * a + i] += w * tendons.tangent[t, d, i]
                    gained[3 * a + i] += w * tendons.tangent[t, d, i] * tendons.share[t, d]
            cosine = 0.0
            for i in range(3):
                cosine += tendons.tangent[t, d - 1, i] * tendons.tangent[t, d, i]
            z = tendons.slip[t, d - 1]
            free_to_slide = (
                0.0 if abs(z) >= 1.0 else mu * tension[t] * rounded_turn_angle(np.arccos(min(1.0, cosine)))[0] / presliding
            )
            for a in range(3 * free):
                tail[d - 1, a] = free_to_slide * gained[a]
                front[d - 1, a] = back[a]
        K += np.dot(tail.T, front)
