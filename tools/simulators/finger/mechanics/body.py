"""Finite-deformation equilibrium of the silicone: Q2/P1 displacement-pressure elements, locking-free; mm, N, MPa.

Energy: mu/2 (J^(-2/3) tr F'F - 3) + K/2 (J - J0)^2 with the pressure p = K (J - J0) an unknown of its own, linear in every
cell and discontinuous (Sussman and Bathe 1987, doi 10.1016/0045-7949(87)90265-3), condensed in every Newton step.
J0 is swelling. Delayed strain: overstress of one Maxwell branch (Simo 1987, doi 10.1016/0045-7825(87)90107-1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.mesh import Mesh, shape

DENSITY = 1.07e-6  # kg/mm^3
I3 = np.eye(3)


def gauss(count: int, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, d) and weights (q,) of the Gauss rule on [-1, 1]^d."""
    x, w = np.polynomial.legendre.leggauss(count)
    points = np.stack(np.meshgrid(*[x] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
    return points, np.prod(np.stack(np.meshgrid(*[w] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions), axis=1)


@dataclass
class Body:
    """Quadrature of a mesh with the material at every point."""

    mesh: Mesh
    shear: np.ndarray  # (m, q) MPa
    bulk: np.ndarray  # (m, q) MPa
    values: np.ndarray  # (q, 27)
    slope: np.ndarray  # (m, q, 27, 3) 1/mm, by the undeformed position
    volume: np.ndarray  # (m, q) mm^3
    linear: np.ndarray  # (m, q, 4) what the pressure is made of: 1 and the local coordinates
    unformed: np.ndarray  # (m, q, 3, 3) from what is drawn back to what has no stress; 1, or the inverse of what `form` was given

    @classmethod
    def of(cls, mesh: Mesh, modulus: float, poisson: float = 0.49) -> Body:
        """Homogeneous body of Young's `modulus` (MPa)."""
        local, weight = gauss(3, 3)
        values, derivative = shape(local)
        jacobian = np.einsum("mai,qaj->mqij", mesh.nodes[mesh.cells], derivative)
        slope = np.einsum("qaj,mqji->mqai", derivative, np.linalg.inv(jacobian))
        volume = weight * np.linalg.det(jacobian)
        linear = np.broadcast_to(np.column_stack([np.ones(len(local)), local]), (*volume.shape, 4))
        ones = np.ones(volume.shape)
        shear, bulk = modulus / 2 / (1 + poisson) * ones, modulus / 3 / (1 - 2 * poisson) * ones
        return cls(mesh, shear, bulk, values, slope, volume, linear, np.broadcast_to(I3, (*volume.shape, 3, 3)))

    @property
    def points(self) -> np.ndarray:
        """Undeformed quadrature points (m, q, 3) mm."""
        return np.einsum("qa,mai->mqi", self.values, self.mesh.nodes[self.mesh.cells])

    def scale(self, factor: np.ndarray) -> None:
        """Multiply both moduli by `factor` (m, q)."""
        self.shear, self.bulk = self.shear * factor, self.bulk * factor

    def weights(self, density: np.ndarray | float = 1.0) -> np.ndarray:
        """Integral of the shape functions times `density` (m, q) over the body, a number a node."""
        total = np.zeros(len(self.mesh.nodes))
        np.add.at(total, self.mesh.cells, np.einsum("qa,mq->ma", self.values, self.volume * density))
        return total

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Deformation gradient (m, q, 3, 3) of nodal displacements (n, 3)."""
        return self.unformed + np.matmul(np.swapaxes(u[self.mesh.cells], 1, 2)[:, None], self.slope)

    def form(self, shape: np.ndarray) -> None:
        """Without stress the body is drawn by the gradients `shape` (m, q, 3, 3), those of a map, from what the mesh is."""
        self.unformed = np.linalg.inv(shape)
        self.slope, self.volume = self.slope @ self.unformed, self.volume * np.linalg.det(shape)

    def isochoric(self, F: np.ndarray) -> np.ndarray:
        """Second Piola-Kirchhoff stress of the distortion, elastic (m, q, 3, 3) MPa."""
        C = np.swapaxes(F, -1, -2) @ F
        J = np.linalg.det(F)
        trace = np.trace(C, axis1=-2, axis2=-1)[..., None, None]
        return (self.shear * J ** (-2 / 3))[..., None, None] * (I3 - trace / 3 * np.linalg.inv(C))


@dataclass
class Element:
    """Cells' part of one Newton step: condensed forces and stiffness, and what gives the pressure step back."""

    force: np.ndarray  # (m, 81) N, with the pressure's residual condensed
    plain: np.ndarray  # (m, 81) N, as it is
    stiffness: np.ndarray  # (m, 81, 81) N/mm
    residual: np.ndarray  # (m, 4) mm^3, of the volume's law
    back: np.ndarray  # (m, 4, 81)
    start: np.ndarray  # (m, 4)

    def pressure_step(self, du: np.ndarray) -> np.ndarray:
        """Pressure step (m, 4) of the displacement step (m, 81)."""
        return self.start + np.einsum("mca,ma->mc", self.back, du)


def assemble(
    body: Body, u: np.ndarray, pressure: np.ndarray, swelling: float, share: float, overstress: np.ndarray | None
) -> Element | None:
    """Cells at displacements u (n, 3) and pressures (m, 4); `share` of the elastic distortion acts, `overstress` (m, q, 3, 3) adds
    to it. None where a cell is crushed."""
    F = body.gradient(u)
    J = np.linalg.det(F)
    if J.min() < 0.1:
        return None
    w, T = body.volume, np.swapaxes(np.linalg.inv(F), -1, -2)
    p = np.einsum("mqc,mc->mq", body.linear, pressure)
    m = share * body.shear * J ** (-2 / 3)
    i1 = np.einsum("mqij,mqij->mq", F, F)

    def col(a: np.ndarray) -> np.ndarray:
        return a[..., None, None]

    P = col(m) * (F - col(i1 / 3) * T) + col(p * J) * T
    if overstress is not None:
        P = P + F @ overstress
    plain = np.einsum("mqiJ,mqaJ->mai", P * col(w), body.slope, optimize=True).reshape(len(J), 81)

    f, t = F.reshape(*J.shape, 9), T.reshape(*J.shape, 9)
    A = (-2 / 3 * m)[..., None, None] * (f[..., :, None] * t[..., None, :] + t[..., :, None] * f[..., None, :])
    A += col(2 / 9 * m * i1 + p * J) * t[..., :, None] * t[..., None, :]
    A = A.reshape(*J.shape, 3, 3, 3, 3)  # i J k L
    A += (m * i1 / 3 - p * J)[..., None, None, None, None] * np.einsum("mqil,mqkj->mqijkl", T, T)
    for i in range(3):
        A[..., i, :, i, :] += col(m) * I3
        if overstress is not None:
            A[..., i, :, i, :] += overstress
    A *= w[..., None, None, None, None]
    cells, q = J.shape
    left = np.ascontiguousarray(body.slope.transpose(0, 2, 1, 3)).reshape(cells, 27, 3 * q)
    right = np.ascontiguousarray(np.swapaxes(body.slope, 2, 3))
    K = np.empty((cells, 27, 3, 27, 3))
    for i in range(3):
        for k in range(i + 1):
            K[:, :, i, :, k] = np.matmul(left, np.matmul(A[:, :, i, :, k], right).reshape(cells, 3 * q, 27))
            K[:, :, k, :, i] = np.swapaxes(K[:, :, i, :, k], 1, 2)
    K = K.reshape(cells, 81, 81)

    cofactor = np.matmul(body.slope, np.swapaxes(col(J * w) * T, -1, -2)).reshape(cells, q, 81)
    G = np.matmul(np.swapaxes(cofactor, 1, 2), body.linear)  # m 81 4
    mass = np.einsum("mqc,mq,mqd->mcd", body.linear, w / body.bulk, body.linear)
    residual = np.einsum("mqc,mq->mc", body.linear, w * (J - swelling - p / body.bulk))
    inverse = np.linalg.inv(mass)
    back = np.matmul(inverse, np.swapaxes(G, 1, 2))
    start = np.einsum("mcd,md->mc", inverse, residual)
    return Element(plain + np.einsum("mac,mc->ma", G, start), plain, K + np.matmul(G, back), residual, back, start)
