"""Tendons and cords as straight pieces between material points of the body; mm, N.

A tendon pulls its 21 points with tension T_k in piece k, T_(k+1) = T_k exp(-mu theta_k psi_k) at point k where it turns by
theta_k (capstan). psi in [-1, 1] is the state of the contact: d psi = (1 - psi sign(ds)) ds / stroke with the cable's slip
ds towards the base (Dahl): rate-independent, with small pre-sliding. The last point is the anchor over z = 90..100 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.body import Body
from tools.simulators.finger.mechanics.mesh import ANCHOR, CLAMP, locate

TENDON_AZIMUTH = np.deg2rad([0.0, 90.0, 180.0, 270.0])
CORD_AZIMUTH = np.deg2rad([45.0, 135.0, 225.0, 315.0])
TENDON = (5.0, 100.0, 12.0, 5.75, 21)  # z and radius of both ends (mm), points
CORD = (10.0, 80.0, 10.0, 5.0, 29)
CORD_LENGTH = 70.178  # mm, what strain is counted by


def straight(azimuth: float, z0: float, z1: float, r0: float, r1: float, count: int) -> np.ndarray:
    """Equally spaced points (count, 3) mm of a straight line in the plane of one azimuth (rad)."""
    r, z = np.linspace(r0, r1, count), np.linspace(z0, z1, count)
    return np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth), z])


def interpolation(body: Body, points: np.ndarray) -> np.ndarray:
    """Weights (k, n) that give displacements of material points (k, 3) mm from the nodes'; zero below the clamp."""
    weights = np.zeros((len(points), len(body.mesh.nodes)))
    free = points[:, 2] > CLAMP + 1e-9
    owner, values = locate(body.mesh, points[free])
    weights[np.flatnonzero(free)[:, None], body.mesh.cells[owner]] = values
    weights[:, : body.mesh.held] = 0.0
    return weights


def anchor(body: Body, point: np.ndarray) -> np.ndarray:
    """Weights (n,) of a force at `point` that enters over z = 90..100 mm, denser towards the tip, with force and moment kept.

    Density per volume (z - 90) (a + b . (X - centre)), a and b from the two conditions.
    """
    X = body.points
    w = body.volume * np.maximum(X[..., 2] - ANCHOR, 0.0)
    centre = np.einsum("mq,mqi->i", w, X) / w.sum()
    basis = np.concatenate([np.ones((*w.shape, 1)), X - centre], axis=-1)
    a = np.linalg.solve(np.einsum("mq,mqi,mqj->ij", w, basis, basis), np.append(1.0, point - centre))
    local = (X[..., 2] > ANCHOR) * np.maximum(X[..., 2] - ANCHOR, 0.0) * (basis @ a)
    return body.weights(local)


@dataclass
class Cables:
    """Four tendons in one body; piece k of a tendon joins its points k and k + 1."""

    start: np.ndarray  # (4, 21, 3) mm, undeformed
    weights: np.ndarray  # (4, 21, n)
    mu: float = 0.0
    stroke: float = 0.1  # mm of slip in which a contact goes over

    @classmethod
    def of(cls, body: Body) -> Cables:
        start = np.stack([straight(a, *TENDON) for a in TENDON_AZIMUTH])
        weights = interpolation(body, start.reshape(-1, 3)).reshape(4, TENDON[-1], -1)
        for t in range(4):
            weights[t, -1] = anchor(body, start[t, -1])
        return cls(start, weights)

    def pieces(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (4, 20) mm and directions (4, 20, 3) from base to tip."""
        d = np.diff(self.start + self.weights @ u, axis=1)
        length = np.linalg.norm(d, axis=-1)
        return length, d / length[..., None]

    def contacts(self, before: np.ndarray, psi: np.ndarray, length: np.ndarray, taut: np.ndarray) -> np.ndarray:
        """State psi (4, 19) after the pieces went from lengths `before` to `length`; a slack tendon forgets."""
        slip = -np.cumsum((length - before)[:, :0:-1], axis=1)[:, ::-1]
        side = np.sign(slip)
        moved = side + (psi - side) * np.exp(-np.abs(slip) / self.stroke)
        return np.where(taut[:, None], np.where(side == 0, psi, moved), 0.0)

    def shares(self, direction: np.ndarray, psi: np.ndarray) -> np.ndarray:
        """Tension of every piece over the base tension (4, 20)."""
        loss = self.mu * self._turns(direction) * psi
        return np.exp(-np.concatenate([np.zeros((4, 1)), np.cumsum(loss, axis=1)], axis=1))

    def grip(self, state: tuple[np.ndarray, np.ndarray], length: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Derivative (4, 20, 20) of the shares by the pieces' lengths through the slip, from a `state` of lengths and psi; 1/mm.

        How the turns change is left out: it is smooth and small, and Newton's method finds it.
        """
        before, psi = state
        slip = -np.cumsum((length - before)[:, :0:-1], axis=1)[:, ::-1]
        slope = (1 - np.sign(slip) * psi) * np.exp(-np.abs(slip) / self.stroke) / self.stroke
        reach = np.tri(20, 19, -1)  # piece k lies beyond contact j, in tension as in slip
        gain = self.mu * self._turns(direction) * slope
        shares = self.shares(direction, self.contacts(before, psi, length, np.ones(4, bool)))
        return shares[:, :, None] * np.einsum("kj,tj,mj->tkm", reach, gain, reach)

    def _turns(self, direction: np.ndarray) -> np.ndarray:
        """Angles (4, 19) between one piece and the next."""
        cosine = np.einsum("tki,tki->tk", direction[:, 1:], direction[:, :-1])
        return np.arccos(np.clip(cosine, -1.0, 1.0))


@dataclass
class Cords:
    """Strain of the four sensors."""

    start: np.ndarray  # (4, 29, 3)
    weights: np.ndarray  # (4, 29, n)

    @classmethod
    def of(cls, body: Body) -> Cords:
        start = np.stack([straight(a, *CORD) for a in CORD_AZIMUTH])
        return cls(start, interpolation(body, start.reshape(-1, 3)).reshape(4, CORD[-1], -1))

    def strain(self, u: np.ndarray) -> np.ndarray:
        """Change of path length over the cord's nominal length (4,)."""
        length = np.linalg.norm(np.diff(self.start + self.weights @ u, axis=1), axis=-1).sum(axis=1)
        return length / CORD_LENGTH - 1 - (np.linalg.norm(np.diff(self.start, axis=1), axis=-1).sum(axis=1) / CORD_LENGTH - 1)
