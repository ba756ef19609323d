"""What sensors have drifted by since their alignment, told by free motion, whatever the drift's way through time.

Where nothing pushes, tendons give the strains (`free.py`), and so the resistances of the aligned sensors. In a free trial k

    g_k = median over its samples of log(R / R_tendons),      sensor by sensor

is drift where it is one factor for the whole trial: with it undone, tendons explain half of the samples or more. A push nobody
declared is no factor, and such a trial tells nothing. Drift is taken for a random walk: between trials that tell it its mean is a
straight line in time, before the first and after the last it stays. A twin with an effect on more than its sensors tells nothing:
the strains are those of the finger as described.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.errors import DataError
from twin.sensors import Cords, resistance, strain
from twin.shape.free import Free, far
from twin.shape.modal import Network
from twin.shape.sensing import Sensed, feeling
from twin.twin import Twin

LEAST = 0.005  # of log R: 0.0017 at most was seen of sensors that do not drift (bench days 501, 512, 513 and one of another bench)
EXPLAINED = 6.0  # standard deviations of the strains, below which half of the samples must be


def steadied(trials: Sequence[Sensed], starts: Sequence[float | None], twin: Twin) -> tuple[tuple[Sensed, ...], tuple[str, ...]]:
    """The trials with drift undone, and what was found; `starts` (s) on the day's clock, by order where one is not known."""
    if any(effect.physical for effect in twin.effects):
        return tuple(trials), ()  # its tendons make other strains than those the network has learnt
    try:
        free, cords = Network.of(twin.robot).free, feeling(twin).cords
    except DataError:  # a robot without these weights: no strains to compare with
        return tuple(trials), ()
    clock = [float(k) if None in starts else float(s or 0.0) for k, s in enumerate(starts)]
    told = [(t, g) for t, trial in zip(clock, trials, strict=True) if (g := _drift(trial, free, cords)) is not None]
    if not told:
        return tuple(trials), ()
    times, drifts = np.array([t for t, _ in told]), np.stack([g for _, g in told])
    order = np.argsort(times)
    times, drifts = times[order], drifts[order]
    drifts[:, np.abs(drifts).max(axis=0) < LEAST] = 0.0
    if not drifts.any():
        return tuple(trials), ()
    at = np.stack([np.interp(clock, times, g) for g in drifts.T], axis=1)
    moved = tuple(replace(t, resistance=t.resistance * np.exp(-g)) for t, g in zip(trials, at, strict=True))
    most = ", ".join(f"{100 * np.expm1(g[np.abs(g).argmax()]):+.1f} %" for g in drifts.T)
    return moved, (f"in free motion the sensors read other resistances than at alignment, by up to {most}: drift, undone",)


def _drift(trial: Sensed, free: Free, cords: Cords) -> np.ndarray | None:
    """(s,) log of what each sensor reads too much in a trial without a push, 0 where it is dead; None where the trial does not
    tell."""
    if trial.pushed:
        return None
    alone = free(trial.displacement)
    apart = np.log(trial.resistance / resistance(alone, cords))
    alive = np.isfinite(apart).any(axis=0)
    g = np.zeros(apart.shape[1])
    g[alive] = np.nanmedian(apart[:, alive], axis=0)
    left = far(alone, strain(trial.resistance * np.exp(-g), cords))
    return g if np.median(left) < EXPLAINED else None
