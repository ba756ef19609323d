"""Frames of a robot and its goal by MuJoCo's own renderer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from twin.errors import TwinError

HEIGHT, WIDTH = 480, 640
GOAL, HERE = (0.1, 0.7, 0.2, 0.8), (0.85, 0.2, 0.15, 1.0)  # colours

GLASS = 0.55  # how much of what is behind silicone it hides: marks of what is wanted may lie within


class Mark(NamedTuple):
    """A ball of a radius (m) at a place (3,) m; with `to` (3,) m an arrow from there to that, as thick."""

    place: np.ndarray
    radius: float
    colour: tuple[float, float, float, float] = GOAL
    to: np.ndarray | None = None


_failed: list[str] = []  # why this process cannot draw: OpenGL aborts the process where it is asked once more


def _renderer(model: mujoco.MjModel) -> mujoco.Renderer:
    """Raises TwinError where this machine cannot draw."""
    if not _failed:
        try:
            return mujoco.Renderer(model, HEIGHT, WIDTH)
        except Exception as fault:  # whatever the machine's OpenGL raises
            _failed.append(f"{type(fault).__name__}: {fault}")
    raise TwinError(
        f"MuJoCo cannot draw here ({_failed[0]}); without a screen set MUJOCO_GL=egl before Python starts and install libegl1, or "
        "MUJOCO_GL=osmesa and libosmesa6"
    )


class Picture:
    """A camera on a model of one shape, whatever its parameters: only its coordinates change."""

    def __init__(self, spec: mujoco.MjSpec, size: float, upside_down: bool = False) -> None:
        """`size` (m) is how far the model reaches along z, which `upside_down` points to the ground. Raises TwinError where this
        machine cannot draw."""
        spec = spec.copy()
        spec.add_texture(
            name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, width=64, height=384,
            rgb1=[0.95, 0.96, 0.98], rgb2=[0.75, 0.8, 0.86],
        )  # fmt: skip
        up = -1.0 if upside_down else 1.0
        spec.worldbody.add_light(pos=[size, -2.0 * size, up * 3.0 * size], dir=[-1.0, 2.0, -2.0 * up])
        for flex in spec.flexes:
            flex.rgba[3] = GLASS
        spec.stat.extent = size
        self._model = spec.compile()
        self._data, self._upside_down = mujoco.MjData(self._model), upside_down
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:], self._camera.distance = [0.0, 0.0, 0.5 * size], 2.6 * size
        self._camera.azimuth, self._camera.elevation = 130.0, -20.0 * up
        self._renderer = _renderer(self._model)

    def draw(self, q: np.ndarray, marks: Sequence[Mark]) -> np.ndarray:
        """(HEIGHT, WIDTH, 3) bytes of the model at coordinates q (nq,), and what is marked."""
        model, data = self._model, self._data
        data.qpos[:] = q
        # Where everything is; no forces, which laws of ours would have a part in.
        for placed in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
            placed(model, data)
        self._renderer.update_scene(data, self._camera)
        scene = self._renderer.scene
        for mark in marks:
            drawn = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(
                drawn, mujoco.mjtGeom.mjGEOM_SPHERE, [mark.radius, 0, 0], mark.place, np.eye(3).ravel(), mark.colour
            )
            if mark.to is not None:
                mujoco.mjv_connector(drawn, mujoco.mjtGeom.mjGEOM_ARROW, mark.radius, mark.place, mark.to)
            scene.ngeom += 1
        seen = self._renderer.render()
        return np.ascontiguousarray(seen[::-1, ::-1]) if self._upside_down else seen

    def close(self) -> None:
        self._renderer.close()
