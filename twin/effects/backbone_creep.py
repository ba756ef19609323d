"""Creep: part of the body's strain is delayed."""

from __future__ import annotations

import math

from twin.body import Creep
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.compiled import jit
from twin.foundation.parameters import Parameter


@jit
def delayed_strain(delayed, instant, amplitude, time, dt):
    """Return the delayed strain after dt (s) under a constant instant strain: the exact step of time d' = amplitude instant - d."""
    return delayed + (1.0 - math.exp(-dt / time)) * (amplitude * instant - delayed)


class BackboneCreep(Effect):
    """Delayed (viscoelastic) strain: eps = eps_e + eps_c, time * eps_c' = amplitude * eps_e - eps_c.

    eps_e = moment / (E I) is the instant strain, eps_c the delayed one: a Kelvin-Voigt element in series, with `amplitude_2` two of
    them (a two-term Prony series). It carries over from one trial to the next and fades while the robot rests unloaded.

    Source: standard linear solid (Kelvin-Voigt chain). Polymers creep by 5-50 % over seconds to hours; a NiTi wire by a few per
    cent.

    >>> round(delayed_strain(0.0, 1.0, 0.3, 10.0, 10.0), 4)   # 0.3 (1 - 1/e)
    0.1896
    """

    id = "backbone_creep"
    parameters = (
        Parameter("amplitude", 0.0, "1", 0.0, 2.0, "delayed over instant strain; ours: up to 2 for soft polymers", scale=0.03),
        Parameter("time", 10.0, "s", 0.3, 3000.0, "retardation time; what a bench day can show", scale=3.0),
        Parameter("amplitude_2", 0.0, "1", 0.0, 2.0, "second term of the Prony series", scale=0.03),
        Parameter("time_2", 100.0, "s", 0.3, 10000.0, "second retardation time", scale=30.0),
    )
    inactive_when_off = ("time", "time_2")
    extended_parameters = ("amplitude_2", "time_2")
    guesses = ({"amplitude": 0.06, "time": 3.0}, {"amplitude": 0.06, "time": 15.0}, {"amplitude": 0.06, "time": 80.0})
    needs = frozenset({"viscosity"})
    moves_with = "time held under load"
    plot_against = "elapsed"
    hidden_without = frozenset({DataNeed.REVERSALS, DataNeed.TWO_RATES, DataNeed.LONG_HOLDS, DataNeed.RANDOM_ORDER})

    def deform(self) -> Creep:
        pairs = [(self["amplitude"], self["time"]), (self["amplitude_2"], self["time_2"])]
        on = [(a, t) for a, t in pairs if a > 0.0]
        return Creep(tuple(a for a, _ in on), tuple(t for _, t in on))
