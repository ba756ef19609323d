"""Rigid things as meshes, from the spheres, cylinders and boxes that MuJoCo steps."""

from collections.abc import Sequence

import numpy as np
import trimesh
import viser

from twin.mechanics.silicone.motion.things import FIXED_COLOUR, MOVING_COLOUR, Part, Thing

ROUND_SIDES = 32  # of a cylinder


class Solids:
    """Rigid things in a scene, in order."""

    def __init__(self, server: viser.ViserServer, root: str, scale: float) -> None:
        """Draw below the frame `root`, with `scale` units for a metre."""
        self._server, self._root, self._scale = server, root, scale
        self._things: tuple[Thing, ...] = ()
        self._handles: list[viser.MeshHandle] = []

    def show(self, things: Sequence[Thing]) -> None:
        """Show these things instead of the earlier ones."""
        if tuple(things) == self._things:
            return
        for handle in self._handles:
            handle.remove()
        self._things, self._handles = tuple(things), [self._mesh(t) for t in things]

    def _mesh(self, thing: Thing) -> viser.MeshHandle:
        mesh = trimesh.util.concatenate([part_mesh(part) for part in thing.solids])
        r, g, b, _ = FIXED_COLOUR if thing.fixed else MOVING_COLOUR
        return self._server.scene.add_mesh_simple(
            f"{self._root}/{thing.name}", (self._scale * mesh.vertices).astype(np.float32), mesh.faces.astype(np.uint32),
            color=(round(255 * r), round(255 * g), round(255 * b)), flat_shading=True,
        )  # fmt: skip

    def move(self, place: np.ndarray, turn: np.ndarray) -> None:
        """Move the things to places (thing, 3) m with rotations (thing, 4) w x y z."""
        for handle, p, q in zip(self._handles, place, turn, strict=True):
            handle.position, handle.wxyz = tuple(self._scale * p), tuple(q / np.linalg.norm(q))


def part_mesh(part: Part) -> trimesh.Trimesh:
    """Return the mesh of a part in the frame of its thing, m."""
    if part.shape == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=part.size[0])
    elif part.shape == "cylinder":
        mesh = trimesh.creation.cylinder(radius=part.size[0], height=2.0 * part.size[1], sections=ROUND_SIDES)
    else:
        mesh = trimesh.creation.box(extents=2.0 * np.array(part.size))
    at = trimesh.transformations.quaternion_matrix(part.turn)
    at[:3, 3] = part.place
    return mesh.apply_transform(at)
