"""The finger's cone as body-fitted 27-node hexahedra: a butterfly (O-grid) section swept from the clamp to the tip.

Section: a square core of `core` x `core` cells and 4 `core` cells around it, each arc of 90/core degrees, centred on the
tendons' azimuths. Nodes go plane by plane from base to tip, so that a layer's unknowns lie close together. Lengths in mm.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

FINGER_LENGTH, CLAMP, ANCHOR = 100.0, 10.0, 90.0  # mm: the tip, the end of the held part, the start of the tendons' anchor
# Finer at the clamp, whose edge the strain is singular at; one border where the anchor begins.
BORDERS = (10.0, 14.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
CORE = 0.5  # half the core square's diagonal, of the radius
MARGIN = 0.3  # mm that a parabola of the section may lie inside the cone


def radius(z: np.ndarray | float) -> np.ndarray:
    """Radius (mm) of the cone at height z (mm)."""
    return 15.0 - 0.0625 * np.asarray(z, float)


@dataclass(frozen=True)
class Mesh:
    nodes: np.ndarray  # (n, 3) mm
    cells: np.ndarray  # (m, 27) node numbers, the last local coordinate fastest
    plane: int  # nodes a plane
    borders: np.ndarray  # (layers + 1,) mm, heights at which layers of cells meet
    core: int

    @property
    def layers(self) -> int:
        return len(self.borders) - 1

    @property
    def held(self) -> int:
        """Nodes on the clamped plane: the first of all."""
        return self.plane


def shape(local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triquadratic shape functions (..., 27) and their derivatives (..., 27, 3) at local points (..., 3)."""
    x = np.asarray(local)
    value = np.stack([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2], axis=-1)
    slope = np.stack([x - 0.5, -2 * x, x + 0.5], axis=-1)
    parts = [value if d != n else slope for n in range(4) for d in range(3)]
    products = [
        np.einsum("...i,...j,...k->...ijk", *(parts[3 * n + d][..., d, :] for d in range(3))).reshape(*x.shape[:-1], 27)
        for n in range(4)
    ]
    return products[3], np.stack(products[:3], axis=-1)


def section(core: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (p, 2) of the unit section and cells (c, 9). Arc nodes lie so far out that the section keeps the disc's stiffness."""
    grid = np.linspace(-1, 1, 2 * core + 1)
    side = CORE / np.sqrt(2)
    points = [(side * x, side * y) for x in grid for y in grid]
    n = len(grid)
    cells = [[(2 * i + a) * n + 2 * j + b for a in range(3) for b in range(3)] for i in range(core) for j in range(core)]
    # Around the core, counter-clockwise from its corner at -45 degrees.
    last = n - 1
    rim = [last * n + j for j in range(last)] + [i * n + last for i in range(last, 0, -1)]
    rim += list(range(last, 0, -1)) + [i * n for i in range(last)]
    arcs = 8 * core
    ring = [rim]
    angle = 2 * np.pi * (np.arange(arcs) - core) / arcs
    outside = _bulge(np.pi / (4 * core)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for share in (0.5, 1.0):
        ring.append(list(range(len(points), len(points) + arcs)))
        inner = np.array([points[r] for r in rim])
        points.extend(map(tuple, inner + share * (outside - inner)))
    cells += [[ring[a][(2 * s + b) % arcs] for a in range(3) for b in range(3)] for s in range(4 * core)]
    return np.array(points), np.array(cells)


def _bulge(half: float) -> float:
    """Radius of the three nodes of an arc of half-angle `half`: the parabola through them bounds the arc's second moment."""
    s, w = np.polynomial.legendre.leggauss(8)
    x = np.cos(half) + (1 - np.cos(half)) * (1 - s * s)
    y = np.sin(half) * s
    dx, dy = -2 * s * (1 - np.cos(half)), np.sin(half)
    moment = np.sum(w * (x * dy - y * dx) * (x * x + y * y)) / 4  # polar, of the sector under the parabola
    return float((half / 2 / moment) ** 0.25)  # of the unit sector: its angle / 4


def cone(core: int = 1, finer: int = 1) -> Mesh:
    """Mesh of z = 10..100 mm, every layer of BORDERS cut into `finer`."""
    flat, quads = section(core)
    borders = np.append(np.concatenate([np.linspace(a, b, finer + 1)[:-1] for a, b in pairwise(BORDERS)]), FINGER_LENGTH)
    heights = np.append(np.column_stack([borders[:-1], (borders[:-1] + borders[1:]) / 2]).ravel(), FINGER_LENGTH)
    plane = len(flat)
    nodes = np.concatenate([np.column_stack([radius(z) * flat, np.full(plane, z)]) for z in heights])
    cells = [[q + (2 * k + c) * plane for q in quad for c in range(3)] for k in range(len(borders) - 1) for quad in quads]
    return Mesh(nodes, np.array(cells), plane, borders, core)


def locate(mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cell and shape-function values (k, 27) of material points (k, 3) mm with z >= 10; the nearest cell serves just outside."""
    per = len(mesh.cells) // mesh.layers
    k = np.clip(np.searchsorted(mesh.borders, points[:, 2], side="right") - 1, 0, mesh.layers - 1)
    owner, values, least = np.zeros(len(points), int), np.zeros((len(points), 27)), np.full(len(points), np.inf)
    for c in range(per):
        corner = mesh.nodes[mesh.cells[k * per + c]]
        near = np.flatnonzero(
            ((points > corner.min(axis=1) - MARGIN) & (points < corner.max(axis=1) + MARGIN)).all(axis=1) & (least > 1.0)
        )
        value, out = _invert(corner[near], points[near])
        better = out < least[near] - 1e-9
        chosen = near[better]
        owner[chosen], values[chosen], least[chosen] = (k * per + c)[chosen], value[better], out[better]
    if least.max() > 1.2:
        raise ValueError(f"a point lies outside the finger: {points[least.argmax()]} mm")
    return owner, values


def _invert(corner: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape-function values (k, 27) at points (k, 3) mm of cells (k, 27, 3); the largest local coordinate, inf where not found."""
    x = np.zeros_like(points)
    for _ in range(12):  # Newton from the cell's centre; the map is nearly affine
        value, slope = shape(x)
        gap = points - np.einsum("ka,kai->ki", value, corner)
        met = np.abs(gap).max(axis=1, initial=0.0) < 1e-9
        if met.all():
            break
        x = np.clip(x + np.linalg.solve(np.einsum("kai,kaj->kij", corner, slope), gap[..., None])[..., 0], -1.5, 1.5)
    return value, np.where(met, np.abs(x).max(axis=1, initial=0.0), np.inf)
