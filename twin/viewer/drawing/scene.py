"""Draw frames of a robot with viser: handles are made once, arrays are sent for each frame.

mjviser is not used: it draws no flex and gives a tendon one colour.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import trimesh
import viser
from trimesh.exchange.gltf import export_glb

from twin.body.drawable import ColourScale, Drawable, Frames
from twin.viewer.drawing.colours import colour_values
from twin.viewer.drawing.shapes import Shapes

MEASURED_RGB, PREDICTED_RGB, ARROW_RGB, PUSH_RGB, DARK_GREY = (214, 39, 40), (31, 119, 180), (20, 20, 20), (255, 54, 1), 60
CORD_THICKNESS, THIN_LINE, GLASS_RGB = 0.014, 0.006, (200, 205, 215)
EMPTY_CLOUD = np.zeros((0, 3), np.float32)
ROBOT_DISTANCE, NARROW_ROBOT = 0.9, 0.2  # heights: distance of two robots side by side, up to this width
OBLIQUE = 0.5  # of a figure's best view, that must lie across gravity to be taken
LONGEST_PUSH_ARROW = 0.3  # heights, of the largest push


def place_robots(server: viser.ViserServer, down: np.ndarray, figures: Sequence[Drawable]) -> list[np.ndarray]:
    """Set the camera before robots side by side, gravity along `down` (3,); return the position of each (3,), heights."""
    up = -down / np.linalg.norm(down) if np.any(down) else np.array([0.0, 0.0, 1.0])
    server.scene.set_up_direction(tuple(up))
    side = np.cross(up, [1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.cross(up, [0.0, 1.0, 0.0])
    best = figures[0].view - up * (up @ figures[0].view)
    if np.linalg.norm(best) > OBLIQUE * np.linalg.norm(figures[0].view):
        side = best if best @ side >= 0.0 else -best
    side /= np.linalg.norm(side)
    n, wide = len(figures), max(_width(f) for f in figures)
    apart = ROBOT_DISTANCE + max(0.0, wide - NARROW_ROBOT)
    away = 1.45 if n == 1 else 1.05 + 0.5 * apart
    camera = server.initial_camera
    middle = figures[0].middle / figures[0].height
    camera.position = tuple(middle + away * side + 0.35 * up)
    camera.look_at, camera.up = tuple(middle), tuple(up)
    right = np.cross(-side, up)
    return [(k - 0.5 * (n - 1)) * apart * right for k in range(n)]


def _width(figure: Drawable) -> float:
    """Return how wide a figure is, heights."""
    return 1.0 if figure.solids else 2.0 * float(figure.cylinders[:, 0].max(initial=0.0)) / figure.height


class Scene:
    """A robot, one unit high, with predicted and measured markers."""

    def __init__(self, server: viser.ViserServer, figure: Drawable, name: str, where: np.ndarray) -> None:
        """Draw the robot at `where` (3,), with `name` above unless it is empty; the first letter must be unique."""
        self._server, self.scale, self._figure, self._position = server, 1.0 / figure.height, figure, where
        self.root = root = f"/robot_{name[:1] or 'shown'}"
        scene = server.scene
        scene.add_frame(root, axes_length=0.12, axes_radius=0.004, position=tuple(where))
        if name:
            scene.add_label(f"{root}/name", name, position=(0.0, 0.0, 1.12), anchor="center-center", font_screen_scale=1.2)
        self._links = self._cylinders(figure) if len(figure.cylinders) else None
        self._shapes = Shapes(server, f"{root}/shapes", self.scale, figure.solids)
        self._ghost: Shapes | None = None
        self._lines = {kind: self._segments(kind) for kind in ("tendons", "cords", "coils")}
        self._skin: viser.GlbHandle | None = None
        self._glass: viser.MeshHandle | None = None
        self._predicted = scene.add_point_cloud(
            f"{root}/predicted", EMPTY_CLOUD, PREDICTED_RGB, point_size=0.03, point_shape="circle"
        )
        self._measured = scene.add_point_cloud(f"{root}/measured", EMPTY_CLOUD, MEASURED_RGB, point_size=0.03, point_shape="circle")
        none = np.zeros((0, 2, 3), np.float32)
        self._arrows = scene.add_arrows(f"{root}/residual", none, ARROW_RGB, shaft_radius=0.004, head_radius=0.01, head_length=0.02)
        self._push = scene.add_arrows(f"{root}/push", none, PUSH_RGB, shaft_radius=0.009, head_radius=0.022, head_length=0.045)

    def _cylinders(self, figure: Drawable) -> viser.BatchedMeshHandle:
        unit = trimesh.creation.cylinder(radius=1.0, height=2.0, sections=24)
        n, size = len(figure.cylinders), self.scale * figure.cylinders
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)).astype(np.float32)
        return self._server.scene.add_batched_meshes_simple(
            f"{self.root}/links", unit.vertices.astype(np.float32), unit.faces.astype(np.uint32), turn,
            np.zeros((n, 3), np.float32), batched_scales=size[:, [0, 0, 1]].astype(np.float32), batched_colors=figure.link_colours,
            lod="off", flat_shading=True,
        )  # fmt: skip

    def _segments(self, kind: str) -> viser.LineSegmentsHandle:
        none = np.zeros((0, 2, 3), np.float32)
        return self._server.scene.add_line_segments(f"{self.root}/{kind}", none, none.astype(np.uint8), thickness=CORD_THICKNESS)

    def draw(self, shown: Frames, shade: str, over: Mapping[str, ColourScale]) -> None:
        """Draw the first instant of `shown`.

        `shade` names the field that colours the skin or, within a skin of glass, the cords or tendons. `over` gives the range
        of colours for each field.
        """
        with self._server.atomic():
            if self._links is not None:
                self._links.batched_positions = (self.scale * shown.link_positions[0]).astype(np.float32)
                self._links.batched_wxyzs = shown.link_quaternions[0].astype(np.float32)
            if self._figure.solids:
                self._shapes.move(shown.link_positions[0], shown.link_quaternions[0])
            self._draw_lines("tendons", shown.tendon_pieces[0], shown.tension[0], over["tension"] if shade == "tension" else None)
            self._draw_lines(
                "cords", shown.cord_pieces[0], shown.resistance[0], over["resistance"] if shade == "resistance" else None
            )
            self._draw_lines("coils", shown.spring_pieces[0], shown.temperature[0], over.get("temperature"))
            if len(self._figure.faces):
                self._draw_skin(shown, over["strain"] if shade == "strain" else None)

    def _draw_lines(self, kind: str, pieces: np.ndarray, values: np.ndarray, over: ColourScale | None) -> None:
        line, shade = (
            self._lines[kind],
            np.full((len(pieces), 3), DARK_GREY, np.uint8) if over is None else colour_values(values, over),
        )
        line.points = (self.scale * pieces).astype(np.float32)
        line.colors = np.repeat(_linear(shade)[:, None], 2, axis=1)
        line.thickness = CORD_THICKNESS if over is not None else THIN_LINE

    def _draw_skin(self, shown: Frames, over: ColourScale | None) -> None:
        """Draw the skin, coloured by strain `over` a range, or as glass."""
        points = self.scale * shown.skin[0]
        if over is not None:
            skin = trimesh.Trimesh(
                points, self._figure.faces, vertex_colors=_linear(colour_values(shown.strain[0], over)), process=False
            )  # fmt: skip
            # A shadow would change the colours.
            self._skin = self._server.scene.add_glb(
                f"{self.root}/skin", export_glb(skin, tree_postprocessor=_matte), receive_shadow=False
            )
        elif self._skin is not None:
            self._skin.remove()
            self._skin = None
        if self._glass is None and over is None:
            self._glass = self._server.scene.add_mesh_simple(
                f"{self.root}/glass", points.astype(np.float32), self._figure.faces, color=GLASS_RGB, opacity=0.25
            )
        if self._glass is not None:
            self._glass.visible = over is None
            if over is None:
                self._glass.vertices = points.astype(np.float32)

    def draw_markers(self, predicted: np.ndarray, measured: np.ndarray, enlarged: float) -> None:
        """Draw markers (m, 3) m as predicted and as measured (NaN where missing).

        Arrows from predicted to measured are `enlarged` times as long as the residual; no arrows for zero.
        """
        s, there = self.scale, np.isfinite(measured).all(axis=1)
        start, away = predicted[there], measured[there] - predicted[there]
        with self._server.atomic():
            self._predicted.points = (s * predicted).astype(np.float32)
            self._measured.points = (s * measured[there]).astype(np.float32)
            arrows = np.stack([start, start + enlarged * away], axis=1) if enlarged > 0.0 else np.zeros((0, 2, 3))
            self._arrows.points = (s * arrows).astype(np.float32)

    def draw_ghost(self, measured: Frames | None) -> None:
        """Draw the robot once more where its joints were measured, in the measured markers' colour; None hides it."""
        if measured is None and self._ghost is None:
            return
        if self._ghost is None:
            self._ghost = Shapes(self._server, f"{self.root}/ghost", self.scale, self._figure.solids, MEASURED_RGB)
        with self._server.atomic():
            if measured is not None:
                self._ghost.move(measured.link_positions[0], measured.link_quaternions[0])
            else:
                self._ghost.hide()

    def draw_push(self, at: np.ndarray, force: np.ndarray) -> None:
        """Draw an arrow that ends at (3,) m, along a force (3,) divided by the largest force."""
        if not len(self._figure.push_points):
            return
        size, faces = float(np.linalg.norm(force)), len(self._figure.faces)
        rim = 0.0 if faces else float(self._figure.cylinders[:, 0].max())  # a disk is pushed at its centre
        end = self.scale * (at - rim * force / max(size, 1e-12))
        arrow = np.stack([end - LONGEST_PUSH_ARROW * force, end])[None] if size > 0.0 else np.zeros((0, 2, 3))
        self._push.points = arrow.astype(np.float32)

    def point_on_ray(self, shown: Frames, origin: np.ndarray, direction: np.ndarray) -> int | None:
        """Return the index of the figure's hold that a ray (heights) meets first; None if it meets none."""
        points = self.scale * self._figure.push_positions(shown) + self._position
        if not len(points):
            return None
        along = (points - origin) @ direction
        off = np.linalg.norm(points - origin - along[:, None] * direction, axis=1)
        near = np.flatnonzero(off < max(1.3 * float(off.min()), RAY_TOLERANCE))
        return int(near[along[near].argmin()]) if off.min() < LARGEST_MISS else None


RAY_TOLERANCE, LARGEST_MISS = 0.02, 0.12  # heights from the ray: of points to choose from; beyond it the click missed


def _matte(tree: dict[str, Any]) -> None:
    """Set a matte material; without one the glTF standard assumes metal, which is nearly black."""
    tree["materials"] = [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}]
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["material"] = 0


def _linear(srgb: np.ndarray) -> np.ndarray:
    """Convert sRGB bytes (IEC 61966-2-1) to linear light, as viser expects for lines and vertices."""
    share = srgb / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)
