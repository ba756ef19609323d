"""Tendon elasticity: the tendon stretches under tension."""

from __future__ import annotations

from collections.abc import Iterator

from twin.effects.effect import Effect, Route, Signals, Start
from twin.quantities import Parameter


class TendonElasticity(Effect):
    """Displacement at the motor = shortening of the path + stretch * tension at the base.

    Driven by displacement the robot gets less of it the harder it is to bend; driven by tension only the displacement shows it. The
    fuller law, sought for antagonists: strands bed in and sag straightens, so that a rope stiffens the harder it is pulled; from
    its rest under T_0 it is longer by e with de/dT = stretch exp(-stiffening (T - T_0)).

    Source: Hooke; stretch = length / (E A) of tendon and mount. Steel rope of 0.3 mm and 0.5 m: 0.05 mm/N; braided line: ten times.
    Exponential stiffening: Fung (1967) of tissue; stranded ropes stiffen likewise at low tension (constructional stretch).

    >>> TendonElasticity(stretch=5e-5).route().stretch
    5e-05
    """

    id = "tendon_elasticity"
    parameters = (
        Parameter("stretch", 0.0, "m/N", 0.0, 1e-2, "ropes and lines of a metre: 0.01-1 mm/N", scale=2e-5),
        Parameter("stiffening", 0.0, "1/N", 0.0, 2.0, "Hooke's law: 0; ours: e-fold within half a newton at most", scale=0.05),
    )
    richer = ("stiffening",)
    richer_needs = frozenset({"antagonists"})
    guesses = ({"stretch": 5e-5},)
    moves_with = "tension against displacement"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """More stretch; of antagonists, which turn rigid joints, also stiffening: how they give under load and without tells it."""
        yield from super().starts(predicted, n_tendon)
        if any(s.antagonists for s in predicted):
            yield Start({"stiffening": 0.1}, ("stiffening",))

    def route(self) -> Route:
        return Route(stretch=self["stretch"], stiffening=self["stiffening"])
