"""A figure's frames as viser draws them: handles made once, arrays sent anew.

viser alone: mjviser draws no flex and gives a tendon one colour.
"""

from __future__ import annotations

import numpy as np
import trimesh
import viser

from twin.figure import Figure, Frames, Range
from twin.viewer.colours import colours

MEASURED, PREDICTED, ARROW, CORD = (214, 39, 40), (31, 119, 180), (20, 20, 20), 0.014
NOTHING = np.zeros((0, 3), np.float32)


class Scene:
    """The robot, one unit high, and what was measured beside it."""

    def __init__(self, server: viser.ViserServer, figure: Figure, down: np.ndarray) -> None:
        """`down` (3,) is where gravity points when the camera is set up."""
        self._server, self._scale = server, 1.0 / figure.height
        self._figure = figure
        scene, up = server.scene, -down if np.any(down) else np.array([0.0, 0.0, 1.0])
        scene.set_up_direction(tuple(up / np.linalg.norm(up)))
        side = np.cross(up, [1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 * np.linalg.norm(up) else np.cross(up, [0.0, 1.0, 0.0])
        camera = server.initial_camera
        camera.position = tuple(np.array([0.0, 0.0, 0.5]) + 1.45 * side / np.linalg.norm(side) + 0.35 * up / np.linalg.norm(up))
        camera.look_at, camera.up = (0.0, 0.0, 0.5), tuple(up / np.linalg.norm(up))
        scene.add_frame("/base", axes_length=0.12, axes_radius=0.004)
        self._links = self._cylinders(figure) if len(figure.cylinders) else None
        self._cords: viser.LineSegmentsHandle | None = None
        self._predicted = scene.add_point_cloud("/predicted", NOTHING, PREDICTED, point_size=0.03, point_shape="circle")
        self._measured = scene.add_point_cloud("/measured", NOTHING, MEASURED, point_size=0.03, point_shape="circle")
        self._arrows = scene.add_arrows(
            "/residual", np.zeros((0, 2, 3), np.float32), ARROW, shaft_radius=0.004, head_radius=0.01, head_length=0.02
        )

    def _cylinders(self, figure: Figure) -> viser.BatchedMeshHandle:
        unit = trimesh.creation.cylinder(radius=1.0, height=2.0, sections=24)
        n, size = len(figure.cylinders), self._scale * figure.cylinders
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)).astype(np.float32)
        return self._server.scene.add_batched_meshes_simple(
            "/links", unit.vertices.astype(np.float32), unit.faces.astype(np.uint32), turn, np.zeros((n, 3), np.float32),
            batched_scales=size[:, [0, 0, 1]].astype(np.float32), batched_colors=figure.colour, lod="off", flat_shading=True,
        )  # fmt: skip

    def draw(self, shown: Frames, over: Range) -> None:
        """The first instant of `shown`, coloured `over` a range: its skin by strain if it has one, else its tendons by tension."""
        s = self._scale
        with self._server.atomic():
            if self._links is not None:
                self._links.batched_positions = (s * shown.place[0]).astype(np.float32)
                self._links.batched_wxyzs = shown.turn[0].astype(np.float32)
            pieces = (s * shown.piece[0]).astype(np.float32)
            along = colours(shown.tension[0], over) if not len(self._figure.faces) else np.full((len(pieces), 3), 60, np.uint8)
            shades = np.repeat(_linear(along)[:, None], 2, axis=1)
            if self._cords is None:
                self._cords = self._server.scene.add_line_segments("/tendons", pieces, shades, thickness=CORD)
            self._cords.points, self._cords.colors = pieces, shades
            if len(self._figure.faces):
                shade = _linear(colours(shown.strain[0], over))
                skin = trimesh.Trimesh(s * shown.skin[0], self._figure.faces, vertex_colors=shade, process=False)
                self._server.scene.add_mesh_trimesh("/skin", skin)

    def mark(self, predicted: np.ndarray, measured: np.ndarray, enlarged: float) -> None:
        """Markers (m, 3) m as predicted and as measured (NaN where they were not); arrows from one to the other, so many times as
        long as the residual, none for zero."""
        s, there = self._scale, np.isfinite(measured).all(axis=1)
        start, away = predicted[there], measured[there] - predicted[there]
        with self._server.atomic():
            self._predicted.points = (s * predicted).astype(np.float32)
            self._measured.points = (s * measured[there]).astype(np.float32)
            arrows = np.stack([start, start + enlarged * away], axis=1) if enlarged > 0.0 else np.zeros((0, 2, 3))
            self._arrows.points = (s * arrows).astype(np.float32)


def _linear(srgb: np.ndarray) -> np.ndarray:
    """Bytes that viser, which takes the colours of lines and vertices for linear light, shows as these of sRGB (IEC 61966-2-1)."""
    share = srgb / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)
