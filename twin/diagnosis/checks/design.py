"""The shortcomings of an experiment's design. An effect declares what it is hidden without (`Effect.hidden_without`)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from twin.body import Drive
from twin.diagnosis.thresholds import (
    LEAST_TEMPERATURE_SPREAD,
    LEAST_UNLOADING_SHARE,
    PULLED_TENDON_SHARE,
    SAMPLES_TO_SHOW_RATE,
    SHORTEST_HOLD,
    STILL_COMMAND_SHARE,
    TWO_RATES_RATIO,
)
from twin.effects.base.effect import DataNeed
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import Inputs, PreparedRecording


def shortcomings(prepared: PreparedRecording) -> list[DataNeed]:
    """Return what the design lacks."""
    inputs = prepared.inputs
    top = max(float(np.abs(i.pull).max()) for i in inputs)
    changes = np.concatenate([np.diff(i.pull, axis=0) for i in inputs])
    rising, falling = (float(np.maximum(c, 0.0).sum()) for c in (changes, -changes))
    every = np.array([r for i in inputs for r in rates(i, top)])
    lacking = {
        DataNeed.REVERSALS: min(rising, falling) < LEAST_UNLOADING_SHARE * max(rising, falling),
        # Quantiles, not extremes: one pull alone may be held out.
        DataNeed.TWO_RATES: every.size == 0 or np.quantile(every, 0.9) < TWO_RATES_RATIO**0.5 * np.quantile(every, 0.1),
        DataNeed.LONG_HOLDS: max(longest_rest(i, top) for i in inputs) < SHORTEST_HOLD,
        DataNeed.TWO_LOADS: len({(round(i.loads.hung, 6), *np.round(i.loads.gravity, 3)) for i in inputs}) < 2,
        DataNeed.EVERY_TENDON: len(set().union(*(pulled(i, top) for i in inputs))) < prepared.n_tendon,
        DataNeed.THREE_MARKERS: len({o.index for o in prepared.outputs if OUTPUT_GROUPS[o.group].is_point}) < 3,
        DataNeed.DISPLACEMENTS: Drive.DISPLACEMENT not in prepared.drives
        and not any(o.group == "displacement" for o in prepared.outputs),
        DataNeed.TEMPERATURES: np.ptp(np.concatenate([i.temperature for i in inputs])) < LEAST_TEMPERATURE_SPREAD,
        DataNeed.RANDOM_ORDER: len(inputs) > 2 and _ordered(prepared),
    }
    return [need for need, is_lacking in lacking.items() if is_lacking]


def pulled(inputs: Inputs, top: float) -> list[int]:
    """Return the tendons that move in a trial by more than `PULLED_TENDON_SHARE` of the largest command `top`."""
    return [int(t) for t in np.flatnonzero(np.ptp(inputs.pull, axis=0) > PULLED_TENDON_SHARE * top)]


def rates(inputs: Inputs, top: float) -> list[float]:
    """Return the rate at which each moving tendon is pulled: the median slope of its moving samples."""
    slope = np.abs(np.diff(inputs.pull, axis=0)) / np.diff(inputs.time)[:, None]
    found = []
    for t in pulled(inputs, top):
        moving = slope[:, t] > 0.1 * slope[:, t].max()
        if moving.sum() >= SAMPLES_TO_SHOW_RATE:
            found.append(float(np.median(slope[moving, t])))
    return found


def longest_rest(inputs: Inputs, top: float) -> float:
    """Return the longest stretch (s) of a trial without motion."""
    still = np.abs(np.diff(inputs.pull, axis=0)).max(axis=1) < STILL_COMMAND_SHARE * top
    best, since = 0.0, None
    for k, s in enumerate(still):
        if s:
            since = inputs.time[k] if since is None else since
            best = max(best, float(inputs.time[k + 1] - since))
        else:
            since = None
    return best


def _ordered(prepared: PreparedRecording) -> bool:
    """Return whether trials come in blocks of one payload, or of one tendon that is pulled most.

    They do if the label changes between neighbouring trials less than half as often as by chance.
    """
    return _blocked([i.loads.hung for i in prepared.inputs]) or _blocked(
        [int(np.argmax(np.ptp(i.pull, axis=0))) for i in prepared.inputs]
    )


def _blocked(labels: Sequence[float]) -> bool:
    counts = np.array([labels.count(x) for x in set(labels)])
    if len(counts) < 2:
        return False
    n = len(labels)
    expected = (n - 1) * (1.0 - float((counts * (counts - 1)).sum()) / (n * (n - 1)))
    return sum(a != b for a, b in pairwise(labels)) < 0.5 * expected
