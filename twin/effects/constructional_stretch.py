"""Constructional stretch: strands bed in and sag straightens at low tension, and then they have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Route, Signals, Start
from twin.quantities import Parameter

SHARES = (0.1, 0.3)  # of the largest tension, over which tendons may bed in


class ConstructionalStretch(Effect):
    """Under T a tendon is longer by e = elongation (1 - exp(-(T - T_0) / tension)), beside its elastic stretch; T_0 is the
    tension of its rest, which of a backbone's tendons is none: driven by length such a robot lags at the start of each pull.

    Of two antagonists under a load F of the joint, in tension, this alone is elongation tanh(F / (2 tension)): soft where the load
    changes sides, and used up beyond, where the tendons' elastic stretch stays. So a loop that friction makes is wide under loads
    smaller than the friction, and narrows under larger ones to what elastic stretch makes of it, not to nothing.

    Source: manufacturers of wire rope tell constructional from elastic stretch: gaps between wires close under the first load
    (carlstahl-technocables.de, "Elongation"); it is below 1 % of the length, and prestretching takes most of it out (Strand Core,
    "Wire rope stretch"). The exponential is ours: the least law that has an amount and a tension.

    >>> ConstructionalStretch(elongation=3e-4, tension=2.0).route().bedding
    0.0003
    """

    id = "constructional_stretch"
    parameters = (
        Parameter("elongation", 0.0, "m", 0.0, 2e-3, "below 1 % of a rope; of 0.8 m, prestretched: 0.1-1 mm", scale=5e-5),
        Parameter("tension", 2.0, "N", 0.3, 20.0, "a small part of the pretension; ours", scale=0.5),
    )
    shape = ("tension",)
    needs = frozenset({"rope"})
    guesses = ({"elongation": 1e-3, "tension": 1.0}, {"elongation": 4e-4, "tension": 2.0})
    moves_with = "a pull's first newtons; between antagonists load that changes sides, and loops that narrow under load"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Of antagonists a tension below their pretension; of a backbone's tendons shares of the largest pull of the day."""
        if any(s.antagonists for s in predicted):
            yield from super().starts(predicted, n_tendon)
            return
        largest = max(float(s.tension.max(initial=0.0)) for s in predicted)
        for share in SHARES if largest > 0.0 else ():
            yield Start({"elongation": 5e-4, "tension": float(np.clip(share * largest, 0.3, 20.0))}, ("elongation", "tension"))

    def route(self) -> Route:
        return Route(bedding=self["elongation"], bedding_tension=self["tension"])
