"""Backbone ageing: the body's stiffness changes with use, over the session."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.effects.base.saturating_drift import saturated_time, saturating_starts
from twin.effects.temperature_softening import MIN_STIFFNESS_SHARE
from twin.foundation.parameters import Parameter


class BackboneAgeing(Effect):
    """Stiffness K(t) = K_0 (1 - rate (1 - exp(-levelling t)) / levelling), t the time since the first trial.

    It changes by `rate` at first and levels off at K_0 (1 - rate / levelling); without levelling it is K_0 (1 - rate t). A negative
    rate stiffens (curing, work hardening).

    Source: superelastic NiTi loses plateau stress over its first hundred cycles, less in each (functional fatigue); filled silicone
    softens in its first cycles and then keeps its stiffness (Mullins effect). Cycles are assumed to be evenly spread over time.

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
    inactive_when_off = ("levelling",)
    needs = frozenset({"elasticity"})
    moves_with = "the time of day"
    plot_against = "clock"
    hidden_without = frozenset({DataNeed.RANDOM_ORDER})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with a constant rate, and with a change that levels off by the end of the session."""
        yield from saturating_starts(iter((FitStart({"rate": 1e-5}, ("rate",)),)), predicted, cls.parameters[1].high)

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        return np.maximum(MIN_STIFFNESS_SHARE, 1.0 - self["rate"] * saturated_time(clock, self["levelling"]))
