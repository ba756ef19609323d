"""SMA cooling: the springs lose heat to their surroundings faster or slower than described."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.body.drives.spring import Spring
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter


class SmaCooling(Effect):
    """Heat loss of spring i: h_i = factor share_i (h + forced) (1 + rate (T_a - 23 degC)), h the described one (W/K).

    The last spring's share makes the product of all shares one. `factor` stands for still or moving air around all springs, `share`
    for a draught on one side, `forced` for a loss that depends on neither elongation nor heat, `rate` for surroundings that cool
    better when warm.

    Source: Newton's law of cooling. A fan doubles to quintuples the loss of a thin wire (forced against free convection, Churchill
    and Bernstein 1977), a tube around the spring halves it.

    >>> from twin.robots import load
    >>> plain = load("continuum").springs(3)
    >>> (SmaCooling(factor=1.5, share_2=2.0).spring(plain).loss / plain.loss).round(3).tolist()
    [1.5, 3.0, 0.75]
    """

    id = "sma_cooling"
    parameters = (
        Parameter("factor", 1.0, "1", 0.2, 5.0, "half in a tube, up to five times in a fan's wind", scale=0.05),
        Parameter("forced", 0.0, "W/K", -1e-3, 1e-2, "a draught's; described: 2-5 mW/K", scale=2e-4, std=1e-3),
        Parameter("rate", 0.0, "1/K", -0.1, 0.1, "air's properties: 0.002; a ventilated room: ours", scale=0.01, std=0.03),
    )
    extended_parameters = ("forced", "rate")
    moves_with = "the heat of the springs, so the time held"
    plot_against = "elapsed"

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        source = "springs beside each other: tens of per cent"
        shares = (Parameter(f"share_{i}", 1.0, "1", 0.2, 5.0, source, scale=0.05, std=0.3) for i in range(1, n_tendon))
        return (*cls.parameters, *shares)

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with more and with less loss of all springs, then with each spring's own; no starts without springs."""
        if not any(s.driven_by_current.any() for s in predicted):
            return
        for factor in (1.3, 0.75):
            yield FitStart({"factor": factor}, ("factor",))
        shares = {p.name: 1.1 for p in cls.all_parameters(n_tendon) if p not in cls.parameters}
        if shares:
            yield FitStart({"factor": 1.1, **shares}, ("factor", *shares))

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        """Start with forced loss and warm air; and, if all shares are one, also with each spring's own share."""
        yield from super().extended_starts(predicted)
        shares = [p.name for p in self.all_parameters(self.n_tendon) if p not in self.parameters]
        if shares and all(self[name] == 1.0 for name in shares):
            steps = {name: self.values[name] + (0.02 if name in shares else 0.0) for name in (*self.extended_parameters, *shares)}
            yield FitStart(steps, tuple(steps))

    def spring(self, spring: Spring) -> Spring:
        shares = [self[p.name] for p in self.all_parameters(len(spring.loss)) if p not in self.parameters]
        more = self["factor"] * np.array([*shares, 1.0 / np.prod(shares)])
        return spring._replace(
            loss=more * (spring.loss + self["forced"]),
            loss_warm=more * spring.loss_warm,
            loss_warm_2=more * spring.loss_warm_2,
            loss_open=more * spring.loss_open,
            loss_open_2=more * spring.loss_open_2,
            loss_warm_open=more * spring.loss_warm_open,
            loss_surroundings=spring.loss_surroundings + self["rate"],
        )
