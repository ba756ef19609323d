"""Trials: the same one twice, one of another robot, clocks that overlap, times that are not seconds."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from twin.diagnose.suspicions.case import Case, Suspicion
from twin.diagnose.thresholds import ALIEN, COARSE, DAY_LONG, HASTY, OTHER_ROBOT, ROUNDING, SAME_NOISE


def duplicates(case: Case) -> Iterator[Suspicion]:
    """Two trials whose readings agree to far less than their own noise: one export under two names, not a repeat."""
    for a, b in itertools.combinations(case.trials, 2):
        y, z = case.bench.measured[a], case.bench.measured[b]
        if y.shape != z.shape:
            continue
        apart, noise = np.abs(y - z), _noise(y)
        known = np.isfinite(apart).any(axis=0) & np.isfinite(noise)
        if not known.any():
            continue
        off = np.array([np.nanmedian(column) for column in apart[:, known].T])
        if np.all(off <= SAME_NOISE * noise[known]):
            one, other = (case.bench.inputs[k].name for k in (a, b))
            words = f"{other} holds the readings of {one}, its noise included: the same numbers are no repeat"
            yield Suspicion("duplicate trial", words, f"remove the [[trial]] {other}, or export it again")


def _noise(y: np.ndarray) -> np.ndarray:
    """(n_output,) the typical second difference of readings (n, n_output), over that of white noise of one: sqrt(6)."""
    with np.errstate(invalid="ignore"):
        second = np.abs(np.diff(y, n=2, axis=0))
    return np.array([np.nanmedian(s) / np.sqrt(6.0) if np.isfinite(s).any() else np.nan for s in second.T])


def robots(case: Case) -> Iterator[Suspicion]:
    """Distances from marker to marker, against the described robot and from trial to trial."""
    names, columns = case.points()
    if case.predicted is None or len(columns) < 2:
        return
    ratio = {k: _spacing(case.bench.measured[k], case.predicted[k], columns) for k in case.trials}
    ratio = {k: r for k, r in ratio.items() if np.isfinite(r)}
    if not ratio:
        return
    usual = float(np.median(list(ratio.values())))
    if abs(usual - 1.0) > ALIEN and 1.0 / 3.0 < usual < 3.0:
        words = f"the markers {names[0]} to {names[-1]} lie {100 * abs(usual - 1):.0f} % {_way(usual)} than robot.toml has them"
        yield Suspicion("another robot", words, "name the robot that was measured, or correct its lengths in robot.toml")
    for k, r in ratio.items():
        if abs(r / usual - 1.0) > OTHER_ROBOT:
            name = case.bench.inputs[k].name
            words = f"in {name} the markers lie {100 * abs(r / usual - 1):.0f} % {_way(r / usual)} than in the other trials"
            yield Suspicion("trial of another robot", words, f"remove the [[trial]] {name}: a set is of one robot in one unit")


def _spacing(y: np.ndarray, p: np.ndarray, columns: np.ndarray) -> float:
    """Median of measured over predicted distances from each marker to the next."""
    measured, shown = (np.linalg.norm(np.diff(v[:, columns], axis=1), axis=2) for v in (y, p))
    found = (measured / np.maximum(shown, 1e-12))[np.isfinite(measured)]
    return float(np.median(found)) if found.size else float("nan")


def _way(ratio: float) -> str:
    return "further apart" if ratio > 1.0 else "closer together"


def clocks(case: Case) -> Iterator[Suspicion]:
    """Trials that begin before the one before is over, or of which some say no start."""
    trials = case.bench.recording.trials
    silent = [t.name for t in trials if t.start is None]
    if silent and len(silent) < len(trials):
        words = f"{_few(silent)} {'has' if len(silent) == 1 else 'have'} no start, and the other trials have one"
        yield Suspicion("missing start", words, f"start = ... (s since the first trial) in the [[trial]] of {_few(silent)}")
    timed = sorted((t.start, float(t.time[-1] - t.time[0]), t.name) for t in trials if t.start is not None)
    for (start, lasts, name), (then, _, other) in itertools.pairwise(timed):
        if start + lasts > then + ROUNDING:
            words = f"{other} begins at {then:g} s, before {name} is over (at {start + lasts:g} s)"
            yield Suspicion("overlapping trials", words, f"correct start of {other} or {name}, or their times: both are in seconds")
            return


def times(case: Case) -> Iterator[Suspicion]:
    """Milliseconds read as seconds, and the reverse."""
    inputs = [i for i in case.bench.inputs if len(i.time) > 1]
    step = float(np.median(np.concatenate([np.diff(i.time) for i in inputs])))
    total = sum(float(i.time[-1] - i.time[0]) for i in inputs)
    longest = max(float(i.time[-1] - i.time[0]) for i in inputs)
    if step > COARSE and longest > DAY_LONG:
        words = f"a reading every {step:.3g} s and a trial of {longest / 3600:.3g} hours"
        yield Suspicion("time unit", words, "divide the column time by 1000 if it is in ms: it is in seconds")
    elif total / len(inputs) < HASTY:
        words = f"a trial lasts {1e3 * total / len(inputs):.3g} ms, a reading every {1e3 * step:.3g} ms"
        yield Suspicion("time unit", words, "multiply the column time by 1000 if it is in thousands of seconds: it is in seconds")


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
