"""A backbone stepped in time under commanded tensions, for whoever decides the next command when the last answer is seen.

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

    def run(self, time: np.ndarray, command: np.ndarray) -> tuple[Seen, int, str]:
        """As `Moving.run`."""
        more = slice(min(1, len(self._time)), None)  # where it stands is known
        self._time, self._command = np.append(self._time, time[more]), np.vstack([self._command, command[more]])
        n, rows = len(self._time), slice(-len(time), None)
        stiffness = np.full(n, 1.0 if self._problem.stiffness is None else self._problem.stiffness[0])
        path = self._statics.solve(replace(self._problem, time=self._time, command=self._command, stiffness=stiffness))
        found = bool(path.started) and bool(path.status[rows].all())
        pulls = ", ".join(f"{T:.4g}" for T in command[-1])
        seen = Seen(path.markers[rows], path.path[rows], path.tension[rows], path.others["temperature"][rows], path.q[rows])
        return seen, len(time) if found else 0, "" if found else f"no equilibrium under tensions {pulls} N at t = {time[-1]:.4g} s"


class Plant:
    """A body with tendons, driven by commanded load-cell readings at equal intervals. One instance serves one thread."""

    def __init__(self, twin: Twin, interval: float, payload: float = 0.0, dynamic: bool = True) -> None:
        """At rest, slack, under its own gravity and `payload` (kg). Raises DataError for a robot without a backbone, SolveError
        where the load has no equilibrium."""
        self.twin, self.interval, self.body = twin, interval, twin.robot.chain(twin.body())
        laws, n = twin.laws, twin.robot.n_tendon
        dynamics = Dynamics(self.body)
        loads, stiffness = laws.surround(Loads(twin.robot.gravity, payload)), laws.stiffness(np.full(1, ROOM), np.zeros(1))
        self.moving = (Moving if dynamic else Resting)(
            dynamics, Problem(np.zeros(1), np.zeros((1, n)), loads, laws.route, creep=laws.creep, stiffness=stiffness)
        )
        self._straight, self._stretch = dynamics.straight_path, laws.route.stretch
        self._wires = Wires(laws, Drive.TENSION, n)
        base = self._wires.driven(0.0, np.zeros(n))
        seen, samples, lost = self.moving.run(np.zeros(1), base[None])
        if samples < 1:
            raise SolveError(lost)
        self._note(seen, 0)

    def step(self, command: np.ndarray) -> Sensed:
        """One interval on, tensions going straight to what `command` (n_tendon,) N makes of them. Raises SolveError where the
        motion is lost."""
        self._wires.driven(self._wires.time[-1] + self.interval, command)
        seen, samples, lost = self.moving.run(np.array(self._wires.time[-2:]), np.array(self._wires.base[-2:]))
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
        travel = self._straight - seen.path[i] + self._stretch * seen.tension[i]
        self._wires.note(seen.tension[i], travel, self.body.frame.reported(seen.markers[i]))
