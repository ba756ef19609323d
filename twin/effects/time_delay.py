"""Time delay: inputs and outputs are logged with a shift in time."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from twin.body import Signals, interpolate_commands
from twin.body.drives.lag import late_by
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter

STRAIGHT = 1  # interpolation of an MJCF's delayed commands


class DelayedSteps:
    """Commands (nu,) that come every `step` s, late by `delay` s and straight between steps; before the first they were `first`."""

    def __init__(self, step: float, delay: float, first: np.ndarray) -> None:
        self._steps = delay / step
        self._late = deque([np.array(first, float)] * math.ceil(self._steps - 1e-9))

    def __call__(self, command: np.ndarray) -> np.ndarray:
        if not self._late:
            return command
        self._late.append(np.array(command, float))
        oldest = self._late.popleft()
        return oldest + (len(self._late) - self._steps) * (self._late[0] - oldest)


class TimeDelay(Effect):
    """Outputs logged late: y_logged(t) = y(t - delay), driven by T(t - delay), interpolated between rows as `Signals.smooth` says.

    The input is shifted, not the predicted output: a shape predicted between two samples is one the robot can take, a straight line
    between two shapes is not. Before the log starts the input is its first value.

    Source: two loggers without a common clock; a camera's exposure and transfer (20-200 ms).

    >>> t = np.arange(4.0)
    >>> s = Signals(t, t, t[:, None], np.zeros((4, 1)), np.zeros((4, 0, 3)), t)
    >>> TimeDelay(delay=0.5).command(s).tension[:, 0].tolist()
    [0.0, 0.5, 1.5, 2.5]
    """

    id = "time_delay"
    parameters = (Parameter("delay", 0.0, "s", -3.0, 3.0, "positive: outputs come late", scale=0.05),)
    confusable_with = ("actuator_lag",)
    moves_with = "the rate of change of the pull"
    plot_against = "rate"
    hidden_without = frozenset({DataNeed.TWO_RATES})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        yield FitStart({"delay": late_by(predicted)}, ("delay",))

    def command(self, reported: Signals) -> Signals:
        t = reported.time
        if self["delay"] == 0.0 or len(t) < 2:
            return reported
        earlier = np.clip(t - self["delay"], t[0], t[-1])
        return reported.with_commands(lambda c: interpolate_commands(reported, c)(earlier), current=self._heating(reported))

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Write a delay of all actuators, straight between steps. Nothing of a log that runs ahead, which no model does."""
        if self["delay"] <= 0.0:
            return True
        for actuator in spec.actuators:
            actuator.delay += self["delay"]
            actuator.nsample = max(int(actuator.nsample), math.ceil(actuator.delay / spec.option.timestep) + 2)
            actuator.interp = STRAIGHT
        return False

    def erase(self, spec: mujoco.MjSpec) -> None:
        for actuator in spec.actuators:
            actuator.delay -= self["delay"]
            actuator.nsample = actuator.nsample if actuator.delay > 0.0 else 0

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray] | None:
        return DelayedSteps(step, self["delay"], first) if self["delay"] >= 0.0 else None

    def _heating(self, reported: Signals) -> np.ndarray:
        """Return the shifted currents, constant over each row, that heat as much; zero before the log."""
        t = reported.time
        edges = np.append(t, 2 * t[-1] - t[-2])
        heat = np.cumsum(np.diff(edges)[:, None] * reported.current**2, axis=0)
        shifted = [np.interp(edges - self["delay"], edges, column) for column in np.vstack([0 * heat[:1], heat]).T]
        return np.sqrt(np.maximum(np.diff(np.stack(shifted, axis=1), axis=0), 0.0) / np.diff(edges)[:, None])
