"""A backbone as it is drawn: links and disks as MuJoCo has them, tendons from hole to hole, SMA springs behind the base."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from twin.body import Heating, Path, Problem
from twin.effects import Drive, Loads, Route
from twin.equilibrium import ChainPath, Equilibrium
from twin.equilibrium.along import tension_along
from twin.equilibrium.chain import Law
from twin.figure import LINES, VALUES, Frames, Instant, Range, stacked
from twin.hinges import HingeChain
from twin.springs import Spring

# A spring's length is to scale but for what it has when closed; its coils, whose diameter no description tells, are for the eye.
# Lengths are shares of the robot's height.
CLOSED, COIL, SIDES = 0.04, 0.022, 12
REACH = 3.0  # elongations on the straight robot, from the base to a spring's far end, which is fixed


class ChainFigure:
    """As `Figure`. Its colours are the tension along the tendons and the temperature of the springs that pull them."""

    shades = ("tension",)

    def __init__(self, body: HingeChain, solver: Equilibrium) -> None:
        self._body, self._solver = body, solver
        self.faces = np.zeros((0, 3), np.uint32)
        self.cylinders = solver.model.geom_size[:, :2].copy()
        self.colour = (255 * solver.model.geom_rgba[:, :3]).astype(np.uint8)
        self.height = body.length
        self._place(solver.model.qpos0)
        disks = solver.data.site_xpos[solver.chain.disk]
        self._disk = np.linalg.norm(solver.data.geom_xpos[None] - disks[:, None], axis=2).argmin(axis=1)
        self.holds = np.column_stack([disks[:, 2] / body.length, np.zeros((len(disks), 2))])

    def grips(self, shown: Frames) -> np.ndarray:
        return shown.place[0, self._disk]

    def coloured(self, shade: str, most: float) -> Range:
        if shade == "temperature":
            return Range("temperature of the SMA springs", "degC", 1.0, 20.0, float(np.ceil((most - 273.15) / 20.0) * 20.0), 273.15)
        return Range("tension along the tendons", "N", 1.0, 0.0, most)

    def frames(self, path: Path, loads: Loads, route: Route, heating: Heating | None = None) -> Frames:
        nothing = np.zeros((1, path.tension.shape[1]))
        start, springs = Problem(np.zeros(1), nothing, loads, route), None
        if heating is not None:
            heating, springs = replace(heating, ambient=heating.ambient[:1]), heating.spring
            start = replace(start, drives=(Drive.CURRENT,) * nothing.size, heating=heating)
        began = self._solver.solve(start)
        law, slip = Law(float(route.mu), float(route.presliding), np.zeros(5)), (began.slip, began.distal)
        drawn = [self._drawn(path, i, law, slip, _stretched(path, i, self._solver, route, springs)) for i in range(len(path.q))]
        return stacked(drawn, self._body.frame.reported(path.markers))

    def standing(self, path: ChainPath, route: Route, springs: Spring) -> Frames:
        """The last instant of a path, from which its slip is known."""
        law, slip = Law(float(route.mu), float(route.presliding), np.zeros(5)), (path.slip.copy(), path.distal.copy())
        drawn = self._drawn(path, -1, law, slip, _stretched(path, -1, self._solver, route, springs))
        return stacked([drawn], self._body.frame.reported(path.markers[-1:]))

    def _place(self, q: np.ndarray) -> None:
        self._solver.data.qpos[:] = q
        mujoco.mj_kinematics(self._solver.model, self._solver.data)

    def _drawn(
        self, path: Path, i: int, law: Law, slip: tuple[np.ndarray, np.ndarray], elongation: np.ndarray | None
    ) -> Instant:  # fmt: skip
        """Instant i; `slip` goes on to there."""
        data, chain = self._solver.data, self._solver.chain
        self._place(path.q[i])
        along = np.zeros_like(slip[0])
        tension_along(chain, law, np.maximum(path.tension[i], 0.0), *slip, along)
        turn = np.empty((len(self.cylinders), 4))
        for g, matrix in enumerate(data.geom_xmat):
            mujoco.mju_mat2Quat(turn[g], matrix)
        ends = data.site_xpos[chain.hole]
        real = np.arange(along.shape[1]) < chain.pieces[:, None]
        piece, tension = np.stack([ends[:, :-1], ends[:, 1:]], axis=2)[real], along[real]
        coil, warm = LINES, VALUES
        if elongation is not None:
            lead, coils = self._sprung(ends[:, 0], elongation)
            piece, tension = np.concatenate([piece, lead]), np.concatenate([tension, along[:, 0]])
            coil, warm = coils.reshape(-1, 2, 3), np.repeat(path.others["temperature"][i], coils.shape[1])
        return Instant(data.geom_xpos.copy(), turn, piece, tension, coil=coil, temperature=warm)

    def _sprung(self, hole: np.ndarray, elongation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Leads (n, 2, 3) m from the base's holes (n, 3) to the springs; their pieces (n, w, 2, 3)."""
        n, h, turns = len(hole), self.height, 8
        long = CLOSED * h + np.maximum(elongation[:, 0], 0.0)
        far = hole[:, 2] - CLOSED * h - REACH * elongation[:, 1]
        u = np.linspace(0.0, 1.0, turns * SIDES + 1)
        around = 2.0 * np.pi * turns * u
        circle = COIL * h * np.stack([np.cos(around), np.sin(around)], axis=1)
        wire = np.empty((n, len(u), 3))
        wire[..., :2] = hole[:, None, :2] + circle
        wire[..., 2] = far[:, None] + long[:, None] * u
        lead = np.stack([hole, np.column_stack([hole[:, :2], far + long])], axis=1)
        return lead, np.stack([wire[:, :-1], wire[:, 1:]], axis=2)


def _stretched(path: Path, i: int, solver: Equilibrium, route: Route, springs: Spring | None) -> np.ndarray | None:
    """Elongation (n_tendon, 2) m of the springs at sample i and on the straight robot; none without springs."""
    if springs is None:
        return None
    put_on = solver.zero_path(route, np.ones(len(path.path[i]), bool), springs)
    now = springs.initial_elongation + path.path[i] - put_on - route.elongation(path.tension[i])
    return np.column_stack([now, springs.initial_elongation])
