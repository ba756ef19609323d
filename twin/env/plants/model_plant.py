"""An MJCF stepped in time under controls that are chosen interval by interval."""

from collections.abc import Mapping

import numpy as np

from twin.body import Loads, Start
from twin.prediction.mjcf import TwinStepper
from twin.prediction.twin import Twin


class ModelPlant:
    """A twin of an MJCF. In an interval the control goes straight from the last one to the new one, as between rows of a log.

    Its state is the controls since it began: steps are the same each time, and laws of effects remember what they like.
    """

    def __init__(self, twin: Twin, interval: float, first: np.ndarray, loads: Loads, start: Start) -> None:
        """Begin settled under the `first` control (nu,). Raises SolveError where the motion diverges."""
        self._stepper, self._start = TwinStepper(twin, interval, loads), start
        self._begin(np.asarray(first, float))

    def step(self, control: np.ndarray) -> None:
        """Move on by an interval. Raises SolveError where the motion diverges."""
        before, n = self._controls[-1], self._stepper.steps
        self._controls.append(np.array(control, float))
        for k in range(n):
            self._stepper.step(before + (control - before) * k / n)

    def positions(self) -> dict[str, float]:
        """Return the positions (SI) of joints, tendons, drives and sites by channel, as encoders report them."""
        return self._stepper.readings()

    @property
    def q(self) -> np.ndarray:
        """The coordinates (nq,)."""
        return self._stepper.data.qpos

    @property
    def rates(self) -> np.ndarray:
        """The rates (nv,) rad/s and m/s."""
        return self._stepper.data.qvel

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the controls (k, nu) since it began."""
        return {"controls": np.array(self._controls)}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Go through the controls of a state once more."""
        first, *later = state["controls"]
        self._begin(first)
        for control in later:
            self.step(control)

    def _begin(self, first: np.ndarray) -> None:
        self._controls = [first]
        self._stepper.reset(first, self._start.settle, self._start.pose)
