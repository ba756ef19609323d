"""A silicone cone on a column of 27-node cells, the lattice of MuJoCo's quadratic flex, and integrals over the part inside.

The cells fill the bounding box of the cone from its clamp to its tip; the clamped part does not move. Integrals are by Gauss points
in z and in r^2 and equal angles, exact for polynomials over a slice of the cone. SI.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

NODES_PER_CELL = 27
LEVELS_ACROSS = 3  # levels of nodes in x and in y
GAUSS_RADII, GAUSS_ANGLES, GAUSS_HEIGHTS = 2, 8, 3  # points of a cell; 3, 12 and 4 change resistances by 0.01 ohm (RMS)
GRADING = 1.15  # exponent of the cells' heights, lower near the clamp, where the strain concentrates
FACE_TOLERANCE = 1e-9  # m; a point on the face between two cells belongs to the lower one


@dataclass(frozen=True)
class Cone:
    """A straight cone along z: its length and radii at the base and the tip, clamped rigidly up to `clamp` (m)."""

    length: float
    base: float
    tip: float
    clamp: float

    def radius(self, z: np.ndarray | float) -> np.ndarray:
        """Return the radius (m) at heights z (m)."""
        return self.base + (self.tip - self.base) * np.asarray(z, float) / self.length


def shape_functions(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic shape functions at x (..., 3) in [-1, 1]^3: values (..., 27) and derivatives (..., 27, 3), z fastest."""
    value = np.stack([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)], axis=-1)  # (..., 3 axes, 3 nodes)
    slope = np.stack([x - 0.5, -2.0 * x, x + 0.5], axis=-1)
    N = _product(value[..., 0, :], value[..., 1, :], value[..., 2, :])
    D = [_product(*(slope[..., b, :] if a == b else value[..., b, :] for b in range(3))) for a in range(3)]
    return N, np.stack(D, axis=-1)


def _product(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...j,...k->...ijk", a, b, c).reshape(*a.shape[:-1], NODES_PER_CELL)


def cone_quadrature(
    cone: Cone, low: float, high: float, n: tuple[int, int, int] = (GAUSS_RADII, GAUSS_ANGLES, GAUSS_HEIGHTS)
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (m, 3) and weights (m,) (m^3) of the cone between two heights."""
    radii, angles, heights = n
    z, wz = _gauss(heights, low, high)
    q, wq = _gauss(radii, 0.0, 1.0)
    t = 2.0 * np.pi * (np.arange(angles) + 0.25) / angles
    Z, Q, T = (v.ravel() for v in np.meshgrid(z, q, t, indexing="ij"))
    R = cone.radius(Z)
    points = np.stack([R * np.sqrt(Q) * np.cos(T), R * np.sqrt(Q) * np.sin(T), Z], axis=1)
    return points, np.repeat(np.outer(wz, wq).ravel(), angles) * R**2 * np.pi / angles


def _gauss(n: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    x, w = np.polynomial.legendre.leggauss(n)
    return low + 0.5 * (x + 1.0) * (high - low), 0.5 * w * (high - low)


@dataclass(frozen=True)
class Lattice:
    """A cone cut into `cells` layers. Free nodes are those above the clamp, by height; unknowns are their x, y, z in turn."""

    cone: Cone
    cells: int

    @cached_property
    def edges(self) -> np.ndarray:
        """(cells + 1,) m, heights of the faces between cells."""
        return self.cone.clamp + (self.cone.length - self.cone.clamp) * (np.arange(self.cells + 1) / self.cells) ** GRADING

    @cached_property
    def nodes(self) -> np.ndarray:
        """(n_node, 3) m, at rest; level by level of height."""
        half = float(self.cone.radius(self.cone.clamp))
        z = np.sort(np.concatenate([self.edges, 0.5 * (self.edges[1:] + self.edges[:-1])]))
        side = np.array([-half, 0.0, half])
        Z, X, Y = (v.ravel() for v in np.meshgrid(z, side, side, indexing="ij"))
        return np.stack([X, Y, Z], axis=1)

    @cached_property
    def members(self) -> np.ndarray:
        """(cells, 27) nodes of each cell, z fastest."""
        level, across = LEVELS_ACROSS**2, np.arange(LEVELS_ACROSS**2)
        return np.array([(level * (2 * c + np.arange(3))[None, :] + across[:, None]).ravel() for c in range(self.cells)])

    @property
    def n_free(self) -> int:
        """Number of free nodes."""
        return len(self.nodes) - LEVELS_ACROSS**2

    @cached_property
    def unknowns(self) -> np.ndarray:
        """(cells, 81) index of each cell's nodes' coordinates among the unknowns, -1 where clamped."""
        free = self.members - LEVELS_ACROSS**2
        return np.where(free[..., None] >= 0, 3 * free[..., None] + np.arange(3), -1).reshape(self.cells, 3 * NODES_PER_CELL)

    @cached_property
    def half(self) -> np.ndarray:
        """(cells, 3) m, half sizes of each cell."""
        side = np.full(self.cells, float(self.cone.radius(self.cone.clamp)))
        return np.column_stack([side, side, 0.5 * np.diff(self.edges)])

    @cached_property
    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (cells, q, 3) and weights (cells, q) (m^3)."""
        found = [cone_quadrature(self.cone, a, b) for a, b in zip(self.edges[:-1], self.edges[1:], strict=True)]
        return np.stack([p for p, _ in found]), np.stack([w for _, w in found])

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the shape functions at the quadrature points, and local coordinates.

        (cells, 27, 3 q) 1/m, x, y, z of a point in turn; (cells, q, 3).
        """
        points, _ = self.quadrature
        local = (points - self._centres()[:, None]) / self.half[:, None]
        D = shape_functions(local)[1] / self.half[:, None, None]  # (cells, q, 27, 3)
        return np.ascontiguousarray(D.transpose(0, 2, 1, 3).reshape(self.cells, NODES_PER_CELL, -1)), local

    @cached_property
    def volume(self) -> np.ndarray:
        """(n_free,) m^3 carried by each free node."""
        points, weights = self.quadrature
        return weights.ravel() @ self.weights(points.reshape(-1, 3))

    def weights(self, points: np.ndarray) -> np.ndarray:
        """Return (m, n_free) weights: the displacement of material points (m, 3) as a function of the free nodes'; zero where
        clamped.

        Points outside the cone, within the bounding box of the cells, move with the extended cells.
        """
        cell = np.clip(np.searchsorted(self.edges, points[:, 2] - FACE_TOLERANCE) - 1, 0, self.cells - 1)
        N, _ = shape_functions((points - self._centres()[cell]) / self.half[cell])
        out = np.zeros((len(points), len(self.nodes)))
        np.put_along_axis(out, self.members[cell], N * (points[:, 2] > self.cone.clamp)[:, None], axis=1)
        return np.ascontiguousarray(out[:, LEVELS_ACROSS**2 :])

    def anchor_weights(self, point: np.ndarray, low: float) -> np.ndarray:
        """Return (n_free,) weights of a force at `point` (3,), spread from the height `low` to the tip with force and moment
        preserved.

        Its density grows linearly from `low` to the tip. The weights are those of the affine field that best fits the displacement
        of that part, evaluated at the point.
        """
        points, w = cone_quadrature(self.cone, low, self.cone.length, (3, 12, 4))
        w = w * (points[:, 2] - low)
        centre = w @ points / w.sum()
        B = np.column_stack([np.ones(len(points)), points - centre])
        share = w * (B @ np.linalg.solve((B * w[:, None]).T @ B, np.r_[1.0, point - centre]))
        return share @ self.weights(points)

    def _centres(self) -> np.ndarray:
        middle = 0.5 * (self.edges[1:] + self.edges[:-1])
        return np.column_stack([np.zeros((self.cells, 2)), middle])


@lru_cache(maxsize=8)
def lattice(cone: Cone, cells: int) -> Lattice:
    """Return the lattice of a cone, built once: bodies that differ in their silicone or their tendons share it."""
    return Lattice(cone, cells)
