"""Actuator gain: a drive delivers a fraction of what is commanded."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from twin.body import Body, Signals
from twin.effects.base.effect import Effect, FitStart, each_then_all
from twin.foundation.parameters import Parameter


class ActuatorGain(Effect):
    """The force (or torque) of each actuator is F' = gain F, which of a servo scales kp, kv, offset and limit alike (a controller
    limits the current); d' = gain d of a displacement, as of a spool of another radius.

    It does nothing to a tendon whose tension is given.

    Source: motor constants, 5-10 %; a supply that sags; a gear or a spool whose size is not the described one.

    >>> ActuatorGain(gain_1=0.9).per_tendon_values("gain").tolist()
    [0.9]
    """

    id = "actuator_gain"
    per_tendon = (Parameter("gain", 1.0, "1", 0.2, 3.0, "of motor constants, 5-10 %; of supplies, some tens", scale=0.02),)
    needs = frozenset({"drive zeros"})
    moves_with = "the force, or the travel, of the drive"
    plot_against = "torque"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with each drive alone, then with all of them; with none where tensions or currents drive.

        Lengths start shorter, as the body always allows.
        """
        if not predicted:
            return
        (gain,) = cls.per_tendon
        driven = predicted[0].driven_by_control | predicted[0].driven_by_length
        way = -1.0 if predicted[0].driven_by_length.any() else 1.0
        yield from each_then_all([{f"gain_{i + 1}": gain.value + way * gain.step} for i in np.flatnonzero(driven)])

    def edit(self, body: Body) -> None:
        gain = self.per_tendon_values("gain")
        if (gain != 1.0).any() and "servos" in body.features:
            body.scale_actuators(gain)

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Return that all is said: strengths are numbers of the model, which `edit` has changed."""
        return True

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return lambda command: command

    def command(self, reported: Signals) -> Signals:
        gain = self.per_tendon_values("gain")
        if not (gain != 1.0).any():
            return reported
        return reported.with_changes(
            displacement=np.where(reported.driven_by_length, gain * reported.displacement, reported.displacement)
        )

    def sense(self, true: Signals) -> Signals:
        gain = self.per_tendon_values("gain")
        if not (gain != 1.0).any():
            return true
        return true.with_changes(displacement=np.where(true.driven_by_length, true.displacement / gain, true.displacement))
