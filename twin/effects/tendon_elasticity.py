"""Tendon elasticity: the tendon stretches under tension, most under the first of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from twin.effects.effect import ROPES, Effect, Route, Signals, Start
from twin.quantities import Parameter

SHARES = (0.1, 0.3)  # of the largest tension, over which tendons may bed in


class TendonElasticity(Effect):
    """Under T a tendon is longer by e = stretch T + toe (1 - exp(-(T - T_0) / toe_tension)); T_0 is the tension of its rest, which
    of a backbone's tendons is none. Displacement at the motor = shortening of the path + e.

    Driven by displacement the robot gets less of it the harder it is to bend, and lags at the start of each pull; driven by
    tension only the displacement shows it. Of two antagonists under a load F of the joint, in tension, the toe alone is
    toe tanh(F / (2 toe_tension)): soft where the load changes sides, and used up beyond, where the stretch stays. So a loop that
    friction makes is wide under loads smaller than the friction, and narrows under larger ones to what stretch makes of it, not
    to nothing. An SMA spring was put on as long as it is described, under its first tension, which stretched the tendon already
    (`hooked`, 1), or it has been drawn in by that since (0).

    Source: Hooke; stretch = length / (E A) of tendon and mount. Steel rope of 0.3 mm and 0.5 m: 0.05 mm/N; braided line: ten times.
    The toe is what manufacturers of wire rope call constructional stretch: gaps between wires close under the first load, and sag
    straightens (carlstahl-technocables.de, "Elongation"); it is below 1 % of the length, and prestretching takes most of it out
    (Strand Core, "Wire rope stretch"). The exponential is ours: the least law that has an amount and a tension.

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
    shape = ("toe_tension", "hooked")
    richer = ("stretch",)  # of a toe; alone it is the plain law
    moves_with = "tension against displacement, a pull's first newtons most; between antagonists loops that narrow under load"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Stretch alone; or the toe alone, of antagonists below their pretension, of a backbone's over shares of the largest
        pull of the day; where springs pull, either put on. Stretch beside a toe is sought where the toe is in force."""
        antagonists, sprung = (any(x) for x in ([s.antagonists for s in predicted], [s.by_current.any() for s in predicted]))
        largest = max((float(s.tension.max(initial=0.0)) for s in predicted), default=0.0)
        shares = [(5e-4, float(np.clip(share * largest, 0.3, 20.0))) for share in SHARES if largest > 0.0]
        toes = ((1e-3, 1.0), (4e-4, 2.0)) if antagonists else shares
        for hooked in ({"hooked": 1.0}, {"hooked": 0.0}) if sprung else ({},):
            yield Start({"stretch": 5e-5, **hooked}, ("stretch",))
            for toe, tension in toes:
                yield Start({"toe": toe, "toe_tension": tension, **hooked}, ("toe", "toe_tension"), ROPES)

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return "toe" if "toe" in free else "stretch"

    def route(self) -> Route:
        return Route(stretch=self["stretch"], bedding=self["toe"], bedding_tension=self["toe_tension"], hooked=self["hooked"])
