"""What drifts at first by its rate and ever less: amplifiers that warm up, cords that settle, bodies in their first cycles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Signals, Start

LEVELLED = 3.0  # times over which a drift may have levelled off by the session's end


def levelled(clock: np.ndarray, levelling: float) -> np.ndarray:
    """What a drift of unit rate has come to (s) at `clock` (n,) s: (1 - exp(-levelling t)) / levelling, or t."""
    t = np.asarray(clock, float)
    return -np.expm1(-levelling * t) / levelling if levelling else t


def levelled_starts(plain: Iterator[Start], predicted: list[Signals], highest: float) -> Iterator[Start]:
    """These starts of rates, which go on through the session alike, then levelled off by its end, at `highest` (1/s) at most."""
    begun = list(plain)
    yield from begun
    session = max((float(s.clock.max(initial=0.0)) for s in predicted), default=0.0)
    if session > 0.0:
        for start in begun:
            rates = {name: LEVELLED * rate for name, rate in start.values.items()}
            yield Start({**rates, "levelling": min(LEVELLED / session, highest)}, (*start.free, "levelling"))
