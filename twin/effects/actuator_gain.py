"""Actuator gain: a drive delivers a fraction of what is commanded."""

from __future__ import annotations

from twin.body import Body
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class ActuatorGain(Effect):
    """The force (or torque) of each actuator is F' = gain F; of a servo that scales kp, kv and offset alike.

    Source: motor constants, 5-10 %; a supply that sags; a gear whose ratio is not the described one.

    >>> ActuatorGain(gain_1=0.9).per_tendon_values("gain").tolist()
    [0.9]
    """

    id = "actuator_gain"
    per_tendon = (Parameter("gain", 1.0, "1", 0.2, 3.0, "of motor constants, 5-10 %; of supplies, some tens", scale=0.02),)
    needs = frozenset({"servos"})
    moves_with = "the force of the drive"
    plot_against = "torque"

    def edit(self, body: Body) -> None:
        gain = self.per_tendon_values("gain")
        if (gain != 1.0).any():
            body.scale_actuators(gain)
