"""Frames of a robot and its goal by MuJoCo's own renderer."""

from __future__ import annotations

import mujoco
import numpy as np

from twin.body import Body
from twin.errors import TwinError

HEIGHT, WIDTH = 480, 640
GOAL = [0.1, 0.7, 0.2, 0.8]


class Picture:
    """A camera on a body of one shape, whatever its parameters: only its joints move."""

    def __init__(self, body: Body, size: float) -> None:
        """`size` (m) is the body's. Raises TwinError where this machine cannot draw."""
        spec = body.spec.copy()
        spec.add_texture(
            name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, width=64, height=384,
            rgb1=[0.95, 0.96, 0.98], rgb2=[0.75, 0.8, 0.86],
        )  # fmt: skip
        spec.worldbody.add_light(pos=[size, -2.0 * size, 3.0 * size], dir=[-1.0, 2.0, -2.0])
        spec.stat.extent = size
        self._model = spec.compile()
        self._data, self._size = mujoco.MjData(self._model), size
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:], self._camera.distance = [0.0, 0.0, 0.5 * size], 2.6 * size
        self._camera.azimuth, self._camera.elevation = 130.0, -20.0
        try:
            self._renderer = mujoco.Renderer(self._model, HEIGHT, WIDTH)
        except Exception as fault:  # whatever the machine's OpenGL raises
            raise TwinError(
                f"MuJoCo cannot draw here ({type(fault).__name__}: {fault}); without a screen set MUJOCO_GL=egl before Python "
                "starts and install libegl1, or MUJOCO_GL=osmesa and libosmesa6"
            ) from None

    def draw(self, q: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(HEIGHT, WIDTH, 3) bytes of the body at joint angles q (nv,), a ball at `goal` (3,) m."""
        self._data.qpos[:] = q
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        scene = self._renderer.scene
        ball = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(ball, mujoco.mjtGeom.mjGEOM_SPHERE, [0.025 * self._size, 0, 0], goal, np.eye(3).ravel(), GOAL)
        scene.ngeom += 1
        return self._renderer.render()

    def close(self) -> None:
        self._renderer.close()
