"""Tendon elasticity: the tendon stretches under tension."""

from __future__ import annotations

from twin.effects.effect import Effect, Route
from twin.quantities import Parameter


class TendonElasticity(Effect):
    """Displacement at the motor = shortening of the path + stretch * tension at the base.

    Driven by displacement the robot gets less of it the harder it is to bend; driven by tension only the displacement shows it.

    Source: Hooke; stretch = length / (E A) of tendon and mount. Steel rope of 0.3 mm and 0.5 m: 0.05 mm/N; braided line: ten times.

    >>> TendonElasticity(stretch=5e-5).route().stretch
    5e-05
    """

    id = "tendon_elasticity"
    parameters = (Parameter("stretch", 0.0, "m/N", 0.0, 1e-2, "ropes and lines of a metre: 0.01-1 mm/N", scale=2e-5),)
    guesses = ({"stretch": 5e-5},)
    moves_with = "tension against displacement"

    def route(self) -> Route:
        return Route(stretch=self["stretch"])
