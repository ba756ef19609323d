"""Stiffness gradient: the body is stiffer or softer towards the tip than described."""

from __future__ import annotations

from twin.body import Body
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class StiffnessGradient(Effect):
    """EI(s) = EI (1 + gradient (s/L - 1/2)), and GJ (and EA of a body that stretches) likewise; s is the distance from the base.

    Source: first-order Taylor expansion of EI(s) about the middle. A ground or tempered wire; a casting that cured from one end.

    >>> StiffnessGradient(gradient=0.2)
    stiffness_gradient(gradient=0.2)
    """

    id = "stiffness_gradient"
    parameters = (Parameter("gradient", 0.0, "1", -1.6, 1.6, "relative change of EI from base to tip", scale=0.05),)
    guesses = ({"gradient": 0.1},)
    needs = frozenset({"length"})
    moves_with = "the place along the body"
    plot_against = "reach"
    hidden_without = frozenset({DataNeed.THREE_MARKERS})

    def edit(self, body: Body) -> None:
        body.set_stiffness_gradient(self["gradient"])
