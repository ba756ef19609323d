"""Backbone ageing: the body's stiffness changes with use, over the session."""

from __future__ import annotations

import numpy as np

from twin.effects.effect import Effect
from twin.quantities import Parameter

SOFTEST = 0.05  # of the stiffness at first: what is left of a body that is all but broken


class BackboneAgeing(Effect):
    """Stiffness K(t) = K_0 (1 - rate t), t the time since the first trial; a negative rate stiffens (curing, hardening by work).

    Source: first-order Taylor expansion. Superelastic NiTi loses plateau stress over its first hundred cycles (functional fatigue),
    filled silicone softens while it is worked (Mullins effect).

    >>> BackboneAgeing(rate=1e-5).soften(np.zeros(2), np.array([0.0, 3600.0])).round(3).tolist()
    [1.0, 0.964]
    """

    id = "backbone_ageing"
    parameters = (
        Parameter(
            "rate",
            0.0,
            "1/s",
            -2e-4,
            2e-4,
            "functional fatigue, Mullins effect: some 10 % an hour; half of it is past any use",
            scale=3e-6,
        ),
    )
    guesses = ({"rate": 1e-5},)
    needs = frozenset({"elasticity"})
    moves_with = "the time of day"

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        return np.maximum(SOFTEST, 1.0 - self["rate"] * clock)
