"""A robot under sliders: its shape under what pulls it and its loads, from where it stood; under currents, as time goes on."""

from __future__ import annotations

import numpy as np

from twin.bench import ROOM, Inputs
from twin.effects import Drive, Loads
from twin.equilibrium import Equilibrium
from twin.equilibrium.figure import ChainFigure
from twin.figure import Frames
from twin.kinematics import HeatedRobot
from twin.twin import Twin, alone

TURNS = 24  # back to which friction is followed
STEP = 0.1  # s between equilibria while springs heat, which takes them tens of seconds
ROUNDING = 1e-9  # s
RESTING = 0.01  # K/s: at rest
LONGEST = 900.0  # s within which springs come to rest


class Live:
    """A robot whose friction remembers where its tendons turned, as long as its loads stay as they are.

    Pulls on in one direction wipe out those between, so that the turns are all that friction knows of its history; creep is as of a
    second a turn.
    """

    def __init__(self, twin: Twin, drive: Drive = Drive.TENSION) -> None:
        self._twin, self._drive, self._figure = twin, drive, twin.figure()
        self._loads: Loads | None = None
        self._turns: list[np.ndarray] = []

    def shape(self, pull: np.ndarray, loads: Loads) -> Frames:
        """One instant under pulls (n_tendon,), N as load cells read them or m as drives report. Raises SolveError where there is
        none."""
        if self._loads is None or not _same(loads, self._loads):
            self._turns, self._loads = [np.zeros_like(pull)], loads
        turns = [*(self._turns if _turned(self._turns, pull) else self._turns[:-1]), pull][-TURNS:]
        command, time = np.stack(turns), np.arange(float(len(turns)))
        inputs = Inputs("here", time, time, command, (self._drive,) * len(pull), np.full(len(turns), ROOM), loads)
        trace = alone(self._twin, inputs)
        assert trace.path is not None  # statics without one raise
        self._turns = turns
        return self._figure.frames(trace.path, self._twin.laws.surround(loads), self._twin.laws.route).at(-1)


class Heated:
    """A backbone whose springs currents heat. Its clock goes on as it is told; `time` is s since the springs were cold."""

    def __init__(self, twin: Twin) -> None:
        """Raises DataError for a robot without springs."""
        body = twin.robot.chain(twin.body())
        self._twin, self._figure = twin, ChainFigure(body, Equilibrium(body))
        self._robot: HeatedRobot | None = None
        self._loads: Loads | None = None
        self._current = np.zeros(twin.robot.n_tendon)
        self.time, self._owed, self._rate = 0.0, 0.0, np.inf

    def shape(self, current: np.ndarray, loads: Loads, passed: float) -> Frames:
        """One instant, `passed` (s) after the last, under currents (n_tendon,) A. Raises SolveError where there is none."""
        if self._robot is None:
            self._robot, self._loads = HeatedRobot(self._twin, loads), loads
        elif self._loads is None or not _same(loads, self._loads):
            self._robot.bear(loads)
            self._loads, self._rate = loads, np.inf
        if not np.array_equal(current, self._current):
            self._current, self._rate = current, np.inf
        robot, self._owed = self._robot, self._owed + passed
        while self._owed > STEP - ROUNDING:
            before = robot.warm.copy()
            robot.step(current, STEP)
            self._rate = float(np.abs(robot.warm - before).max()) / STEP
            self._owed, self.time = self._owed - STEP, self.time + STEP
        return self._figure.standing(robot.path(), self._twin.laws.route, robot.heating.spring)

    def rest(self, current: np.ndarray, loads: Loads) -> Frames:
        """As the springs rest at last under currents that stay."""
        shown, began = self.shape(current, loads, STEP), self.time
        while self.changing and self.time - began < LONGEST:
            shown = self.shape(current, loads, 1.0)
        return shown

    @property
    def changing(self) -> bool:
        """Whether some spring warms or cools, as far as is known."""
        return self._rate > RESTING

    @property
    def temperature(self) -> np.ndarray:
        """(n_tendon,) K of the springs."""
        assert self._robot is not None
        return self._robot.warm


def _same(a: Loads, b: Loads) -> bool:
    alike = a.payload == b.payload and np.array_equal(a.gravity, b.gravity) and np.array_equal(a.force, b.force)
    if a.push is None or b.push is None:
        return alike and a.push is b.push
    one, other = (np.array([*p.force, p.height, p.azimuth, p.finger]) for p in (a.push, b.push))
    return alike and np.array_equal(one, other)


def _turned(turns: list[np.ndarray], pull: np.ndarray) -> bool:
    """Whether some tendon goes another way than on its last; the first pull always counts as a turn."""
    if len(turns) < 2:
        return True
    last, now = turns[-1] - turns[-2], pull - turns[-1]
    return bool(np.any(last * now < 0.0) or np.any((last == 0.0) & (now != 0.0)))
