"""Tendons through silicone: straight between material points, anchored in the last; what they do to the nodes.

The tension of tendon t beyond point d is T_t share_td, share = exp(-mu sum_{j<=d} z_j theta_j), by the law of `tendon_friction`:
theta_j is the angle it turns at inner point j, z_j the slip state there, which follows the travel past j.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.effects.tendon_friction import slip_state, turn

SHORTEST = 1e-9  # m, of a segment


class Cables(NamedTuple):
    """Points at rest (t, p, 3) m and how they move with the free nodes, (t, p, n_free)."""

    rest: np.ndarray
    weights: np.ndarray


class Pulled(NamedTuple):
    """Lengths (t,) m; dL/du (t, n) and the force of a unit tension (t, n); tangents (t, p - 1, 3), segments (t, p - 1) m and shares
    (t, p - 1) of the tension; slip states (t, p - 2) and lengths (t, p - 2) m beyond each inner point, as they would be now."""

    length: np.ndarray
    gradient: np.ndarray
    pull: np.ndarray
    tangent: np.ndarray
    segment: np.ndarray
    share: np.ndarray
    slip: np.ndarray
    beyond: np.ndarray


def unpulled(cables: Cables) -> Pulled:
    nt, points, free = cables.weights.shape
    return Pulled(
        np.zeros(nt), np.zeros((nt, 3 * free)), np.zeros((nt, 3 * free)), np.zeros((nt, points - 1, 3)), np.zeros((nt, points - 1)),
        np.ones((nt, points - 1)), np.zeros((nt, points - 2)), np.zeros((nt, points - 2)),
    )  # fmt: skip


@jit
def follow(cables, u, slip, before, mu, presliding, out):
    """Fill `out` for nodal displacements u (n_free, 3) m; slip states and lengths beyond each point were `slip` and `before`."""
    nt, points, _ = cables.weights.shape
    for t in range(nt):
        x = cables.rest[t] + np.dot(cables.weights[t], u)
        out.length[t] = 0.0
        for d in range(points - 1):
            length = 0.0
            for i in range(3):
                out.tangent[t, d, i] = x[d + 1, i] - x[d, i]
                length += out.tangent[t, d, i] ** 2
            length = max(np.sqrt(length), SHORTEST)
            out.segment[t, d] = length
            out.length[t] += length
            for i in range(3):
                out.tangent[t, d, i] /= length
        shares(t, slip, before, mu, presliding, out)
        push = np.zeros((2, points, 3))
        for d in range(points - 1):
            for i in range(3):
                push[0, d + 1, i] += out.tangent[t, d, i]
                push[0, d, i] -= out.tangent[t, d, i]
                push[1, d + 1, i] += out.share[t, d] * out.tangent[t, d, i]
                push[1, d, i] -= out.share[t, d] * out.tangent[t, d, i]
        out.gradient[t] = np.dot(cables.weights[t].T, push[0]).ravel()
        out.pull[t] = np.dot(cables.weights[t].T, push[1]).ravel()


@inner
def shares(t, slip, before, mu, presliding, out):
    """What friction leaves of the tension of tendon t in each segment, and its slip."""
    beyond, wrapped = out.length[t], 0.0
    n = out.segment.shape[1]
    out.share[t, 0] = 1.0
    for d in range(1, n):
        beyond -= out.segment[t, d - 1]
        out.beyond[t, d - 1] = beyond
        cosine = 0.0
        for i in range(3):
            cosine += out.tangent[t, d - 1, i] * out.tangent[t, d, i]
        z = slip_state(slip[t, d - 1], before[t, d - 1] - beyond, presliding)
        out.slip[t, d - 1] = z
        wrapped += z * turn(np.arccos(min(1.0, cosine)))[0]
        out.share[t, d] = np.exp(-mu * wrapped)


@jit
def geometric(cables, tension, pulled, K):
    """Add to K (n, n) what the tendons' own direction gives as they move."""
    nt, points, free = cables.weights.shape
    for t in range(nt):
        if tension[t] <= 0.0:
            continue
        difference = cables.weights[t, 1:] - cables.weights[t, :-1]  # (p - 1, n_free)
        scaled = np.empty_like(difference)
        for i in range(3):
            for k in range(3):
                for d in range(points - 1):
                    v = pulled.tangent[t, d]
                    across = (1.0 if i == k else 0.0) - v[i] * v[k]
                    across *= tension[t] * pulled.share[t, d] / pulled.segment[t, d]
                    for a in range(free):
                        scaled[d, a] = across * difference[d, a]
                K[i::3, k::3] += np.dot(difference.T, scaled)


@jit
def sticking(cables, tension, pulled, mu, presliding, K):
    """Add to K what changes of slip give where tendons do not slide: d share_d = -mu share_d sum_{j<=d} theta_j dz_j."""
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
                    back[3 * a + i] += w * pulled.tangent[t, d, i]
                    gained[3 * a + i] += w * pulled.tangent[t, d, i] * pulled.share[t, d]
            cosine = 0.0
            for i in range(3):
                cosine += pulled.tangent[t, d - 1, i] * pulled.tangent[t, d, i]
            z = pulled.slip[t, d - 1]
            free_to_slide = 0.0 if abs(z) >= 1.0 else mu * tension[t] * turn(np.arccos(min(1.0, cosine)))[0] / presliding
            for a in range(3 * free):
                tail[d - 1, a] = free_to_slide * gained[a]
                front[d - 1, a] = back[a]
        K += np.dot(tail.T, front)
