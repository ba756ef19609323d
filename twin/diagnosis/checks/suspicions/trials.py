"""Trials: the same one twice, one of another robot, clocks that overlap, times that are not seconds."""

import itertools
from collections.abc import Iterator

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.thresholds import (
    CLEAR_CHI_SQUARE,
    COPIED_TRIAL_DIFFERENCE,
    LONGEST_SAMPLE_INTERVAL,
    LONGEST_SESSION,
    LONGEST_TRIAL,
    MARKER_SPACING_CHANGE,
    MARKER_SPACING_ERROR,
    SHORTEST_TRIAL,
    START_TIME_ROUNDING,
)


def duplicates(case: Case) -> Iterator[Suspicion]:
    """Two trials whose readings agree to far less than their own noise: one export under two names, not a repeat."""
    for a, b in itertools.combinations(case.trials, 2):
        y, z = case.prepared.measured[a], case.prepared.measured[b]
        if y.shape != z.shape:
            continue
        apart, noise = np.abs(y - z), _noise(y)
        known = np.isfinite(apart).any(axis=0) & np.isfinite(noise)
        if not known.any():
            continue
        off = np.nanmean(apart[:, known], axis=0)  # not the median: of a coarse reading half the rows may agree
        if np.all(off <= COPIED_TRIAL_DIFFERENCE * noise[known]):
            one, other = (case.prepared.inputs[k].name for k in (a, b))
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
    ratio = {k: _spacing(case.prepared.measured[k], case.predicted[k], columns) for k in case.trials}
    ratio = {k: r for k, r in ratio.items() if np.isfinite(r[0])}
    if not ratio:
        return
    usual = float(np.median([r for r, _ in ratio.values()]))
    if abs(usual - 1.0) > MARKER_SPACING_ERROR and 1.0 / 3.0 < usual < 3.0:
        words = f"the markers {names[0]} to {names[-1]} lie {100 * abs(usual - 1):.0f} % {_way(usual)} than robot.toml has them"
        yield Suspicion("another robot", words, "name the robot that was measured, or correct its lengths in robot.toml")
    for k, (r, error) in ratio.items():
        if abs(r / usual - 1.0) > max(MARKER_SPACING_CHANGE, np.sqrt(CLEAR_CHI_SQUARE) * error / usual):
            name = case.prepared.inputs[k].name
            words = f"in {name} the markers lie {100 * abs(r / usual - 1):.0f} % {_way(r / usual)} than in the other trials"
            yield Suspicion("trial of another robot", words, f"remove the [[trial]] {name}: a set is of one robot in one unit")


def _spacing(y: np.ndarray, p: np.ndarray, columns: np.ndarray) -> tuple[float, float]:
    """Median of measured over predicted distances from each marker to the next, and its standard error: 1.25 of that of the mean of
    normal ones, whose deviation is 1.48 of their median one."""
    measured, shown = (np.linalg.norm(np.diff(v[:, columns], axis=1), axis=2) for v in (y, p))
    found = (measured / np.maximum(shown, 1e-12))[np.isfinite(measured)]
    if not found.size:
        return float("nan"), float("nan")
    middle = float(np.median(found))
    return middle, 1.25 * 1.48 * float(np.median(np.abs(found - middle))) / np.sqrt(found.size)


def _way(ratio: float) -> str:
    return "further apart" if ratio > 1.0 else "closer together"


def clocks(case: Case) -> Iterator[Suspicion]:
    """Trials that begin before the one before is over, or of which some say no start."""
    trials = case.prepared.recording.trials
    silent = [t.name for t in trials if t.start is None]
    if silent and len(silent) < len(trials):
        words = f"{_few(silent)} {'has' if len(silent) == 1 else 'have'} no start, and the other trials have one"
        yield Suspicion("missing start", words, f"start = ... (s since the first trial) in the [[trial]] of {_few(silent)}")
    for (start, lasts, name), (then, _, other) in _overlaps(case):
        words = f"{other} begins at {then:g} s, before {name} is over (at {start + lasts:g} s)"
        yield Suspicion("overlapping trials", words, f"correct start of {other} or {name}, or their times: both are in seconds")
        return


Timed = tuple[float, float, str]  # start (s), how long (s), name


def _overlaps(case: Case) -> list[tuple[Timed, Timed]]:
    """Trials that begin before the one before is over."""
    trials = case.prepared.recording.trials
    timed = sorted((t.start, float(t.time[-1] - t.time[0]), t.name) for t in trials if t.start is not None)
    return [(a, b) for a, b in itertools.pairwise(timed) if a[0] + a[1] > b[0] + START_TIME_ROUNDING]


def _slow(case: Case) -> bool:
    """Whether a clock beside the trials' own says that they are slow: every trial has a start, none before the one before is over,
    and all is done within `LONGEST_SESSION`."""
    starts = [t.start for t in case.prepared.recording.trials]
    timed = [s for s in starts if s is not None]
    return len(timed) == len(starts) > 1 and not _overlaps(case) and max(timed) - min(timed) < LONGEST_SESSION


def times(case: Case) -> Iterator[Suspicion]:
    """Milliseconds read as seconds, and the reverse."""
    inputs = [i for i in case.prepared.inputs if len(i.time) > 1]
    step = float(np.median(np.concatenate([np.diff(i.time) for i in inputs])))
    total = sum(float(i.time[-1] - i.time[0]) for i in inputs)
    longest = max(float(i.time[-1] - i.time[0]) for i in inputs)
    if step > LONGEST_SAMPLE_INTERVAL and longest > LONGEST_TRIAL and not _slow(case):
        words = f"a reading every {step:.3g} s and a trial of {longest / 3600:.3g} hours"
        yield Suspicion("time unit", words, "divide the column time by 1000 if it is in ms: it is in seconds")
    elif total / len(inputs) < SHORTEST_TRIAL:
        words = f"a trial lasts {1e3 * total / len(inputs):.3g} ms, a reading every {1e3 * step:.3g} ms"
        yield Suspicion("time unit", words, "multiply the column time by 1000 if it is in thousands of seconds: it is in seconds")


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
