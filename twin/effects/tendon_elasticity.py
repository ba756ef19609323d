"""Tendon elasticity: the tendon stretches under tension, most under the first of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from twin.body import ROPE_FEATURES, Route, Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter

TOE_TENSION_SHARES = (0.1, 0.3)  # of the largest tension: tensions of the toe from which fits start


class TendonElasticity(Effect):
    """Under tension T a tendon is longer by e = stretch T + toe (1 - exp(-(T - T_0) / toe_tension)), T_0 its tension at rest.

    T_0 is zero for a backbone's tendons. Displacement at the motor = shortening of the path + e. A robot driven by displacement
    bends less the stiffer it is, and lags at the start of each pull; if tension drives it, only the displacement shows the effect.

    For two antagonists under a load F of the joint, as a tension, the toe is toe tanh(F / (2 toe_tension)): it is soft where the
    load changes its sign and taken up beyond, where the stretch remains. So the loop made by friction is wide under loads smaller
    than the friction, and narrows under larger loads to a width that stretch determines, not to zero.

    The first tension of an SMA spring had stretched the tendon when the spring was mounted (`hooked` 1), or stretched it afterwards
    (0).

    Source: Hooke; stretch = length / (E A) of tendon and mount. Steel rope of 0.3 mm and 0.5 m: 0.05 mm/N; braided line: ten times.
    The toe is called constructional stretch by manufacturers of wire rope: gaps between wires close under the first load, and sag
    straightens (carlstahl-technocables.de, "Elongation"). It is below 1 % of the length, and prestretching removes most of it
    (Strand Core, "Wire rope stretch"). The exponential is ours: the simplest law with an amount and a tension.

    >>> TendonElasticity(stretch=5e-5).route().stretch
    5e-05
    >>> TendonElasticity(toe=3e-4, toe_tension=2.0).route().bedding
    0.0003
    """

    id = "tendon_elasticity"
    parameters = (
        Parameter("stretch", 0.0, "m/N", 0.0, 1e-2, "ropes and lines of a metre: 0.01-1 mm/N", scale=2e-5),
        Parameter("toe", 0.0, "m", 0.0, 2e-3, "below 1 % of a rope; of 0.8 m, prestretched: 0.1-1 mm", scale=5e-5),
        Parameter("toe_tension", 2.0, "N", 0.3, 20.0, "a small part of the pretension; ours", scale=0.5),
        Parameter("hooked", 1.0, "1", 0.0, 1.0, "share of the first stretch there when SMA springs were put on", scale=1.0),
    )
    inactive_when_off = ("toe_tension", "hooked")
    extended_parameters = ("stretch",)  # of a toe; alone it is the plain law
    moves_with = "tension against displacement, a pull's first newtons most; between antagonists loops that narrow under load"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.DISPLACEMENTS})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with stretch alone and with the toe alone; where springs pull, with both ways of mounting them.

        The toe starts below the pretension of antagonists, or at shares of the largest tension of a backbone's tendons. Stretch is
        added to a toe by `extended_starts`.
        """
        antagonists, sprung = (any(x) for x in ([s.antagonists for s in predicted], [s.driven_by_current.any() for s in predicted]))
        largest = max((float(s.tension.max(initial=0.0)) for s in predicted), default=0.0)
        shares = [(5e-4, float(np.clip(share * largest, 0.3, 20.0))) for share in TOE_TENSION_SHARES if largest > 0.0]
        toes = ((1e-3, 1.0), (4e-4, 2.0)) if antagonists else shares
        for hooked in ({"hooked": 1.0}, {"hooked": 0.0}) if sprung else ({},):
            yield FitStart({"stretch": 5e-5, **hooked}, ("stretch",))
            for toe, tension in toes:
                yield FitStart({"toe": toe, "toe_tension": tension, **hooked}, ("toe", "toe_tension"), ROPE_FEATURES)

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return "toe" if "toe" in free else "stretch"

    def route(self) -> Route:
        return Route(
            stretch=self["stretch"], bedding=self["toe"], bedding_tension=self["toe_tension"], initial_stretch_share=self["hooked"]
        )
