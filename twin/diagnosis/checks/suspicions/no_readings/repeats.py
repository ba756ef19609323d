"""What is no reading: zeros of a lost marker, a fill far from its neighbours, a value that repeats while the robot moves."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.checks.suspicions.channels import white
from twin.diagnosis.checks.suspicions.no_readings.drives import no_readings
from twin.diagnosis.checks.suspicions.no_readings.series import Series, headline, of_drives, of_outputs, where
from twin.diagnosis.thresholds import (
    CHANCE_OF_REPEATS,
    LEFT_BY_PATTERN,
    SPIKE_SIZE,
    UNMISSABLE_MOTION,
)

Rows = dict[int, list[int]]  # trial -> its rows
Seen = tuple[np.ndarray, np.ndarray, np.ndarray]  # as `headline` has a trial


def lost_markers(case: Case) -> Iterator[Suspicion]:
    """Yield markers at exactly 0, 0, 0 in some rows and elsewhere in most.

    Trackers write zeros for a marker that they have lost.
    """
    found = []
    for name, trials in of_outputs(case).items():
        known = sum(int(np.isfinite(s.read).all(axis=1).sum()) for s in trials)
        rows = {s.trial: np.flatnonzero(s.at_zero).tolist() for s in trials if s.at_zero.any()}
        if 0 < sum(map(len, rows.values())) < 0.5 * known:
            found.append(f"{name} in {where(case, rows)}")
    if found:
        words = f"{'; '.join(found)}: exactly 0, 0, 0, and elsewhere in all others: trackers write this for a lost marker"
        change = "leave these cells empty in the trials' files, or write missing = [0, 0, 0] at the top of measurements.toml"
        yield Suspicion("lost markers", words, change)


def fills(case: Case) -> Iterator[Suspicion]:
    """Yield a value that stands, in several rows, far from the readings before and after, where the robot does not go."""
    for name, trials in of_outputs(case).items():
        far = SPIKE_SIZE * _typical(trials)
        away = [
            (s, r)
            for s in trials
            for r in np.flatnonzero(s.apart > far).tolist()
            if not s.at_zero[s.runs[r, 0]] and _left_by(s, r) > far
        ]
        yield from _filled(case, name, trials, away)
    for drive, (name, trials) in enumerate(of_drives(case).items()):
        yield from _filled(case, name, trials, [(s, r) for s in trials for r in _sent_away(case, drive, s, trials)])


def _sent_away(case: Case, drive: int, s: Series, trials: Sequence[Series]) -> list[int]:
    """Return the runs of a drive's trial at a value that stands in several rows, off its course, to which the robot does not go."""
    whole = np.concatenate([t.read[:, 0] for t in trials])
    often = [v for v, n in zip(*np.unique(whole[np.isfinite(whole)], return_counts=True), strict=True) if n > 2]
    value = s.read[s.runs[:, 0], 0]
    if case.predicted is None:
        away = [(r, whole[np.isfinite(whole) & (whole != value[r])]) for r in np.flatnonzero(np.isin(value, often))]
        return [int(r) for r, others in away if 0.0 < float(np.ptp(others)) < s.apart[r]]
    far = np.flatnonzero((s.off_course > SPIKE_SIZE * _typical([s])) & np.isin(value, often))
    found = []
    for of_value in [far[value[far] == v] for v in np.unique(value[far])]:
        none = no_readings(case, drive, s.trial, [(int(a), int(b)) for a, b in s.runs[of_value]])
        found += [int(r) for r in of_value if tuple(s.runs[r]) in none]
    kept: list[int] = []
    for r in sorted(found, key=lambda r: np.ptp(s.runs[r])):  # what a command went away from, and came back to, is a reading
        if not {r - 1, r + 1} & set(kept):
            kept.append(r)
    return kept


def _left_by(s: Series, run: int) -> float:
    """Return how far the error of a run is from that of the runs beside it, at least; 0 where these are as far apart."""
    (a, b), before, after = s.runs[run], s.left[s.runs[run - 1, 1] - 1], s.left[s.runs[run + 1, 0]]
    least = min(float(np.linalg.norm(s.left[a:b] - v, axis=1).min()) for v in (before, after))
    return least if least > float(np.linalg.norm(after - before)) else 0.0


def _scatters(trials: Sequence[Series]) -> bool:
    """Return whether a drive is read with noise, by more than its last digit; a command is not, and repeats wherever it is held."""
    steps = np.abs(np.concatenate([np.diff(s.read[:, 0]) for s in trials]))
    return white([s.read[:, 0] for s in trials]) > np.min(steps[steps > 0.0], initial=np.inf)


def _filled(case: Case, name: str, trials: Sequence[Series], away: Sequence[tuple[Series, int]]) -> Iterator[Suspicion]:
    """Yield the values that stand in several rows of those runs of a channel."""
    at: dict[tuple[float, ...], Rows] = defaultdict(lambda: defaultdict(list))
    for s, run in away:
        a, b = s.runs[run]
        at[tuple(s.read[a])][s.trial] += range(a, b)
    for value, rows in at.items():
        n = sum(map(len, rows.values()))
        if n < 2:
            continue
        s = next(s for s in trials if s.trial in rows)
        written = [float(f"{v:.12g}") for v in s.written[min(rows[s.trial])]]
        words = f"exactly {', '.join(f'{v:g}' for v in written)} in {where(case, rows)}, far from the readings around"
        key = (
            f"missing = {written[0]:g} in its [[channel]]"
            if len(written) == 1
            else f"missing = {written} at the top of measurements.toml"
        )
        elsewhere = sum(int((s.read == value).all(axis=1).sum()) for s in trials) - n
        yield Suspicion(
            "filled cells", f"{name}: {words}", "leave these cells empty" + (f", or write {key}" if elsewhere < n else "")
        )


def _typical(trials: Sequence[Series]) -> float:
    """Return how far the error of a reading usually is from the line between its neighbours."""
    off = np.concatenate([np.linalg.norm(np.diff(s.left, n=2, axis=0), axis=1) / np.sqrt(6.0) for s in trials])
    off = off[np.isfinite(off)]
    return max(trials[0].noise, float(np.median(off)) if off.size else 0.0)


def stuck(case: Case) -> Iterator[Suspicion]:
    """Yield channels that repeat a value to the last digit, where chance does not, while the robot moves, and then catch up."""
    if case.predicted is None:
        return
    drives = of_drives(case)
    for name, trials in (of_outputs(case) | drives).items():
        rows: Rows = defaultdict(list)
        command = trials[0].drives and not _scatters(trials)
        for s in trials:
            for a, b in s.runs[np.ptp(s.runs, axis=1) > 2].tolist():
                usual = not _goes_on(s, a, b) if command else _by_chance(b - a - 1, *_moving(trials, s, a, b)) >= CHANCE_OF_REPEATS
                if usual:
                    continue
                if no_readings(case, list(drives).index(name), s.trial, [(a + 1, b)]) if s.drives else _held(s, a, b):
                    rows[s.trial] += range(a, b)
        if rows:
            words = f"{name}: one value, to the last digit, over {where(case, rows)}, while the robot moves"
            yield Suspicion("stuck value", words, f"leave the cells of {name} empty where it repeats")


def frozen(case: Case) -> Iterator[Suspicion]:
    """Yield rows in which every channel repeats, where chance does not, and after which the robot is further on its way."""
    seen, every = headline(case), [*of_outputs(case).values(), *of_drives(case).values()]
    whole = [replace(of[0], read=np.concatenate([s.read for s in of], axis=1)) for of in zip(*every, strict=True)]
    equal, readings = _equal(whole), sum(len(s.time) for s in whole)
    noisy = bool(seen) and _scatter(seen) > LEFT_BY_PATTERN
    rows: Rows = defaultdict(list)
    for s in whole if seen else []:
        for a, b in s.runs[np.ptp(s.runs, axis=1) > 2]:
            if (
                a > 0
                and b + 1 < len(s.time)
                and _by_chance(b - a - 1, equal, readings) < CHANCE_OF_REPEATS
                and _skips(seen[s.trial], a, b, noisy)
            ):
                rows[s.trial] += range(a + 1, b)
    if rows:
        words = (
            f"all channels: {where(case, rows)} repeat the row before to the last digit, and then the robot is further on its way"
        )
        yield Suspicion("frozen rows", words, "remove these rows: the logger repeated the last readings that it had")


def _scatter(seen: Sequence[Seen]) -> float:
    """Return by how much readings usually scatter about a smooth error of the prediction, in their noise."""
    second = np.concatenate([np.diff((read - shown) / noise, n=2, axis=0) for read, shown, noise in seen])
    return float(np.sqrt(np.nanmedian(second**2) / 6.0))


def _skips(seen: Seen, a: int, b: int, noisy: bool) -> bool:
    """Return whether the outputs jump after rows a to b.

    Where readings do not scatter, a standing robot repeats its rows too: there further than, and the way, that it went beside them.
    """
    read, _, noise = seen
    before, jump, after = ((read[i] - read[i - 1]) / noise for i in (a, b, b + 1))
    known = np.isfinite(before + jump + after)
    size = float(jump[known] @ jump[known])
    beside = [float(way[known] @ jump[known]) for way in (before, after)]
    return size > UNMISSABLE_MOTION**2 * max(1, known.sum()) and (noisy or all(0.0 < along < size for along in beside))


def _equal(trials: Sequence[Series]) -> float:
    """Return how often a reading equals the one before."""
    readings, runs = (sum(f(s) for s in trials) for f in (lambda s: int(np.ptp(s.runs, axis=1).sum()), lambda s: len(s.runs)))
    return (1 + readings - runs) / max(readings, 2)


def _moving(trials: Sequence[Series], of: Series, a: int, b: int) -> tuple[float, int]:
    """Return how often a reading equals the one before where the robot as described moves as in rows a to b, and of how many rows.

    A robot at rest repeats its readings, to the last digit of a coarse encoder; that is no measure of chance while it moves. Rows
    count in which it goes further than the noise, or as fast as in rows a to b, which do not count themselves. Without a prediction
    every reading counts.
    """
    if not np.isfinite(of.shown[a:b]).all():
        return _equal(trials), sum(len(s.time) for s in trials)
    pace = min(of.noise, float(np.median(np.linalg.norm(np.diff(of.shown[a:b], axis=0), axis=1))))
    there = {s.trial: np.linalg.norm(np.diff(s.shown, axis=0), axis=1) >= pace for s in trials}
    there[of.trial][a : b - 1] = False
    readings = sum(int(t.sum()) for t in there.values())
    alike = sum(int((np.diff(s.read, axis=0)[there[s.trial]] == 0.0).all(axis=1).sum()) for s in trials)
    return (1 + alike) / max(readings, 2), readings


def _by_chance(repeats: int, equal: float, readings: int) -> float:
    """Return how many times so many readings that equal the one before are expected somewhere in so many readings."""
    return readings * min(equal, 1.0) ** repeats


def _goes_on(s: Series, a: int, b: int) -> bool:
    """Return whether a command, after it stood in rows a to b, jumps by what it would have gone in them, or goes on slower.

    A command that stands before or after them too is given in steps, and stands by design.
    """
    if b >= len(s.time):
        return False
    beside = [abs(float(s.read[i, 0] - s.read[i - 1, 0])) for i in (a, b + 1) if 0 < i < len(s.time)]
    slower = min(beside, default=0.0)
    return slower > 0.0 and abs(float(s.read[b, 0] - s.read[b - 1, 0])) > LEFT_BY_PATTERN * (b - a) * slower


def _held(s: Series, a: int, b: int) -> bool:
    """Return whether an output stays behind the robot as described over rows a to b and catches up after them."""
    left = s.left
    behind = left[b - 1] - left[a]
    if not np.linalg.norm(behind) > UNMISSABLE_MOTION * s.noise:
        return False
    after = b + np.flatnonzero(np.isfinite(left[b:]).all(axis=1))
    if not after.size:
        return True
    caught_up = left[b - 1] - left[after[0]]  # by more than it was behind where the description's own error grows meanwhile
    return bool(caught_up @ behind > LEFT_BY_PATTERN * (behind @ behind))
