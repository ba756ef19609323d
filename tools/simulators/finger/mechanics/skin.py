"""The finger's skin: where hands push, pads press and the camera looks; mm, N."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.body import gauss
from tools.simulators.finger.mechanics.mesh import Mesh, shape


@dataclass(frozen=True)
class Skin:
    """Quadrature of the free skin (z >= 10 mm): the mantle and the flat tip."""

    nodes: np.ndarray  # (s, 9) node numbers
    values: np.ndarray  # (s, 9)
    points: np.ndarray  # (s, 3) mm, undeformed
    area: np.ndarray  # (s,) mm^2, undeformed

    @classmethod
    def of(cls, mesh: Mesh) -> Skin:
        flat, weight = gauss(3, 2)
        per = len(mesh.cells) // mesh.layers
        mantle = [c for c in range(len(mesh.cells)) if c % per >= mesh.core**2]
        tip = range(len(mesh.cells) - per, len(mesh.cells))
        nodes, values, points, area = [], [], [], []
        for cells, axis in ((mantle, 0), (tip, 2)):
            local = np.insert(flat, axis, 1.0, axis=1)
            value, slope = shape(local)
            on = np.flatnonzero(np.abs(value).max(axis=0) > 1e-12)
            tangents = np.delete(slope, axis, axis=2)
            for c in cells:
                corner = mesh.nodes[mesh.cells[c]]
                d = np.einsum("ai,qaj->qij", corner, tangents)
                nodes.append(np.tile(mesh.cells[c][on], (len(local), 1)))
                values.append(value[:, on])
                points.append(value @ corner)
                area.append(weight * np.linalg.norm(np.cross(d[..., 0], d[..., 1]), axis=-1))
        return cls(np.concatenate(nodes), np.concatenate(values), np.concatenate(points), np.concatenate(area))

    def load(self, traction: np.ndarray, count: int) -> np.ndarray:
        """Nodal forces (count, 3) N of tractions (s, 3) MPa per undeformed area."""
        force = np.zeros((count, 3))
        np.add.at(force, self.nodes, self.values[..., None] * (self.area[:, None] * traction)[:, None])
        return force


@dataclass(frozen=True)
class Pad:
    """A soft half-space normal . x > distance: it presses back with `stiffness` times how deep the skin is in it."""

    normal: tuple[float, float, float]  # out of the finger, into the pad
    distance: float  # mm from the base's centre
    stiffness: float  # N/mm^3

    def press(self, skin: Skin, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tractions (s, 3) MPa and their stiffness along the normal (s,) N/mm^3."""
        n = np.array(self.normal)
        deep = (skin.points + np.einsum("sa,sai->si", skin.values, u[skin.nodes])) @ n - self.distance
        return -self.stiffness * np.maximum(deep, 0.0)[:, None] * n, self.stiffness * (deep > 0)
