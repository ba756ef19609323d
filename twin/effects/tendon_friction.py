"""Tendon friction: a tendon loses tension at every hole it turns at, in the direction it slides."""

from __future__ import annotations

import math
from collections.abc import Iterator

from twin.compiled import jit
from twin.effects.effect import Effect, Route, Signals, Start
from twin.quantities import Parameter

ROUNDING = 1e-3  # rad: |turn angle| is rounded below this, so that a straight tendon has a derivative


@jit
def slip_state(z0, travel, presliding):
    """Slip state after `travel` (m, towards the base) from z0: z = clip(z0 + travel / presliding, -1, 1)."""
    return min(1.0, max(-1.0, z0 + travel / presliding))


@jit
def turn(theta):
    """The rounded turn angle sqrt(theta^2 + e^2) - e (rad) and its derivative."""
    root = math.sqrt(theta * theta + ROUNDING * ROUNDING)
    return root - ROUNDING, theta / root


class TendonFriction(Effect):
    """Capstan loss per hole with pre-sliding: T_d = T_0 exp(-mu sum_{j<=d} z_j theta_j).

    theta_j (rad) is the angle the tendon turns at inner disk j, z_j in [-1, 1] the slip state there: +1 while the tendon slides
    towards the base (pulling: tension falls along it), -1 while it slides out (releasing: tension rises), in between sticking.
    z follows the tendon's travel past the hole, z = clip(z + travel / presliding, -1, 1), so loading and unloading differ and
    hold. It is a rate-independent law: it has no velocity in it, and holds still when the robot does.

    Source: Euler-Eytelwein capstan; elasto-plastic pre-sliding after Dahl (1968) in its linear limit. mu of lubricated or PTFE
    on metal is 0.04-0.2, dry metal up to 0.6 (CRC materials handbook). The pre-sliding length is ours to choose: fractions of a
    millimetre, the tendon's stretch between two holes.

    >>> law = TendonFriction(mu=0.2)
    >>> round(slip_state(0.0, 0.2e-3, 0.4e-3), 3), slip_state(1.0, -1.0, 0.4e-3)
    (0.5, -1.0)
    """

    id = "tendon_friction"
    parameters = (
        Parameter("mu", 0.0, "1", 0.0, 1.0, "capstan coefficient; CRC handbook: 0.04 (PTFE) to 0.6 (dry metal)", scale=0.05),
        Parameter("presliding", 4e-4, "m", 2e-5, 3e-3, "tendon travel from sticking to sliding; our choice", scale=1e-4),
    )
    shape = ("presliding",)
    akin = ("joint_friction",)
    guesses = ({"mu": 0.1},)
    moves_with = "the direction of pull (hysteresis loop)"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Of antagonists, which always pull and turn several times, a tenth of what shows on a backbone shows as much."""
        if any(s.antagonists for s in predicted):
            yield Start({"mu": 0.01}, ("mu", "presliding"))
        else:
            yield from super().starts(predicted, n_tendon)

    def route(self) -> Route:
        return Route(self["mu"], self["presliding"])
