"""Actuator lag: the drive follows its command late."""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter


@jit
def follow(time, command, lag, inertia, delivered):
    """inertia lag^2 x'' + lag x' + x = c for commands (n, m) linear between `time` (n,), exact, from rest at the first; x to
    `delivered` (n, m).

    Behind the ramp that a drive settles to, c - lag c', it is e: of exp(-t / lag) in first order, in second order of
    exp(-s t) (e C + (e' + s e) S) with s = 1 / (2 inertia lag), w^2 = s^2 - 1 / (inertia lag^2), C = cosh(w t), S = sinh(w t) / w.
    """
    for j in range(command.shape[1]):
        x, v = command[0, j], 0.0
        delivered[0, j] = x
        for i in range(1, time.size):
            t = time[i] - time[i - 1]
            slope = (command[i, j] - command[i - 1, j]) / t
            e = x - command[i - 1, j] + lag * slope
            if inertia == 0.0:
                e *= np.exp(-t / lag)
            else:
                stiff = 1.0 / (inertia * lag * lag)
                s = 0.5 * stiff * lag
                w = np.sqrt(abs(s * s - stiff))
                if w * t < 1e-6:  # critically damped: the error is the square of it
                    C, S = np.exp(-s * t), t * np.exp(-s * t)
                elif s * s > stiff:
                    fast, slow = np.exp(-(s + w) * t), np.exp(-stiff / (s + w) * t)
                    C, S = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
                else:
                    C, S = np.exp(-s * t) * np.cos(w * t), np.exp(-s * t) * np.sin(w * t) / w
                u = v - slope
                e, v = e * C + (u + s * e) * S, slope + u * C - (stiff * e + s * u) * S
            x = command[i, j] - lag * slope + e
            delivered[i, j] = x


class ActuatorLag(Effect):
    """Lag between command and delivery, of first order: time x' = c - x; of second, inertia time^2 x'' + time x' + x = c.

    Damping ratio 1 / (2 sqrt(inertia)): up to 0.25 two first-order lags in series, beyond it the drive overshoots. Behind a steady
    ramp it is late by `time` whatever its inertia.

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
        Parameter("inertia", 0.0, "", 0.0, 10.0, "1 / (4 damping ratio^2); 0: first order", scale=0.2),
    )
    richer = ("inertia",)
    akin = ("time_delay",)
    guesses = ({"time": 0.1},)
    moves_with = "the rate of change of the pull"

    def drive(self, command: Signals) -> Signals:
        tension, displacement = command.tension, command.displacement
        if self["time"] > 0.0 and len(command.time) > 1:
            tension, displacement = self._lagged(command.time, tension), self._lagged(command.time, displacement)
        return command.with_(tension=tension, displacement=displacement)

    def _lagged(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        out = np.empty_like(command)
        follow(np.asarray(time, float), np.ascontiguousarray(command, float), self["time"], self["inertia"], out)
        return out
