"""Constructional stretch: strands bed in and sag straightens at low tension, and then they have."""

from __future__ import annotations

from twin.effects.effect import Effect, Route
from twin.quantities import Parameter


class ConstructionalStretch(Effect):
    """From its rest under T_0 a tendon is longer by e = elongation (1 - exp(-(T - T_0) / tension)), beside its elastic stretch.

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
    needs = frozenset({"antagonists"})
    guesses = ({"elongation": 1e-3, "tension": 1.0}, {"elongation": 4e-4, "tension": 2.0})
    moves_with = "load that changes sides (soft around none), and loops that narrow under load"

    def route(self) -> Route:
        return Route(bedding=self["elongation"], bedding_tension=self["tension"])
