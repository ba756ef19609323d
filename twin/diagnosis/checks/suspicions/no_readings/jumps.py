"""Jumps that no robot makes: two markers under each other's names for a while, a reading that rolls over."""

import itertools
from collections.abc import Iterator

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.checks.suspicions.no_readings.series import Series, of_drives, of_outputs, where
from twin.diagnosis.thresholds import COUNTER_BITS, LEFT_BY_FILE_CHANGE, UNMISSABLE_MOTION
from twin.measurements import Channel


def exchanged(case: Case) -> Iterator[Suspicion]:
    """Yield two markers that each follow the other's way in some rows, and jump there or back."""
    markers = {n: s for n, s in of_outputs(case).items() if len(s[0].channels) > 1}
    if case.predicted is None:
        return
    for (one, ones), (other, others) in itertools.combinations(markers.items(), 2):
        if len(ones[0].channels) != len(others[0].channels):
            continue
        rows: dict[int, list[int]] = {}
        for a, b in zip(ones, others, strict=True):
            found = _under_each_others_name(a, b)
            if found.any():
                rows[a.trial] = np.flatnonzero(found).tolist()
        if rows:
            words = f"{one} and {other} are each where the other should be in {where(case, rows)}, and not before or after"
            yield Suspicion("swapped labels", words, "exchange their cells in these rows, or leave them empty")


def _under_each_others_name(a: Series, b: Series) -> np.ndarray:
    """Return the rows (n,), fewer than half of a trial, in which a and b are exchanged; their usual errors are taken off first."""
    off = [s.read - s.shown for s in (a, b)]
    if not all(np.isfinite(o).all(axis=1).any() for o in off):
        return np.zeros(len(a.time), bool)
    way = [s.shown + np.nanmedian(o, axis=0) for s, o in zip((a, b), off, strict=True)]

    def error(x: Series, y: np.ndarray) -> np.ndarray:
        return np.linalg.norm(x.read - y, axis=1)

    own, other = np.hypot(error(a, way[0]), error(b, way[1])), np.hypot(error(a, way[1]), error(b, way[0]))
    with np.errstate(invalid="ignore"):
        at = (other < LEFT_BY_FILE_CHANGE * own) & (own > UNMISSABLE_MOTION * max(a.noise, b.noise))
    known = np.isfinite(own)
    if not 0 < at.sum() < 0.5 * known.sum():
        return np.zeros(len(a.time), bool)
    rows = np.flatnonzero(known)
    for part in np.split(rows, np.flatnonzero(np.diff(at[rows])) + 1):
        if at[part[0]]:
            before, after = rows[rows < part[0]][-1:], rows[rows > part[-1]][:1]
            at[part] = any(_jump(a, b, i, part[0]) for i in before) or any(_jump(a, b, part[-1], j) for j in after)
    return at


def _jump(a: Series, b: Series, i: int, j: int) -> bool:
    """Return whether from row i to row j each of a and b comes nearer to where the other was than to where it was itself."""
    return all(
        np.linalg.norm(x.read[j] - y.read[i]) < LEFT_BY_FILE_CHANGE * np.linalg.norm(x.read[j] - x.read[i])
        for x, y in ((a, b), (b, a))
    )


def rolled(case: Case) -> Iterator[Suspicion]:
    """Yield readings that jump by nearly a full turn, or counts by nearly a power of two, and go on as before."""
    for name, trials in {**of_outputs(case), **of_drives(case)}.items():
        channel = trials[0].channels[0]
        if len(trials[0].channels) > 1 or channel.axis is not None:
            continue  # a position in space, or an orientation, which is compared as one
        read = [s.written[:, 0] for s in trials]
        for span in _spans(channel, np.concatenate(read)):
            rows = {s.trial: at for s, y in zip(trials, read, strict=True) if (at := _roll_overs(y, span))}
            if rows:
                words = (
                    f"{name} jumps by nearly {span:g} {channel.unit} in {where(case, rows)}, and goes on as before: it rolls over"
                )
                yield Suspicion("roll-over", words, f"wraps = {span:.12g} in the [[channel]] of {name}")
                break


def _spans(channel: Channel, read: np.ndarray) -> list[float]:
    """Return the spans, as the column has it, at which readings may roll over that all lie within one of them."""
    read = read[np.isfinite(read)]
    spans = []
    if channel.si_unit == "rad":
        spans.append(abs(2.0 * np.pi * channel.scale.denominator / channel.scale.numerator))
    if np.allclose(read, np.round(read), rtol=0.0, atol=1e-6):  # counts
        spans += [2.0**n for n in range(*COUNTER_BITS)]
    width = float(np.ptp(read)) if read.size else 0.0
    return [s for s in spans if 0.5 * s < width <= s * (1.0 + 1e-9)]


def _roll_overs(read: np.ndarray, span: float) -> list[int]:
    """Return the rows after a jump by `span`, less what the reading moves in the rows beside it."""
    rows = np.flatnonzero(np.isfinite(read))
    step = np.abs(np.diff(read[rows]))
    if len(step) < 3:
        return []
    beside = np.maximum(np.append(step[1:], 0.0), np.insert(step[:-1], 0, 0.0))
    near = np.abs(span - step) <= 2.0 * np.where(beside < 0.5 * span, beside, 0.0) + np.median(step)
    return rows[1:][near & (step > 0.5 * span)].tolist()
