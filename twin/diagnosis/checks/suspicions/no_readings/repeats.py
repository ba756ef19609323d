"""What is no reading: zeros of a lost marker, a fill far from its neighbours, a value that repeats while the robot moves."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.checks.suspicions.no_readings.series import Series, headline, of_drives, of_outputs, where
from twin.diagnosis.thresholds import (
    CHANCE_OF_REPEATS,
    LEFT_BY_PATTERN,
    SHARED_MOTION_SHARE,
    SPIKE_SIZE,
    SPIKE_WINDOW,
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
        typical = _typical(trials)

        def away(s: Series, a: int, b: int, typical: float = typical) -> bool:
            return not s.at_zero[a] and all(_apart(v, a, b) > SPIKE_SIZE * typical for v in (s.read, s.left))

        yield from _filled(case, name, trials, away)
    if case.predicted is not None:
        seen = headline(case)
        for name, trials in of_drives(case).items():
            yield from _filled(
                case, name, trials, lambda s, a, b: _apart(s.read, a, b) > 0.0 and not _followed(seen[s.trial], a, b)
            )


def _filled(case: Case, name: str, trials: Sequence[Series], away: Callable[[Series, int, int], bool]) -> Iterator[Suspicion]:
    """Yield the values of which every run between two readings is `away` from these."""
    at: dict[tuple[float, ...], list[tuple[Series, int, int]]] = defaultdict(list)
    for s in trials:
        for a, b in s.runs():
            at[tuple(s.read[a])].append((s, a, b))
    for runs in at.values():
        inner = [(s, a, b) for s, a, b in runs if a > 0 and b < len(s.time)]
        if sum(b - a for _, a, b in runs) < 2 or not inner or not all(away(*run) for run in inner):
            continue
        rows: Rows = defaultdict(list)
        for s, a, b in runs:
            rows[s.trial] += range(a, b)
        s, a, _ = runs[0]
        value, one = [float(f"{v:.12g}") for v in s.written[a]], len(s.channels) == 1
        words = (
            f"{name}: exactly {', '.join(f'{v:g}' for v in value)} in {where(case, rows)}, far from the readings around: no reading"
        )
        key = f"missing = {value[0]:g} in its [[channel]]" if one else f"missing = {value} at the top of measurements.toml"
        yield Suspicion("filled cells", words, f"leave these cells empty, or write {key}")


def _typical(trials: Sequence[Series]) -> float:
    """Return how far the error of a reading usually is from the line between its neighbours."""
    off = np.concatenate([np.linalg.norm(np.diff(s.left, n=2, axis=0), axis=1) / np.sqrt(6.0) for s in trials])
    off = off[np.isfinite(off)]
    return max(trials[0].noise, float(np.median(off)) if off.size else 0.0)


def _neighbours(values: np.ndarray, a: int, b: int) -> tuple[np.ndarray, np.ndarray] | None:
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    before, after = known[known < a], known[known >= b]
    return (values[before[-1]], values[after[0]]) if before.size and after.size else None


def _apart(values: np.ndarray, a: int, b: int) -> float:
    """Return how far rows a to b of values (n, d) are from the rows beside them, at least; 0 where these are as far apart."""
    beside = _neighbours(values, a, b)
    if beside is None:
        return 0.0
    least = min(float(np.linalg.norm(values[a:b] - v, axis=1).min()) for v in beside)
    return least if least > float(np.linalg.norm(beside[1] - beside[0])) else 0.0


def _followed(seen: Seen, a: int, b: int) -> bool:
    """Return whether the outputs went, by part of the way and soon, where the robot as described goes with rows a to b of a drive.

    True where it hardly goes anywhere.
    """
    read, shown, noise = seen
    way = shown[a:b].mean(axis=0) - 0.5 * (shown[a - 1] + shown[b])
    if np.linalg.norm(way / noise) <= UNMISSABLE_MOTION * np.sqrt(len(way)):
        return True
    then = (read[a : 2 * b - a + SPIKE_WINDOW] - read[a - 1]) / noise
    known = np.isfinite(then)
    along = (np.where(known, then, 0.0) * (way / noise)).sum(axis=1)
    size = (known * (way / noise) ** 2).sum(axis=1)
    return not size.any() or bool(np.any(along > SHARED_MOTION_SHARE * size))


def stuck(case: Case) -> Iterator[Suspicion]:
    """Yield channels that repeat a value to the last digit, where chance does not, while the robot moves, and then catch up."""
    if case.predicted is None:
        return
    seen = headline(case)
    for name, trials in {**of_outputs(case), **of_drives(case)}.items():
        rows: Rows = defaultdict(list)
        long = _improbable(trials)
        for s in trials:
            for a, b in s.runs():
                if b - a >= long and (_driven(seen[s.trial], a, b) if s.drives else _held(s, a, b)):
                    rows[s.trial] += range(a, b)
        if rows:
            words = f"{name}: one value, to the last digit, over {where(case, rows)}, while the robot moves"
            yield Suspicion("stuck value", words, f"leave the cells of {name} empty where it repeats")


def _improbable(trials: Sequence[Series]) -> int:
    """Return the length from which on a run of equal readings is no chance, by how often two readings in a row are equal.

    Every run of more than two counts once, so that a channel that is stuck for long does not make that usual.
    """
    lengths = [b - a for s in trials for a, b in s.runs()]
    steps = sum(lengths)
    equal = (1 + sum(min(n - 1, 1) for n in lengths)) / max(len(lengths), 2)
    return 2 if equal <= 0.0 else 1 + int(np.ceil(np.log(CHANCE_OF_REPEATS / max(steps, 1)) / np.log(min(equal, 1.0 - 1e-9))))


def _held(s: Series, a: int, b: int) -> bool:
    """Return whether an output stays behind the robot as described over rows a to b and catches up after them."""
    left = s.left
    behind = left[b - 1] - left[a]
    if not np.linalg.norm(behind) > UNMISSABLE_MOTION * s.noise:
        return False
    after = b + np.flatnonzero(np.isfinite(left[b:]).all(axis=1))
    return not after.size or bool(np.linalg.norm(left[after[0]] - left[a]) < LEFT_BY_PATTERN * np.linalg.norm(behind))


def _driven(seen: Seen, a: int, b: int) -> bool:
    """Return whether the robot moved over rows a to b of a drive by what the robot as described makes up after them."""
    read, shown, noise = seen
    if b >= len(read):
        return False
    jump, moved = (shown[b] - shown[b - 1]) / noise, (read[b - 1] - read[a]) / noise
    known = np.isfinite(moved)
    if not np.linalg.norm(jump[known]) > UNMISSABLE_MOTION * np.sqrt(max(1, known.sum())):
        return False
    return bool(moved[known] @ jump[known] > LEFT_BY_PATTERN * jump[known] @ jump[known])
