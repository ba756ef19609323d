"""Tip payload: an undeclared mass at the tip."""

from __future__ import annotations

from dataclasses import replace

from twin.effects.effect import Effect, Loads
from twin.quantities import Parameter


class TipPayload(Effect):
    """A point mass at the centre of the tip disk, added to what each trial declares: m' = m + mass.

    Source: statics. A gripper, a cable or a marker body that nobody weighed.

    >>> import numpy as np
    >>> round(TipPayload(mass=0.005).surround(Loads(np.zeros(3), payload=0.01)).payload, 4)
    0.015
    """

    id = "tip_payload"
    parameters = (Parameter("mass", 0.0, "kg", 0.0, 0.1, "undeclared mass at the tip", scale=1e-3),)
    guesses = ({"mass": 2e-3},)
    needs = frozenset({"weight"})
    moves_with = "the bending of the body under its weight"

    def surround(self, loads: Loads) -> Loads:
        return replace(loads, payload=loads.payload + self["mass"])
