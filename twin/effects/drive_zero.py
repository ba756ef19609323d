"""Drive zero: a motor's zero is off, so that its commands count from elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from twin.body import Signals
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter

AFFINE = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)


class DriveZero(Effect):
    """The drive is given c' = c + zero, zero in the unit of its control: m of a winch, rad of a servo.

    Source: an encoder or a horn that was mounted a tooth off: degrees; a tendon that was tied by hand: millimetres.

    >>> t = np.arange(2.0)
    >>> s = Signals(t, t, np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 0, 3)), t, control=np.array([[0.1], [0.2]]))
    >>> DriveZero(zero_1=0.05).command(s).control[:, 0].round(3).tolist()
    [0.15, 0.25]
    """

    id = "drive_zero"
    per_tendon = (
        Parameter("zero", 0.0, "1", -0.5, 0.5, "in the unit of the control; a tooth of a servo's horn is 0.25 rad", scale=1e-3),
    )  # fmt: skip
    needs = frozenset({"controls"})
    moves_with = "nothing: it is the same in every pose"
    plot_against = "position"

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
        zero = self.per_tendon_values("zero")
        return reported.with_changes(control=reported.control + zero) if np.any(zero) else reported
