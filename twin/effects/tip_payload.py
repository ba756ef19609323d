"""Tip payload: an undeclared mass at the tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from twin.effects.effect import Effect, Loads, Signals, Start
from twin.quantities import Parameter


class TipPayload(Effect):
    """A point mass at the centre of the tip disk, added to what each trial declares: m' = m + mass.

    Silicone it stretches, and tendons' lengths with it: `zeroed` is 1 where it hung there already when these were set to zero.

    Source: statics. A gripper, a cable or a marker body that nobody weighed.

    >>> import numpy as np
    >>> round(TipPayload(mass=0.005).surround(Loads(np.zeros(3), payload=0.01)).payload, 4)
    0.015
    """

    id = "tip_payload"
    parameters = (
        Parameter("mass", 0.0, "kg", 0.0, 0.1, "undeclared mass at the tip", scale=1e-3),
        Parameter("zeroed", 0.0, "1", 0.0, 1.0, "share of it that hung there when lengths were set to zero", scale=1.0),
    )
    shape = ("zeroed",)
    needs = frozenset({"weight"})
    moves_with = "the bending of the body under its weight"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Either way of setting lengths to zero, where the body hangs then."""
        yield Start({"mass": 2e-3, "zeroed": 0.0}, ("mass",))
        yield Start({"mass": 2e-3, "zeroed": 1.0}, ("mass",), frozenset({"hanging zero"}))

    def surround(self, loads: Loads) -> Loads:
        return replace(loads, payload=loads.payload + self["mass"], at_zero=loads.at_zero + self["zeroed"] * self["mass"])
