"""Drifts that start at a rate and level off: amplifiers that warm up, cords that settle, bodies in their first cycles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import FitStart

LEVELLING_TIMES = 3.0  # of a drift's time constant in the session, for a start that levels off


def saturated_time(clock: np.ndarray, levelling: float) -> np.ndarray:
    """Return the drift of unit rate (s) at `clock` (n,) s: (1 - exp(-levelling t)) / levelling, or t if levelling is zero."""
    t = np.asarray(clock, float)
    return -np.expm1(-levelling * t) / levelling if levelling else t


def saturating_starts(plain: Iterator[FitStart], predicted: list[Signals], highest: float) -> Iterator[FitStart]:
    """Yield these starts, whose rates are constant, then the same with drifts that level off; `highest` bounds levelling (1/s)."""
    constant = list(plain)
    yield from constant
    session = max((float(s.clock.max(initial=0.0)) for s in predicted), default=0.0)
    if session > 0.0:
        for start in constant:
            rates = {name: LEVELLING_TIMES * rate for name, rate in start.values.items()}
            yield FitStart({**rates, "levelling": min(LEVELLING_TIMES / session, highest)}, (*start.free, "levelling"))
