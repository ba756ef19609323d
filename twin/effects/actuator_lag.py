"""Actuator lag: the drive follows its command gradually."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from twin.body import Signals, interpolate_commands
from twin.body.drives.lag import lag_over, lag_response, late_by
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.compiled import jit
from twin.foundation.parameters import Parameter


@jit
def lag_held_current(time, command, lag, delivered):
    """Solve lag x' + x = c exactly, from zero at the first of `time` (n,), for commands (n, m) constant from row to row.

    `delivered` (n, m) gets the root mean square of x until the next row, which heats a spring as much as x. With d = x - c at a row
    and a = dt / lag the mean square is c^2 + 2 c d (1 - exp(-a)) / a + d^2 (1 - exp(-2 a)) / (2 a).
    """
    for j in range(command.shape[1]):
        x = 0.0
        for i in range(time.size - 1):
            a, c = (time[i + 1] - time[i]) / lag, command[i, j]
            d = x - c
            square = c * c - 2.0 * c * d * np.expm1(-a) / a - 0.5 * d * d * np.expm1(-2.0 * a) / a
            delivered[i, j] = np.sqrt(max(0.0, square))
            x = c + d * np.exp(-a)
        delivered[-1, j] = x


class LaggingSteps:
    """Commands (nu,) that come every `step` s and run straight between, behind a lag (`lag_response`), from rest under `first`."""

    def __init__(self, step: float, lag: float, inertia: float, first: np.ndarray) -> None:
        self._step, self._lag, self._inertia = step, lag, inertia
        self._before: np.ndarray | None = None
        self._x, self._v = np.array(first, float), np.zeros(len(first))

    def __call__(self, command: np.ndarray) -> np.ndarray:
        if self._before is None:
            self._x[:] = command
        else:
            for k, slope in enumerate((command - self._before) / self._step):
                cubic = np.array([0.0, 0.0, slope, self._before[k]])
                self._x[k], self._v[k] = lag_over(self._x[k], self._v[k], cubic, self._step, self._lag, self._inertia)
        self._before = np.array(command, float)
        return self._x.copy()


class ActuatorLag(Effect):
    """Lag between command and delivery, of first order: time x' = c - x; of second, inertia time^2 x'' + time x' + x = c.

    The damping ratio is 1 / (2 sqrt(inertia)). Up to an inertia of 0.25 it is two first-order lags in series, above it the drive
    overshoots. Behind a steady ramp the drive is late by `time`, whatever its inertia.

    It acts on the drives' commands. Between rows a tension or displacement follows `Signals.smooth`. A current is constant until
    the next row, zero before the trial, follows in first order whatever the inertia, and counts by its mean square.

    Source: linear system theory. A valve, a motor's current loop, a gearbox: 10 ms to 1 s; a supply that ramps its current, a
    spring that is heated through its mount: seconds.

    >>> t = np.array([0.0, 1.0, 2.0])
    >>> s = Signals(t, t, np.array([[0.0], [1.0], [1.0]]), np.zeros((3, 1)), np.zeros((3, 0, 3)), t)
    >>> ActuatorLag(time=1.0).drive(s).tension[:, 0].round(4).tolist()   # a ramp, then exp(-1)/e of the way to go
    [0.0, 0.3679, 0.7675]
    """

    id = "actuator_lag"
    parameters = (
        Parameter("time", 0.0, "s", 0.0, 20.0, "time constant; what a bench log's rows can show", scale=0.05),
        Parameter("inertia", 0.0, "1", 0.0, 10.0, "1 / (4 damping ratio^2); 0: first order", scale=0.2),
    )
    extended_parameters = ("inertia",)
    confusable_with = ("time_delay",)
    moves_with = "the rate of change of the pull"
    plot_against = "rate"
    hidden_without = frozenset({DataNeed.TWO_RATES})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start at seconds, the time in which a spring warms, if currents drive; else as `late_by` has it."""
        for time in (0.5, 4.0) if any(s.driven_by_current.any() for s in predicted) else (late_by(predicted),):
            yield FitStart({"time": time}, ("time",))

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        if not any(s.driven_by_current.all() for s in predicted):
            yield from super().extended_starts(predicted)

    def drive(self, command: Signals) -> Signals:
        if self["time"] > 0.0 and len(command.time) > 1:
            current = np.zeros_like(command.current)
            if command.driven_by_current.any():
                lag_held_current(np.asarray(command.time, float), np.ascontiguousarray(command.current), self["time"], current)
            return command.with_commands(lambda c: self._lagged(command, c), current=current)
        return command

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Write the first order as a filter of actuators without dynamics, of commands that MuJoCo holds from step to step."""
        for actuator in spec.actuators:
            if actuator.dyntype == mujoco.mjtDyn.mjDYN_NONE and self["time"] > 0.0:
                constants = np.zeros(len(actuator.dynprm))
                constants[0] = self["time"]
                actuator.dyntype, actuator.dynprm = mujoco.mjtDyn.mjDYN_FILTEREXACT, constants
        return False

    def erase(self, spec: mujoco.MjSpec) -> None:
        for actuator in spec.actuators:
            if actuator.dyntype == mujoco.mjtDyn.mjDYN_FILTEREXACT and actuator.dynprm[0] == self["time"]:
                actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return LaggingSteps(step, self["time"], self["inertia"], first) if self["time"] > 0.0 else lambda command: command

    def _lagged(self, signals: Signals, command: np.ndarray) -> np.ndarray:
        out = np.empty_like(command)
        lag_response(np.asarray(signals.time, float), interpolate_commands(signals, command).c, self["time"], self["inertia"], out)
        return out
