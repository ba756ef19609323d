"""Tip payload: an undeclared mass at the tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twin.body import Loads, Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter


class TipPayload(Effect):
    """A point mass at the centre of the tip disk, added to what each trial declares: m' = m + mass.

    It stretches silicone and with it the tendons' lengths: `zeroed` is 1 if the mass hung there when these were set to zero.

    Source: statics. A gripper, a cable or a marker body that was not weighed.

    >>> import numpy as np
    >>> round(TipPayload(mass=0.005).surround(Loads(np.zeros(3), payload=0.01)).payload, 4)
    0.015
    """

    id = "tip_payload"
    parameters = (
        Parameter("mass", 0.0, "kg", 0.0, 0.1, "undeclared mass at the tip", scale=1e-3),
        Parameter("zeroed", 0.0, "1", 0.0, 1.0, "share of it that hung there when lengths were set to zero", scale=1.0),
    )
    inactive_when_off = ("zeroed",)
    needs = frozenset({"weight"})
    moves_with = "the bending of the body under its weight"
    plot_against = "reach"
    hidden_without = frozenset({DataNeed.TWO_LOADS})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start without and with the mass when lengths are set to zero, the latter for a body that hangs then."""
        yield FitStart({"mass": 2e-3, "zeroed": 0.0}, ("mass",))
        yield FitStart({"mass": 2e-3, "zeroed": 1.0}, ("mass",), frozenset({"hanging zero"}))

    def surround(self, loads: Loads) -> Loads:
        return replace(
            loads, payload=loads.payload + self["mass"], payload_at_zero=loads.payload_at_zero + self["zeroed"] * self["mass"]
        )
