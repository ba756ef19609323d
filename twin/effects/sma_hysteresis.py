"""SMA hysteresis: the springs change phase at other temperatures and forces than described."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.body.drives.spring import Spring
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter


class SmaHysteresis(Effect):
    """A_s, A_f = described + shift + width/2,   M_s, M_f = described + shift - width/2,   and around their middles
    A_f - A_s = spread (described), M_s - M_f = spread (described);   forces of the cold plateau = plateau (described).

    `width` opens the loop of tension against temperature, `shift` moves it, `spread` tilts its flanks. If the heating branch (A_s,
    A_f) moves by a and the cooling branch (M_s, M_f) by m, shift = (a + m)/2 and width = a - m. Springs may differ: `width_i` and
    `shift_i` are added for spring i; the last spring's are such that all sum to zero.

    Source: the transformation temperatures of NiTi move by 10 K for 0.1 % of nickel (Frenzel et al., Acta Materialia 2010) and with
    each annealing; the loop narrows by some 5-10 K over the first hundred cycles.

    >>> from twin.robots import load
    >>> spring = SmaHysteresis(width=6.0, shift=1.0, n_tendon=1).spring(load("continuum").springs(1))
    >>> [round(float(t[0]) - 273.15, 2) for t in (spring.austenite_start, spring.austenite_finish, spring.martensite_start)]
    [73.0, 87.0, 58.0]
    """

    id = "sma_hysteresis"
    parameters = (
        Parameter("width", 0.0, "K", -20.0, 40.0, "wires: 10-50 K between the branches; described: 25", scale=1.0),
        Parameter("shift", 0.0, "K", -25.0, 25.0, "10 K for 0.1 % of nickel", scale=1.0),
        Parameter("spread", 1.0, "1", 0.3, 3.0, "of the flanks; textbook wires: 5-30 K against 14-17 K", scale=0.1, std=0.3),
        Parameter("plateau", 1.0, "1", 0.5, 2.0, "with heat treatment: per cents", scale=0.05, std=0.1),
    )
    extended_parameters = ("spread", "plateau")
    moves_with = "the direction of travel of the springs (hysteresis loop)"
    plot_against = "loop"

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        return (*cls.parameters, *(p for i in range(1, n_tendon) for p in _spring_parameters(i)))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with a wider and a narrower loop, moved up and down; no starts without springs."""
        if any(s.driven_by_current.any() for s in predicted):
            for width in (4.0, -4.0):
                for shift in (1.0, -1.0):
                    yield FitStart({"width": width, "shift": shift}, ("width", "shift"))

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        """Start with flanks and plateau common to all springs; and with these and springs that differ."""
        for parameters in dict.fromkeys((self.parameters, self.all_parameters(self.n_tendon))):
            steps = {p.name: p.value + p.step for p in parameters if p.name not in ("width", "shift")}
            yield FitStart(steps, tuple(steps))

    def spring(self, spring: Spring) -> Spring:
        width, shift = (self[name] + self._more(name, len(spring.loss)) for name in ("width", "shift"))
        up, down = shift + 0.5 * width, shift - 0.5 * width
        a = 0.5 * (spring.austenite_start + spring.austenite_finish)
        m = 0.5 * (spring.martensite_start + spring.martensite_finish)
        return spring._replace(
            austenite_start=a + up + self["spread"] * (spring.austenite_start - a),
            austenite_finish=a + up + self["spread"] * (spring.austenite_finish - a),
            martensite_start=m + down + self["spread"] * (spring.martensite_start - m),
            martensite_finish=m + down + self["spread"] * (spring.martensite_finish - m),
            detwinning_start=self["plateau"] * spring.detwinning_start,
            detwinning_finish=self["plateau"] * spring.detwinning_finish,
        )

    def _more(self, name: str, n: int) -> np.ndarray:
        """Return the springs' differences (n,) K from their mean."""
        own = np.array([self[f"{name}_{i}"] for i in range(1, n)])
        return np.append(own, -own.sum())


def _spring_parameters(i: int) -> Iterator[Parameter]:
    for name in ("width", "shift"):
        yield Parameter(f"{name}_{i}", 0.0, "K", -10.0, 10.0, "springs of one wire: kelvins; ours", scale=1.0, std=3.0)
