"""Actuator lag: the drive follows its command late."""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


@jit
def follow(time, command, tau, delivered):
    """tau x' = c - x for commands (n, m) linear between `time` (n,), exact, from rest at the first; x to `delivered` (n, m)."""
    for j in range(command.shape[1]):
        delivered[0, j] = command[0, j]
        for i in range(1, time.size):
            dt = time[i] - time[i - 1]
            slope = (command[i, j] - command[i - 1, j]) / dt
            behind = delivered[i - 1, j] - command[i - 1, j] + tau * slope  # of the ramp the drive would settle to
            delivered[i, j] = command[i, j] - tau * slope + behind * np.exp(-dt / tau)


class ActuatorLag(Effect):
    """First-order lag between command and delivery: time x' = c - x; with `time_2` two in series, an overdamped second order.

    Acts on whatever drives the tendons, tension or displacement. Between two rows the command is a straight line.

    Source: linear system theory; a valve, a motor's current loop, a gearbox: 10 ms to 1 s.

    >>> t = np.array([0.0, 1.0, 2.0])
    >>> s = Signals(t, t, np.array([[0.0], [1.0], [1.0]]), np.zeros((3, 1)), np.zeros((3, 0, 3)), t)
    >>> ActuatorLag(time=1.0).drive(s).tension[:, 0].round(4).tolist()   # a ramp, then exp(-1)/e of the way to go
    [0.0, 0.3679, 0.7675]
    """

    id = "actuator_lag"
    parameters = (
        Parameter("time", 0.0, "s", 0.0, 5.0, "time constant; what a bench log's rows can show", scale=0.05),
        Parameter("time_2", 0.0, "s", 0.0, 5.0, "of a second lag in series", scale=0.05),
    )
    richer = ("time_2",)
    akin = ("time_delay",)
    guesses = ({"time": 0.1},)
    moves_with = "the rate of change of the pull"

    def drive(self, command: Signals) -> Signals:
        tension, displacement = command.tension, command.displacement
        for tau in (self["time"], self["time_2"]):
            if tau > 0.0 and len(command.time) > 1:
                tension, displacement = _lagged(command.time, tension, tau), _lagged(command.time, displacement, tau)
        return command.with_(tension=tension, displacement=displacement)


def _lagged(time: np.ndarray, command: np.ndarray, tau: float) -> np.ndarray:
    out = np.empty_like(command)
    follow(np.asarray(time, float), np.ascontiguousarray(command, float), tau, out)
    return out
