"""A robot under sliders: its shape under tensions and loads, from where it stood."""

from __future__ import annotations

from typing import Protocol, cast

import numpy as np

from twin.body import Problem
from twin.effects import Loads
from twin.equilibrium.along import tension_along
from twin.errors import SolveError
from twin.kinematics import LoadedRobot
from twin.twin import Twin
from twin.viewer.figures import ChainFigure, Figure, Frames, SoftFigure


class Live(Protocol):
    def shape(self, tension: np.ndarray, loads: Loads) -> Frames:
        """One instant under base tensions (n_tendon,) N, as load cells read them. Raises SolveError where there is none."""
        ...


def live(twin: Twin, figure: Figure) -> Live:
    return SoftLive(twin, figure) if isinstance(figure, SoftFigure) else ChainLive(twin, cast(ChainFigure, figure))


class ChainLive:
    """A backbone, its friction's history kept while its loads stay as they are."""

    def __init__(self, twin: Twin, figure: ChainFigure) -> None:
        self._twin, self._figure, self._loads = twin, figure, Loads(twin.robot.gravity)
        self._robot = LoadedRobot(twin, self._loads)

    def shape(self, tension: np.ndarray, loads: Loads) -> Frames:
        if loads.payload != self._loads.payload or not np.array_equal(loads.gravity, self._loads.gravity):
            self._robot, self._loads = LoadedRobot(self._twin, loads), loads
        robot = self._robot
        seen = robot.pull(tension)
        along = np.zeros((robot.n_tendon, robot.now.z.shape[1]))
        tension_along(robot.solver.chain, robot.law, robot.tension, robot.now.z.copy(), robot.now.s.copy(), along)
        return self._figure.standing(robot.now.q, along, seen.markers)


class SoftLive:
    """A silicone finger, pulled anew from slack every time."""

    def __init__(self, twin: Twin, figure: SoftFigure) -> None:
        self._twin, self._figure = twin, figure
        self._solver = twin.robot.solver(figure.body)

    def shape(self, tension: np.ndarray, loads: Loads) -> Frames:
        laws = self._twin.laws
        command = np.vstack([np.zeros_like(tension), tension])
        path = self._solver.solve(Problem(np.arange(2.0), command, laws.surround(loads), laws.route))
        if not path.status.all():
            raise SolveError(f"no equilibrium under tensions {np.round(tension, 2).tolist()} N")
        return self._figure.frames(path, loads).at(1)
