"""A twin stepped in time under commanded tensions, for whoever decides the next command when the last answer is seen.

Effects see the whole episode so far, as they see a trial: lag, drift and hysteresis go on from step to step, and a delay answers
with what was commanded then.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from twin.bench import ROOM
from twin.body import Problem
from twin.dynamics import Dynamics, Moving
from twin.effects import Drive, Loads, Signals
from twin.errors import DataError, SolveError
from twin.hinges import HingeChain
from twin.robots.family import family
from twin.twin import Twin


class Sensed(NamedTuple):
    """What sensors report at one instant: tension (n_tendon,) N, displacement (n_tendon,) m, markers (n_marker, 3) m; and where the
    tip truly is, (3,) m of the base frame."""

    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    tip: np.ndarray


class Plant:
    """A body with tendons, driven by commanded load-cell readings at equal intervals. One instance serves one thread."""

    def __init__(self, twin: Twin, interval: float, payload: float = 0.0) -> None:
        """At rest, slack, under its own gravity and `payload` (kg). Raises DataError for a robot without dynamics, SolveError where
        the load has no equilibrium."""
        self.twin, self.interval, self.body = twin, interval, twin.body()
        if family(twin.robot.family).dynamics is None or not isinstance(self.body, HingeChain):
            raise DataError(f"robot {twin.robot.name!r} has no dynamics here: give a twin of a backbone pulled by tendons")
        laws = self._laws = twin.laws
        n = twin.robot.n_tendon
        dynamics = cast(Dynamics, twin.robot.solver(self.body, dynamic=True))
        loads, stiffness = laws.surround(Loads(twin.robot.gravity, payload)), laws.stiffness(np.full(1, ROOM), np.zeros(1))
        self.moving = Moving(
            dynamics, Problem(np.zeros(1), np.zeros((1, n)), loads, laws.route, creep=laws.creep, stiffness=stiffness)
        )
        self._straight, self._acts = dynamics.straight_path, any(e.acts_in("command", "drive") for e in twin.effects)
        self._senses = any(e.acts_in("sense") for e in twin.effects)
        self._time, self._reported, self._base = [0.0], [np.zeros(n)], [self._driven([0.0], [np.zeros(n)])]
        seen, _, _ = self.moving.run(np.zeros(1), self._base[0][None])
        self._displacement, self._markers = [self._travel(seen.path[0], self._base[0])], [seen.markers[0]]

    def step(self, command: np.ndarray) -> Sensed:
        """One interval on, tensions going straight to what `command` (n_tendon,) N makes of them. Raises SolveError where the
        motion is lost."""
        self._time.append(self._time[-1] + self.interval)
        self._reported.append(np.array(command, float))
        self._base.append(self._driven(self._time, self._reported))
        seen, samples, lost = self.moving.run(np.array(self._time[-2:]), np.array(self._base[-2:]))
        if samples < 2:
            raise SolveError(lost)
        self._displacement.append(self._travel(seen.path[1], self._base[-1]))
        self._markers.append(seen.markers[1])
        return self.sensed()

    def sensed(self) -> Sensed:
        """As its sensors report it now."""
        tip, keep = self._markers[-1][-1], len(self._time) if self._senses else 1
        true = self._signals(
            self._time[-keep:], np.array(self._base[-keep:]), np.array(self._displacement[-keep:]),
            self.body.frame.reported(np.array(self._markers[-keep:])),
        )  # fmt: skip
        seen = self._laws.sense(true) if self._senses else true
        return Sensed(seen.tension[-1], seen.displacement[-1], seen.markers[-1], tip)

    def _driven(self, time: list[float], reported: list[np.ndarray]) -> np.ndarray:
        if not self._acts:
            return reported[-1]
        tension = np.array(reported)
        signals = self._signals(time, tension, np.zeros_like(tension), np.zeros((len(time), 0, 3)))
        return np.maximum(self._laws.drive(self._laws.command(signals)).tension[-1], 0.0)

    def _signals(self, time: list[float], tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray) -> Signals:
        now = np.array(time)
        return Signals(
            now, now, tension, displacement, markers, np.full(len(now), ROOM), (Drive.TENSION,) * tension.shape[1],
            np.zeros_like(tension),
        )  # fmt: skip

    def _travel(self, path: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return self._straight - path + self._laws.route.stretch * tension
