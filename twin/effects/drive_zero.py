"""Drive zero: a motor's zero is off, so that its commands count from elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

import mujoco
import numpy as np

from twin.body import Signals
from twin.effects.base.effect import Effect, FitStart, each_then_all
from twin.foundation.parameters import Parameter

AFFINE = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)


class DriveZero(Effect):
    """The drive is given c' = c + zero of an actuator's control (in its unit: rad of a servo), d' = d + length + length_i of a
    displacement.

    It does nothing to a tendon whose tension is given.

    Source: an encoder or a horn that was mounted a tooth off: degrees; a tendon that was tied by hand: millimetres.

    >>> from twin.body import Drive
    >>> t = np.arange(2.0)
    >>> s = Signals(t, t, np.zeros((2, 1)), np.array([[0.0], [1e-3]]), np.zeros((2, 0, 3)), t, (Drive.DISPLACEMENT,))
    >>> (1e3 * DriveZero(length_1=5e-4).command(s).displacement[:, 0]).round(3).tolist()
    [0.5, 1.5]
    """

    id = "drive_zero"
    parameters = (Parameter("length", 0.0, "m", -0.05, 0.05, "of all tendons alike, beside each one's own", scale=2e-4),)
    per_tendon = (
        Parameter("zero", 0.0, "1", -0.5, 0.5, "in the unit of the control; a tooth of a servo's horn is 0.25 rad", scale=1e-3),
        Parameter("length", 0.0, "m", -0.05, 0.05, "a tendon tied by hand: millimetres", scale=2e-4),
    )
    needs = frozenset({"drive zeros"})
    moves_with = "nothing: it is the same in every pose"
    plot_against = "position"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with one zero for all, with each alone and with all; with none where tensions drive.

        Tendons start paid out, which the body always allows.
        """
        if not predicted:
            return
        if predicted[0].driven_by_length.any():
            yield FitStart({"length": -cls.parameters[0].step}, ("length",))
        for kind, driven in zip(cls.per_tendon, (predicted[0].driven_by_control, predicted[0].driven_by_length), strict=True):
            yield from each_then_all([{f"{kind.name}_{i + 1}": kind.value - kind.step} for i in np.flatnonzero(driven)])

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return "alike" if "length" in free else "one" if len(free) == 1 else "each"

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Write gain (c + zero) + bias, of controls limited to [low - zero, high - zero], where all forces are gain c + bias."""
        if any(a.gaintype != mujoco.mjtGain.mjGAIN_FIXED or a.biastype not in AFFINE for a in spec.actuators):
            return False
        for actuator, zero in zip(spec.actuators, self.per_tendon_values("zero"), strict=True):
            bias = np.array(actuator.biasprm)
            bias[0] += actuator.gainprm[0] * zero
            actuator.biasprm, actuator.biastype = bias, mujoco.mjtBias.mjBIAS_AFFINE
            actuator.ctrlrange = np.array(actuator.ctrlrange) - zero
        return True

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda command: command + self.per_tendon_values("zero")

    def command(self, reported: Signals) -> Signals:
        zero, length = self.per_tendon_values("zero"), self._lengths()
        if np.any(zero):
            reported = reported.with_changes(control=reported.control + zero)
        if np.any(length):
            moved = np.where(reported.driven_by_length, reported.displacement + length, reported.displacement)
            reported = reported.with_changes(displacement=moved)
        return reported

    def sense(self, true: Signals) -> Signals:
        length = self._lengths()
        if not np.any(length):
            return true
        return true.with_changes(displacement=np.where(true.driven_by_length, true.displacement - length, true.displacement))

    def _lengths(self) -> np.ndarray:
        """Return the zeros (n_tendon,) m of displacements."""
        return self["length"] + self.per_tendon_values("length")
