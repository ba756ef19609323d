"""A backbone stepped in time under commands, for whoever decides the next command when the last answer is seen.

By MuJoCo's steps, or from one static equilibrium to the next: a robot moved slowly is then known ten times sooner.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from twin.bench import ROOM
from twin.body import Problem
from twin.dynamics import Dynamics, Moving, Seen
from twin.effects import Drive, Loads
from twin.env.wires import Wires
from twin.errors import SolveError
from twin.twin import Twin


class Sensed(NamedTuple):
    """What sensors report at one instant: tension (n_tendon,) N, displacement (n_tendon,) m, markers (n_marker, 3) m; and where the
    tip truly is, (3,) m of the base frame."""

    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    tip: np.ndarray


class Resting:
    """A body that is at rest whenever it is looked at, with the slip and creep of its way there.

    The whole way is solved anew each time, since a solve starts from the unloaded robot: a sample takes some 40 us, so that 20
    intervals of 0.2 s take 12 ms where MuJoCo's steps take 180.
    """

    def __init__(self, dynamics: Dynamics, problem: Problem) -> None:
        self._statics, self._problem = dynamics.statics, problem
        self._time, self._command = np.zeros(0), np.zeros((0, problem.command.shape[1]))

    def run(self, time: np.ndarray, command: np.ndarray, ambient: np.ndarray) -> tuple[Seen, int, str]:
        """As `Moving.run`, in a room at `ROOM`."""
        known = max(0, len(self._time) - 1)  # it stands at the last, from where a current holds that is told now
        self._time, self._command = np.append(self._time[:known], time), np.vstack([self._command[:known], command])
        n, rows, problem = len(self._time), slice(-len(time), None), self._problem
        stiffness = np.full(n, 1.0 if problem.stiffness is None else problem.stiffness[0])
        heating = None if problem.heating is None else replace(problem.heating, ambient=np.full(n, ROOM))
        path = self._statics.solve(replace(problem, time=self._time, command=self._command, stiffness=stiffness, heating=heating))
        found = bool(path.started) and bool(path.status[rows].all())
        unit, factor = problem.drives[0].shown
        pulls = ", ".join(f"{factor * c:.4g}" for c in command[-1])
        seen = Seen(path.markers[rows], path.path[rows], path.tension[rows], path.others["temperature"][rows], path.q[rows])
        return seen, len(time) if found else 0, "" if found else f"no equilibrium under {pulls} {unit} at t = {time[-1]:.4g} s"


class Plant:
    """A body whose tendons are all driven alike at equal intervals, by tensions as load cells read them, displacements or currents
    through springs. One instance serves one thread."""

    def __init__(
        self, twin: Twin, interval: float, payload: float = 0.0, dynamic: bool = True, drive: Drive = Drive.TENSION
    ) -> None:
        """At rest, slack or its springs cold, under its own gravity and `payload` (kg). Raises DataError for a robot without a
        backbone, or without springs for currents to heat, SolveError where the load has no equilibrium."""
        self.twin, self.interval, self.body = twin, interval, twin.robot.chain(twin.body())
        laws, n = twin.laws, twin.robot.n_tendon
        dynamics = Dynamics(self.body)
        loads, stiffness = laws.surround(Loads(twin.robot.gravity, payload)), laws.stiffness(np.full(1, ROOM), np.zeros(1))
        heating = twin.heating(np.full(1, ROOM)) if drive is Drive.CURRENT else None
        problem = Problem(
            np.zeros(1), np.zeros((1, n)), loads, laws.route, (drive,) * n, laws.creep, stiffness=stiffness, heating=heating
        )
        self.moving = (Moving if dynamic else Resting)(dynamics, problem)
        self._straight, self._route = dynamics.straight_path, laws.route
        self._wires = Wires(laws, drive, n)
        base = self._wires.driven(0.0, np.zeros(n))
        seen, samples, lost = self.moving.run(np.zeros(1), base[None], np.full(1, ROOM))
        if samples < 1:
            raise SolveError(lost)
        self._note(seen, 0)

    def step(self, command: np.ndarray) -> Sensed:
        """One interval on, tensions or displacements going straight to what `command` (n_tendon,) N or m makes of them, currents
        (A) as it makes them all the time. Raises SolveError where the motion is lost."""
        self._wires.driven(self._wires.time[-1] + self.interval, command)
        seen, samples, lost = self.moving.run(np.array(self._wires.time[-2:]), np.array(self._wires.base[-2:]), np.full(2, ROOM))
        if samples < 2:
            raise SolveError(lost)
        self._note(seen, 1)
        return self.sensed()

    def sensed(self) -> Sensed:
        """As its sensors report it now."""
        seen = self._wires.sensed()
        return Sensed(seen.tension[-1], seen.displacement[-1], seen.markers[-1], self._tip)

    def _note(self, seen: Seen, i: int) -> None:
        self._tip, self.q = seen.markers[i, -1], seen.q[i]
        travel = self._straight - seen.path[i] + self._route.elongation(seen.tension[i])
        self._wires.note(seen.tension[i], travel, self.body.frame.reported(seen.markers[i]))
