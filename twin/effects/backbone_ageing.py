"""Backbone ageing: the body's stiffness changes with use, over the session."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.effects.levelling import levelled, levelled_starts
from twin.quantities import Parameter

SOFTEST = 0.05  # of the stiffness at first: what is left of a body that is all but broken


class BackboneAgeing(Effect):
    """Stiffness K(t) = K_0 (1 - rate (1 - exp(-levelling t)) / levelling), t the time since the first trial: at first by `rate`,
    and ever less, to K_0 (1 - rate / levelling); without levelling K_0 (1 - rate t). A negative rate stiffens (curing, hardening
    by work).

    Source: superelastic NiTi loses plateau stress over its first hundred cycles, by ever less (functional fatigue); filled silicone
    softens while it is worked, towards what it then keeps (Mullins effect). That both go with cycles, evenly made, is assumed.

    >>> BackboneAgeing(rate=1e-5).soften(np.zeros(2), np.array([0.0, 3600.0])).round(3).tolist()
    [1.0, 0.964]
    >>> BackboneAgeing(rate=1e-4, levelling=1e-3).soften(np.zeros(2), np.array([1.0, 36000.0])).round(4).tolist()
    [0.9999, 0.9]
    """

    id = "backbone_ageing"
    parameters = (
        Parameter(
            "rate",
            0.0,
            "1/s",
            -2e-3,
            2e-3,
            "functional fatigue, Mullins effect: some 10 % an hour; as much in minutes where it levels off",
            scale=3e-6,
        ),
        Parameter("levelling", 0.0, "1/s", 0.0, 2e-2, "the first cycles: from a minute's to an hour's", scale=1e-4),
    )
    shape = ("levelling",)
    needs = frozenset({"elasticity"})
    moves_with = "the time of day"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """All through the session alike, and levelled off by its end."""
        yield from levelled_starts(iter((Start({"rate": 1e-5}, ("rate",)),)), predicted, cls.parameters[1].high)

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        return np.maximum(SOFTEST, 1.0 - self["rate"] * levelled(clock, self["levelling"]))
