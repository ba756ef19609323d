"""What a drive delivers for commands that come step by step: late by a delay, then by a lag."""

from __future__ import annotations

from collections import deque

import numpy as np

from twin.effects.actuator_lag import lag_over


class Delivery:
    """Delay and lag of all drives, exact for commands that run straight from step to step.

    The delay is that of `time_delay`, the lag that of `actuator_lag`: lag^2 inertia x'' + lag x' + x = c(t - delay). Before the
    first step the command was that of `begin`.
    """

    def __init__(self, step: float, delay: float, lag: float, inertia: float) -> None:
        self._step, self._delay, self._lag, self._inertia = step, delay, lag, inertia
        self._late: deque[np.ndarray] = deque()
        self._x = self._v = self._before = np.empty(0)

    def begin(self, command: np.ndarray) -> None:
        """Begin at rest under a command (nu,)."""
        command = np.array(command, float)
        self._late = deque([command] * int(np.ceil(self._delay / self._step - 1e-9)))
        self._x, self._v, self._before = command.copy(), np.zeros_like(command), np.full_like(command, np.nan)

    def __call__(self, command: np.ndarray) -> np.ndarray:
        """Return what is delivered (nu,) at the present step for a command (nu,)."""
        late = self._delayed(np.array(command, float))
        if self._lag <= 0.0:
            return late
        if np.isnan(self._before).any():  # the first step
            self._x[:] = late
        else:
            slope = (late - self._before) / self._step
            for k, rise in enumerate(slope):
                cubic = np.array([0.0, 0.0, rise, self._before[k]])
                self._x[k], self._v[k] = lag_over(self._x[k], self._v[k], cubic, self._step, self._lag, self._inertia)
        self._before = late
        return self._x.copy()

    def _delayed(self, command: np.ndarray) -> np.ndarray:
        """Return the command a delay ago, straight between the two steps about it."""
        if not self._late:
            return command
        self._late.append(command)
        oldest = self._late.popleft()
        share = len(self._late) - self._delay / self._step
        return oldest + share * (self._late[0] - oldest)
