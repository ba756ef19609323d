"""Render frames of a robot and its goal by MuJoCo's own renderer."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from twin.foundation.errors import TwinError

FRAME_HEIGHT, FRAME_WIDTH = 480, 640
GOAL_COLOUR, PRESENT_COLOUR = (0.1, 0.7, 0.2, 0.8), (0.85, 0.2, 0.15, 1.0)  # red, green, blue, alpha

SILICONE_OPACITY = 0.55  # marks within the silicone stay visible


class Mark(NamedTuple):
    """A ball of a radius (m) at a place (3,) m; with `to` (3,) m an arrow from there to that place, as thick."""

    place: np.ndarray
    radius: float
    colour: tuple[float, float, float, float] = GOAL_COLOUR
    to: np.ndarray | None = None


_rendering_faults: list[str] = []  # OpenGL aborts the process at a second try


def _open_renderer(model: mujoco.MjModel) -> mujoco.Renderer:
    """Open MuJoCo's renderer. Raises TwinError where this machine cannot draw."""
    if not _rendering_faults:
        try:
            return mujoco.Renderer(model, FRAME_HEIGHT, FRAME_WIDTH)
        except Exception as fault:  # depends on the machine's OpenGL
            _rendering_faults.append(f"{type(fault).__name__}: {fault}")
    raise TwinError(
        f"MuJoCo cannot draw here ({_rendering_faults[0]}); without a screen set MUJOCO_GL=egl before Python starts and "
        "install libegl1, or MUJOCO_GL=osmesa and libosmesa6"
    )


class FrameRenderer:
    """A camera on one model; only its coordinates change, not its parameters."""

    def __init__(
        self, spec: mujoco.MjSpec, size: float, upside_down: bool = False, middle: np.ndarray | None = None
    ) -> None:  # fmt: skip
        """`size` (m): extent of the model along z, which `upside_down` points to the ground; `middle` (3,) m: else half of it.

        Raises TwinError where this machine cannot draw.
        """
        spec = spec.copy()
        spec.add_texture(
            name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, width=64, height=384,
            rgb1=[0.95, 0.96, 0.98], rgb2=[0.75, 0.8, 0.86],
        )  # fmt: skip
        up = -1.0 if upside_down else 1.0
        spec.worldbody.add_light(pos=[size, -2.0 * size, up * 3.0 * size], dir=[-1.0, 2.0, -2.0 * up])
        for flex in spec.flexes:
            flex.rgba[3] = SILICONE_OPACITY
        spec.stat.extent = size
        self._model = spec.compile()
        self._data, self._upside_down = mujoco.MjData(self._model), upside_down
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:] = [0.0, 0.0, 0.5 * size] if middle is None else middle
        self._camera.distance = 2.6 * size
        self._camera.azimuth, self._camera.elevation = 130.0, -20.0 * up
        self._renderer = _open_renderer(self._model)

    def move(self, name: str, height: float) -> None:
        """Move a body that has no coordinates, to this height (m)."""
        self._model.body(name).pos[2] = height

    def draw(self, q: np.ndarray, marks: Sequence[Mark]) -> np.ndarray:
        """Return a frame (FRAME_HEIGHT, FRAME_WIDTH, 3), bytes, of the model at coordinates q (nq,), with marks."""
        model, data = self._model, self._data
        data.qpos[:] = q
        # Kinematics alone: the forces come from the twin's own laws.
        for placed in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
            placed(model, data)
        self._renderer.update_scene(data, self._camera)
        scene = self._renderer.scene
        for mark in marks:
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_SPHERE, [mark.radius, 0, 0], mark.place, np.eye(3).ravel(), mark.colour)
            if mark.to is not None:
                mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, mark.radius, mark.place, mark.to)
            scene.ngeom += 1
        frame = self._renderer.render()
        return np.ascontiguousarray(frame[::-1, ::-1]) if self._upside_down else frame

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()
