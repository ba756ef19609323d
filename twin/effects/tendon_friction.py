"""Tendon friction: a tendon loses tension where it turns at holes, in the direction of sliding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from twin.body import Route, Signals
from twin.body.drives.counts import of_a_model, tendon_names
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.compiled import jit
from twin.foundation.parameters import Parameter

ANGLE_ROUNDING = 1e-3  # rad: |turn angle| is rounded below this, so that it has a derivative at zero


@jit
def slip_state(z0, travel, presliding):
    """Return the slip state after `travel` (m, towards the base) from z0: z = clip(z0 + travel / presliding, -1, 1)."""
    return min(1.0, max(-1.0, z0 + travel / presliding))


@jit
def rounded_turn_angle(theta):
    """Return the rounded turn angle sqrt(theta^2 + e^2) - e (rad) and its derivative."""
    root = math.sqrt(theta * theta + ANGLE_ROUNDING * ANGLE_ROUNDING)
    return root - ANGLE_ROUNDING, theta / root


class TendonFriction(Effect):
    """Capstan loss per hole with pre-sliding: T_d = T_0 exp(-mu sum_{j<=d} z_j theta_j); of a rod that pushes, T_0 < 0, with +mu.

    theta_j (rad) is the turn angle of the tendon at inner disk j, z_j in [-1, 1] the slip state there: +1 while the tendon slides
    towards the base (pulling: tension falls along it), -1 while it slides out (releasing: tension rises), in between sticking.
    A tendon of an MJCF turns at every site and wrapping geom, has its own mu, and z follows Dahl's law as it stands,
    z' = s + (z - s) exp(-|travel| / presliding), s the direction of travel.

    z follows the tendon's travel past the hole, z = clip(z + travel / presliding, -1, 1), so loading and unloading differ. The law
    is independent of the rate: tensions are constant while the robot is at rest.

    Source: Euler-Eytelwein capstan; elasto-plastic pre-sliding after Dahl (1968) in its linear limit. mu of lubricated or PTFE
    on metal is 0.04-0.2, dry metal up to 0.6 (CRC materials handbook). The pre-sliding length is our choice: fractions of a
    millimetre, the tendon's stretch between two holes.

    >>> TendonFriction(mu=0.2).route().mu
    0.2
    >>> round(slip_state(0.0, 0.2e-3, 0.4e-3), 3), slip_state(1.0, -1.0, 0.4e-3)
    (0.5, -1.0)
    """

    id = "tendon_friction"
    parameters = (
        Parameter("mu", 0.0, "1", 0.0, 1.0, "capstan coefficient; CRC handbook: 0.04 (PTFE) to 0.6 (dry metal)", scale=0.05),
        Parameter("presliding", 4e-4, "m", 2e-5, 3e-3, "tendon travel from sticking to sliding; our choice", scale=1e-4),
    )
    of_models = (Parameter("presliding", 2e-4, "m", 2e-5, 3e-3, "tendon travel from sticking to sliding; our choice", scale=5e-5),)
    inactive_when_off = ("presliding",)
    confusable_with = ("joint_friction",)
    guesses = ({"mu": 0.1},)
    moves_with = "the direction of pull (hysteresis loop)"
    plot_against = "loop"
    hidden_without = frozenset({DataNeed.REVERSALS})

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return the parameters for all tendons, or those of the tendons of an MJCF, mu for each."""
        if not of_a_model(n_tendon):
            return super().all_parameters(n_tendon)
        return (*cls.of_models, *(replace(cls.parameters[0], name=f"mu_{name}") for name in tendon_names(n_tendon)))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start antagonists with a tenth of the friction: they always pull and turn several times, so that it shows as much."""
        if of_a_model(n_tendon):
            if mu := {f"mu_{name}": 0.05 for name in tendon_names(n_tendon)}:
                yield FitStart(mu, (*mu, "presliding"))
        elif any(s.antagonists for s in predicted):
            yield FitStart({"mu": 0.01}, ("mu", "presliding"))
        else:
            yield from super().fit_starts(predicted, n_tendon)

    def route(self) -> Route:
        if of_a_model(self.n_tendon):
            mu = tuple(self[f"mu_{name}"] for name in tendon_names(self.n_tendon))
            most = max(mu, default=0.0)
            return Route(most, self["presliding"], mu_shares=tuple(m / most for m in mu)) if most > 0.0 else Route()
        return Route(self["mu"], self["presliding"])
