"""Meshes of bodies with shapes of their own: spheres, capsules, boxes and meshes, of one colour each."""

from __future__ import annotations

import numpy as np
import trimesh
import viser

from twin.body.drawable import Shape, Solid

ROUND_SIDES = 24  # of a cylinder
GHOST_OPACITY, GHOST_SIZE = 0.35, 1.04  # a little larger, so that no two surfaces are one


class Shapes:
    """Solids in a scene that move as links do, in their own colours or all in one, seen through."""

    def __init__(
        self,
        server: viser.ViserServer,
        root: str,
        scale: float,
        solids: tuple[Solid, ...],
        ghost: tuple[int, int, int] | None = None,
    ) -> None:
        """Draw below the frame `root`, with `scale` units for a metre; `ghost` is the colour of all that move, seen through."""
        self._scale, self._handles = scale, list[viser.MeshHandle | None]()
        for k, solid in enumerate(solids):
            if ghost and not solid.moves:
                self._handles.append(None)
                continue
            mesh = trimesh.util.concatenate([shape_mesh(shape, GHOST_SIZE if ghost else 1.0) for shape in solid.shapes])
            opacity = GHOST_OPACITY if ghost else solid.opacity
            handle = server.scene.add_mesh_simple(
                f"{root}/{k}", (scale * mesh.vertices).astype(np.float32), mesh.faces.astype(np.uint32),
                color=ghost or solid.colour, opacity=None if opacity >= 1.0 else opacity, flat_shading=False,
                side="double",
            )  # fmt: skip
            self._handles.append(handle)

    def move(self, place: np.ndarray, turn: np.ndarray) -> None:
        """Move the solids to places (g, 3) m with rotations (g, 4) w x y z, and show them."""
        for handle, p, q in zip(self._handles, place, turn, strict=True):
            if handle is not None:
                handle.position, handle.wxyz, handle.visible = tuple(self._scale * p), tuple(q / np.linalg.norm(q)), True

    def hide(self) -> None:
        """Hide the solids."""
        for handle in (h for h in self._handles if h is not None):
            handle.visible = False


def shape_mesh(shape: Shape, size: float = 1.0) -> trimesh.Trimesh:
    """Return the mesh of a shape in the frame of its link, m, `size` times as large about its own middle."""
    a, b, _ = shape.size
    if shape.kind == "mesh":
        mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    elif shape.kind == "box":
        mesh = trimesh.creation.box(extents=2.0 * shape.size)
    elif shape.kind == "capsule":
        mesh = trimesh.creation.capsule(height=2.0 * b, radius=a, count=[ROUND_SIDES, ROUND_SIDES])
        mesh.apply_translation([0.0, 0.0, -float(mesh.bounds.mean(axis=0)[2])])
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(radius=a, height=2.0 * b, sections=ROUND_SIDES)
    else:
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
        mesh.apply_scale(shape.size if shape.kind == "ellipsoid" else a)
    mesh.apply_scale(size)
    at = trimesh.transformations.quaternion_matrix(shape.turn)
    at[:3, 3] = shape.place
    return mesh.apply_transform(at)
