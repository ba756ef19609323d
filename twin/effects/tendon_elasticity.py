"""Tendon elasticity: the tendon stretches under tension, most under the first of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from twin.body import ROPE_FEATURES, Body, Route, Signals
from twin.body.drives.counts import of_a_model, winches
from twin.effects.base.effect import DataNeed, Effect, FitStart, each_then_all
from twin.foundation.parameters import Parameter

DRUM_READINGS = ("actuator angle", "actuator length")  # groups of what an MJCF's actuators show of their places
TOE_TENSION_SHARES = (0.1, 0.3)  # of the largest tension: tensions of the toe from which fits start


class TendonElasticity(Effect):
    """Under tension T a tendon is longer by e = stretch T + toe (1 - exp(-(T - T_0) / toe_tension)), T_0 its tension at rest.

    T_0 is zero for a backbone's tendons. Displacement at the motor = shortening of the path + e. A robot driven by displacement
    bends less the stiffer it is, and lags at the start of each pull; if tension drives it, only the displacement shows the effect.

    For two antagonists under a load F of the joint, as a tension, the toe is toe tanh(F / (2 toe_tension)): it is soft where the
    load changes its sign and taken up beyond, where the stretch remains. So the loop made by friction is wide under loads smaller
    than the friction, and narrows under larger loads to a width that stretch determines, not to zero.

    On an MJCF each tendon that an actuator winds has its own stretch. The actuator's drum, and its position reading, is at

        l_d = l - stretch T,    T = -gear force,    l the length of the path,

    and a winch that holds its drum, T = kp (l_d - ctrl) + kv l_d', pulls on the path, with s = 1 + kp stretch, by

        s T + kv stretch T' = kp (l - ctrl) + kv l',    here T = (kp / s) (l - u) + (kv / s^2) l',    u + lag u' = ctrl,

    lag = kv stretch / s: the same for motions that are slow beside 1 / lag (of milliseconds). An actuator with dynamics of its own
    has kv / s instead, and no lag. Limits of the force stay where they are; readings of force and tension are T.

    The first tension of an SMA spring had stretched the tendon when the spring was mounted (`hooked` 1), or stretched it afterwards
    (0).

    Source: Hooke; stretch = length / (E A) of tendon and mount. Steel rope of 0.3 mm and 0.5 m: 0.05 mm/N; braided line: ten times.
    The toe is called constructional stretch by manufacturers of wire rope: gaps between wires close under the first load, and sag
    straightens (carlstahl-technocables.de, "Elongation"). It is below 1 % of the length, and prestretching removes most of it
    (Strand Core, "Wire rope stretch"). The exponential is ours: the simplest law with an amount and a tension.

    >>> TendonElasticity(stretch=5e-5).route().stretch
    5e-05
    >>> from twin.body.drives.counts import Counts, Winch
    >>> TendonElasticity(stretch_flexor=1e-4, n_tendon=Counts.of(1, (), ("flexor",), (Winch("flexor", 0, 2.0),))).give().tolist()
    [0.0004]
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
    needs = frozenset({"lines"})
    extended_parameters = ("stretch",)  # of a toe; alone it is the plain law
    moves_with = "tension against displacement, a pull's first newtons most; between antagonists loops that narrow under load"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.DISPLACEMENTS})

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return the parameters for all tendons, or the stretch of each wound tendon of an MJCF."""
        if not of_a_model(n_tendon):
            return super().all_parameters(n_tendon)
        return tuple(replace(cls.parameters[0], name=name) for name in _stretches(n_tendon))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with stretch alone and with the toe alone; where springs pull, with both ways of mounting them.

        The toe starts below the pretension of antagonists, or at shares of the largest tension of a backbone's tendons. Stretch is
        added to a toe by `extended_starts`. Start an MJCF with each tendon alone and with all.
        """
        if of_a_model(n_tendon):
            yield from each_then_all([{name: 5e-5} for name in _stretches(n_tendon)])
            return
        antagonists, sprung = (any(x) for x in ([s.antagonists for s in predicted], [s.driven_by_current.any() for s in predicted]))
        largest = max((float(s.tension.max(initial=0.0)) for s in predicted), default=0.0)
        shares = [(5e-4, float(np.clip(share * largest, 0.3, 20.0))) for share in TOE_TENSION_SHARES if largest > 0.0]
        toes = ((1e-3, 1.0), (4e-4, 2.0)) if antagonists else shares
        for hooked in ({"hooked": 1.0}, {"hooked": 0.0}) if sprung else ({},):
            yield FitStart({"stretch": 5e-5, **hooked}, ("stretch",))
            for toe, tension in toes:
                yield FitStart({"toe": toe, "toe_tension": tension, **hooked}, ("toe", "toe_tension"), ROPE_FEATURES)

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        if not of_a_model(self.n_tendon):
            yield from super().extended_starts(predicted)

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return "toe" if "toe" in free else "stretch"

    def acts_in(self, *places: str) -> bool:
        """Return whether it acts in any of the places; what it moves of readings are those of an MJCF's drums."""
        return super().acts_in(*(p for p in places if p not in ("edit", "sense") or of_a_model(self.n_tendon)))

    def give(self) -> np.ndarray:
        """Return by how much the line of each actuator (n_drive,) of an MJCF gives, m/N in the units of the actuator."""
        give = np.zeros(int(self.n_tendon))
        for winch in winches(self.n_tendon):
            give[winch.actuator] = winch.gear**2 * self[f"stretch_{winch.tendon}"]
        return give

    def edit(self, body: Body) -> None:
        if of_a_model(self.n_tendon) and (give := self.give()).any():
            body.stretch_lines(give)

    def sense(self, true: Signals) -> Signals:
        if not of_a_model(self.n_tendon) or not (give := self.give()).any():
            return true
        shorter = give * true.tension  # of an MJCF the tension is what its actuators' forces are short of zero
        return true.with_changes(others={**true.others, **{g: true.others[g] - shorter for g in DRUM_READINGS if g in true.others}})

    def route(self) -> Route:
        if of_a_model(self.n_tendon):
            return Route()
        return Route(
            stretch=self["stretch"], bedding=self["toe"], bedding_tension=self["toe_tension"], initial_stretch_share=self["hooked"]
        )


def _stretches(n_tendon: int) -> tuple[str, ...]:
    """Return the names of the parameters of an MJCF: one for each tendon that is wound, however many actuators wind it."""
    return tuple(dict.fromkeys(f"stretch_{winch.tendon}" for winch in winches(n_tendon)))
