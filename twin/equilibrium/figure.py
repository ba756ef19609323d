"""A backbone as it is drawn: links and disks as MuJoCo has them, tendons from hole to hole."""

from __future__ import annotations

import mujoco
import numpy as np

from twin.body import Path, Problem
from twin.effects import Loads, Route
from twin.equilibrium import Equilibrium
from twin.equilibrium.along import tension_along
from twin.equilibrium.chain import Law
from twin.figure import Frames, Range, stacked
from twin.hinges import HingeChain


class ChainFigure:
    """As `Figure`. Its colours are the tension along the tendons."""

    def __init__(self, body: HingeChain, solver: Equilibrium) -> None:
        self._body, self._solver = body, solver
        self.faces = np.zeros((0, 3), np.uint32)
        self.cylinders = solver.model.geom_size[:, :2].copy()
        self.colour = (255 * solver.model.geom_rgba[:, :3]).astype(np.uint8)
        self.height = body.length

    def coloured(self, most: float) -> Range:
        return Range("tension along the tendons", "N", 1.0, 0.0, most)

    def frames(self, path: Path, loads: Loads, route: Route) -> Frames:
        solver, nt = self._solver, len(self._solver.chain.pieces)
        z, s, along = (np.zeros((nt, solver.chain.hole.shape[1] - 1)) for _ in range(3))
        law = Law(float(route.mu), float(route.presliding), np.array(loads.wall, float))
        slack = solver.solve(Problem(np.zeros(1), np.zeros((1, nt)), loads, route))
        drawn = []
        for q, tension in ((slack.q[0], np.zeros(nt)), *zip(path.q, path.tension, strict=True)):
            solver.data.qpos[:] = q
            mujoco.mj_kinematics(solver.model, solver.data)
            tension_along(solver.chain, law, np.maximum(tension, 0.0), z, s, along)
            drawn.append(self._drawn(along))
        return stacked(drawn[1:], self._body.frame.reported(path.markers))

    def _drawn(self, along: np.ndarray) -> tuple[np.ndarray, ...]:
        data, chain = self._solver.data, self._solver.chain
        turn = np.empty((len(self.cylinders), 4))
        for g, matrix in enumerate(data.geom_xmat):
            mujoco.mju_mat2Quat(turn[g], matrix)
        ends = data.site_xpos[chain.hole]
        real = np.arange(along.shape[1]) < chain.pieces[:, None]
        piece = np.stack([ends[:, :-1], ends[:, 1:]], axis=2)[real]
        return data.geom_xpos.copy(), turn, piece, along[real], np.zeros((0, 3)), np.zeros(0)
