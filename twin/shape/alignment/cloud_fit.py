"""Fit the shape behind one partial cloud: coordinates z of the twin's deformation modes, at the most probable of

    sum_p rho(d_p / sigma)  +  e' C^-1 e,  e = z - m(z_1, z_2)  +  sum_p -2 log Phi(-s_p / sigma)  +  2 l s_edge

d_p is the distance of a point to the visible skin, rho = 2 b^2 (sqrt(1 + (d / b sigma)^2) - 1). m and C are those of training
fingers that a hand pushes: how a bent finger stretches and flattens, a cubic of its two bends, and its scatter. A plane has no end:
the finger's length shows in the points that end at the rim of the tip. They are evenly spread, l of them a metre, with noise, so a
point at s_p beyond the rim has probability Phi(-s_p / sigma), and every metre the rim lies further out costs l.

Gauss-Newton steps, correspondences found again in each.
"""

import numpy as np
from scipy.special import log_ndtr

from twin.mechanics.silicone.skin import TIP_RIM, Skin, is_visible, signed_distances
from twin.shape.estimators.modal import ModalNetwork

CLOUD_NOISE = 4e-4  # m, noise of a cloud's point
ROBUST_LIMIT = 3.0  # standard deviations within which a point counts fully
CLOUD_FIT_ITERATIONS = 25  # Gauss-Newton steps
MODE_STEP_TOLERANCE = 1e-4  # m in z: 4e-6 m in the vertices
LONGEST_MODE_STEP = 0.1  # m, of a step in z: 4 mm in the vertices
RIM_DENSITY_RANGE = (15e-3, 2e-3)  # m below the rim where the density of points is counted


class CloudFit:
    """Fit shapes frame by frame.

    The finger's own frame is turned by `turn` (3, 3) against that of the clouds, which are seen from `side` (3,).
    """

    def __init__(self, skin: Skin, net: ModalNetwork, turn: np.ndarray, side: np.ndarray) -> None:
        self.skin, self.modes, self.turn, self.side = skin, net.modes, turn, side
        self.coupling = net.coupling
        basis = self.modes.basis.reshape(len(self.modes.basis), -1, 3)
        self.basis = np.einsum("mn,knc->mck", skin.weights, basis)

    def __call__(self, cloud: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (k,) m for points (n, 3) m, from a start (k,), and their covariance (k, k) m^2."""
        own, hessian = cloud @ self.turn, self.coupling.inverse
        for _ in range(CLOUD_FIT_ITERATIONS):
            x, normals = self.skin.points_and_normals(self.modes.nodes(z[None])[0])
            visible = is_visible(normals, self.turn, self.side)
            d, nearest = signed_distances(own, x, normals, visible)
            J = np.einsum("pck,pc->pk", self.basis[nearest], normals[nearest])
            weight = 1.0 / (CLOUD_NOISE**2 * np.sqrt(1.0 + (d / (ROBUST_LIMIT * CLOUD_NOISE)) ** 2))
            e, D = self.coupling(z)
            H = (J * weight[:, None]).T @ J + D.T @ self.coupling.inverse @ D
            g = J.T @ (weight * d) - D.T @ self.coupling.inverse @ e
            edge = self._rim_terms(own, x, visible)
            hessian = H + edge[0]
            step = np.linalg.solve(hessian, g + edge[1])
            size = np.linalg.norm(step)
            z = z + step * min(1.0, LONGEST_MODE_STEP / size)
            if size < MODE_STEP_TOLERANCE:
                break
        return z, np.linalg.inv(hessian)

    def _rim_terms(self, own: np.ndarray, x: np.ndarray, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rim's terms of the Hessian and of the downhill direction."""
        ring, below = (
            np.arange(TIP_RIM.start, TIP_RIM.stop),
            np.arange(TIP_RIM.start, TIP_RIM.stop) - (TIP_RIM.stop - TIP_RIM.start),
        )
        rim_visible = visible[ring]
        if not rim_visible.any():
            return np.zeros_like(self.coupling.inverse), np.zeros(len(self.coupling.inverse))
        ring, below = ring[rim_visible], below[rim_visible]
        outwards = x[ring] - x[below]
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        across = np.linalg.norm(own[:, None] - x[ring][None], axis=2)
        k = across.argmin(axis=1)
        s = ((own - x[ring[k]]) * outwards[k]).sum(axis=1)
        density = ((s > -RIM_DENSITY_RANGE[0]) & (s < -RIM_DENSITY_RANGE[1])).sum() / (RIM_DENSITY_RANGE[0] - RIM_DENSITY_RANGE[1])
        J = np.einsum("pck,pc->pk", self.basis[ring], outwards)
        a = s / CLOUD_NOISE
        hazard = np.exp(-0.5 * a**2 - 0.5 * np.log(2.0 * np.pi) - log_ndtr(-a))  # of the normal distribution
        curvature = np.clip(hazard * (hazard - a), 0.0, 1.0)
        close = np.abs(s) < RIM_DENSITY_RANGE[0]
        Jp = J[k[close]]
        H = (Jp * (curvature[close] / CLOUD_NOISE**2)[:, None]).T @ Jp
        return H, Jp.T @ (hazard[close] / CLOUD_NOISE) - density * J.mean(axis=0)
