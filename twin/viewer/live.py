"""The shape of a robot under sliders: static, with friction's history, or heated by currents over time."""

import numpy as np

from twin.body import Drive, Loads
from twin.body.drawable import Frames
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.drawing import ChainFigure
from twin.prediction.kinematics import HeatedRobot
from twin.prediction.prepared import ROOM_TEMPERATURE, Inputs
from twin.prediction.simulate import simulate_alone
from twin.prediction.twin import Twin

MOST_TURNING_POINTS = 24  # of the pulls, kept as the history of friction
REST_ROWS = 1  # s, a row each, in which an MJCF comes to rest
HEATING_STEP = 0.1  # s between equilibria while springs heat, which takes them tens of seconds
TIME_ROUNDING = 1e-9  # s
REST_RATE = 0.01  # K/s; slower springs are at rest
LONGEST_HEATING = 900.0  # s; springs are at rest by then


class LiveRobot:
    """A robot in static equilibrium whose friction depends on where its tendons reversed, while the loads stay the same.

    Pulling on in one direction erases the pulls between, so the turning points are the whole history of friction. Creep counts one
    second for each turning point.
    """

    def __init__(self, twin: Twin, drive: Drive = Drive.TENSION) -> None:
        self._twin, self._drive, self._figure = twin, drive, twin.figure()
        self._rest = rest_command(twin, drive)
        self._loads: Loads | None = None
        self._turns: list[np.ndarray] = []

    def shape(self, pull: np.ndarray, loads: Loads) -> Frames:
        """Return the shape under pulls (n_tendon,), N as load cells read them or m as drives report.

        Raises SolveError where there is no equilibrium.
        """
        if self._loads is None or not _same_loads(loads, self._loads):
            self._turns, self._loads = [self._rest], loads
        turns = [*(self._turns if _reverses(self._turns, pull) else self._turns[:-1]), pull][-MOST_TURNING_POINTS:]
        stepped = self._drive is Drive.CONTROL  # a motion that comes to rest under the last command
        command = np.stack([*turns, *([pull] * REST_ROWS if stepped else [])])
        time = np.arange(float(len(command)))
        inputs = Inputs(
            "here", time, time, command, (self._drive,) * len(pull), np.full(len(command), ROOM_TEMPERATURE), loads,
            smooth=not stepped,
        )  # fmt: skip
        trace = simulate_alone(self._twin, inputs)
        assert trace.solution is not None  # statics without one raise
        self._turns = turns
        return self._figure.frames(trace.solution, self._twin.effect_chain.surround(loads), self._twin.effect_chain.route).frame_at(
            -1
        )


def rest_command(twin: Twin, drive: Drive) -> np.ndarray:
    """Return the command (n_tendon,) SI where nothing is asked for: no pull, or where controls of an MJCF rest."""
    ports = [next(p for p in port if p.drive is drive) for port in twin.robot.build().ports]
    return np.array([p.span[1] for p in ports]) if drive is Drive.CONTROL else np.zeros(twin.robot.n_tendon)


class LiveHeatedRobot:
    """A backbone whose springs are heated by currents. `time` is s since the springs were cold."""

    def __init__(self, twin: Twin) -> None:
        """Raise DataError for a robot without springs."""
        body = twin.robot.chain(twin.body())
        self._twin, self._figure = twin, ChainFigure(body, Equilibrium(body))
        self._robot: HeatedRobot | None = None
        self._loads: Loads | None = None
        self._current = np.zeros(twin.robot.n_tendon)
        self.time, self._pending_time, self._rate = 0.0, 0.0, np.inf

    def shape(self, current: np.ndarray, loads: Loads, passed: float) -> Frames:
        """Return the shape `passed` (s) after the last, under currents (n_tendon,) A. Raises SolveError where there is none."""
        if self._robot is None:
            self._robot, self._loads = HeatedRobot(self._twin, loads), loads
        elif self._loads is None or not _same_loads(loads, self._loads):
            self._robot.set_loads(loads)
            self._loads, self._rate = loads, np.inf
        if not np.array_equal(current, self._current):
            self._current, self._rate = current, np.inf
        robot, self._pending_time = self._robot, self._pending_time + passed
        while self._pending_time > HEATING_STEP - TIME_ROUNDING:
            before = robot.spring_temperature.copy()
            robot.step(current, HEATING_STEP)
            self._rate = float(np.abs(robot.spring_temperature - before).max()) / HEATING_STEP
            self._pending_time, self.time = self._pending_time - HEATING_STEP, self.time + HEATING_STEP
        return self._figure.standing(robot.solution(), self._twin.effect_chain.route, robot.heating.spring)

    def rest(self, current: np.ndarray, loads: Loads) -> Frames:
        """Return the shape once the springs are at rest under constant currents."""
        shown, began = self.shape(current, loads, HEATING_STEP), self.time
        while self.changing and self.time - began < LONGEST_HEATING:
            shown = self.shape(current, loads, 1.0)
        return shown

    @property
    def changing(self) -> bool:
        """Return whether some spring warms or cools, by the last step."""
        return self._rate > REST_RATE

    @property
    def temperature(self) -> np.ndarray:
        """Return the temperatures of the springs, (n_tendon,) K."""
        assert self._robot is not None
        return self._robot.spring_temperature


def _same_loads(a: Loads, b: Loads) -> bool:
    alike = a.payload == b.payload and np.array_equal(a.gravity, b.gravity) and np.array_equal(a.force, b.force)
    if a.push is None or b.push is None:
        return alike and a.push is b.push
    one, other = (np.array([*p.force, p.height, p.azimuth, p.finger]) for p in (a.push, b.push))
    return alike and np.array_equal(one, other)


def _reverses(turns: list[np.ndarray], pull: np.ndarray) -> bool:
    """Return whether some tendon reverses or starts to move; the first pull always counts."""
    if len(turns) < 2:
        return True
    last, now = turns[-1] - turns[-2], pull - turns[-1]
    return bool(np.any(last * now < 0.0) or np.any((last == 0.0) & (now != 0.0)))
