"""The shape behind one partial cloud: coordinates z of the twin's deformation modes, at the most probable of

    sum_p rho(d_p / sigma)  +  e' C^-1 e,  e = z - m(z_1, z_2)  +  sum_p -2 log Phi(-s_p / sigma)  +  2 l s_edge

d_p is the distance of a point to the visible skin, rho = 2 b^2 (sqrt(1 + (d / b sigma)^2) - 1). m and C are the factory's, of
fingers that a hand pushes: how a bent finger stretches and flattens, a cubic of its two bends, and how that scatters. A plane does
not end: what says how long the finger is, is that its points end at the rim of the tip. They are evenly spread, l of them a metre,
with noise, so a point at s_p beyond the rim has probability Phi(-s_p / sigma), and every metre the rim lies further out costs l.

Gauss-Newton steps, correspondences sought again in each.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from twin.shape.modal import Network
from twin.soft.skin import RIM, Skin, distances, facing

CLOUD = 4e-4  # m, noise of a cloud's point
BEYOND = 3.0  # standard deviations within which a point counts fully
ROUNDS = 25
SETTLED = 1e-4  # m in z: 4e-6 m in the vertices
LONGEST = 0.1  # m, of a step in z: 4 mm in the vertices
NEAR = (15e-3, 2e-3)  # m below the rim where the density of points is counted


class CloudFit:
    """Fits frame by frame; the finger's own frame is turned by `turn` (3, 3) against that of the clouds, seen from `side` (3,)."""

    def __init__(self, skin: Skin, net: Network, turn: np.ndarray, side: np.ndarray) -> None:
        self.skin, self.modes, self.turn, self.side = skin, net.modes, turn, side
        self.habit = net.habit
        basis = self.modes.basis.reshape(len(self.modes.basis), -1, 3)
        self.basis = np.einsum("mn,knc->mck", skin.weights, basis)

    def __call__(self, cloud: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (k,) m for points (n, 3) m, from a start (k,), and their covariance (k, k) m^2."""
        own, hessian = cloud @ self.turn, self.habit.inverse
        for _ in range(ROUNDS):
            x, normals = self.skin.at(self.modes.nodes(z[None])[0])
            visible = facing(normals, self.turn, self.side)
            d, nearest = distances(own, x, normals, visible)
            J = np.einsum("pck,pc->pk", self.basis[nearest], normals[nearest])
            weight = 1.0 / (CLOUD**2 * np.sqrt(1.0 + (d / (BEYOND * CLOUD)) ** 2))
            away, D = self.habit(z)
            H = (J * weight[:, None]).T @ J + D.T @ self.habit.inverse @ D
            g = J.T @ (weight * d) - D.T @ self.habit.inverse @ away
            edge = self._edge(own, x, visible)
            hessian = H + edge[0]
            step = np.linalg.solve(hessian, g + edge[1])
            size = np.linalg.norm(step)
            z = z + step * min(1.0, LONGEST / size)
            if size < SETTLED:
                break
        return z, np.linalg.inv(hessian)

    def _edge(self, own: np.ndarray, x: np.ndarray, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the rim adds to the Hessian and to the downhill direction."""
        ring, below = np.arange(RIM.start, RIM.stop), np.arange(RIM.start, RIM.stop) - (RIM.stop - RIM.start)
        seen = visible[ring]
        if not seen.any():
            return np.zeros_like(self.habit.inverse), np.zeros(len(self.habit.inverse))
        ring, below = ring[seen], below[seen]
        outwards = x[ring] - x[below]
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        across = np.linalg.norm(own[:, None] - x[ring][None], axis=2)
        k = across.argmin(axis=1)
        s = ((own - x[ring[k]]) * outwards[k]).sum(axis=1)
        density = ((s > -NEAR[0]) & (s < -NEAR[1])).sum() / (NEAR[0] - NEAR[1])
        J = np.einsum("pck,pc->pk", self.basis[ring], outwards)
        a = s / CLOUD
        hazard = np.exp(-0.5 * a**2 - 0.5 * np.log(2.0 * np.pi) - log_ndtr(-a))  # of the normal distribution
        curvature = np.clip(hazard * (hazard - a), 0.0, 1.0)
        close = np.abs(s) < NEAR[0]
        Jp = J[k[close]]
        H = (Jp * (curvature[close] / CLOUD**2)[:, None]).T @ Jp
        return H, Jp.T @ (hazard[close] / CLOUD) - density * J.mean(axis=0)
