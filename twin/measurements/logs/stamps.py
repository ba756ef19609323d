"""The rows of a take on one time line: each stream's stamps in seconds, in order, then all streams on the union of their stamps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.map.map_file import StreamClock
from twin.measurements.logs.streams import Clock, Stream
from twin.measurements.parsing.plausible import MIN_TIME_STEP


@dataclass(frozen=True, eq=False)
class Readings:
    """Rows on a time line."""

    stamps: np.ndarray  # (n,) s since the take's origin
    columns: Mapping[str, np.ndarray]  # channel -> (n,) as in the log; NaN where a row has no reading

    def rows(self, chosen: np.ndarray) -> Readings:
        """Return these rows only."""
        return Readings(self.stamps[chosen], {name: values[chosen] for name, values in self.columns.items()})


def clock_of(stream: Stream, mapped: StreamClock) -> tuple[Clock, str]:
    """Return the clock that a map names for a stream, and its unit.

    Raises DataError for one that the stream does not have, or whose unit or rate is missing.
    """
    clock = stream.clock(mapped.clock)
    if clock is None:
        known = [*stream.clocks, *(name for name, each in stream.fields.items() if not each.labels)][:20]
        raise DataError(f"{stream.name} has no clock {short_repr(mapped.clock)}; allowed: row, {', '.join(known)}")
    if mapped.rate is not None:
        return Clock(clock.ticks.astype(float) / mapped.rate, "s"), "s"
    unit = mapped.unit or clock.unit  # the user's word stands against the header's
    if not unit:
        raise DataError(
            f'clock {mapped.clock} of {stream.name}: give time_unit (s, ms, us, ns), or rate = "100 Hz" if it counts rows'
        )
    return clock, unit


def stamp_streams(streams: Mapping[str, Stream], clocks: Mapping[str, StreamClock]) -> tuple[int, dict[str, np.ndarray]]:
    """Return the origin of a take, ns, and the stamps of its streams, s since then, with their offsets.

    Raises DataError as `clock_of`, for a stream without stamps, and for streams that share no time.
    """
    found = {name: clock_of(stream, clocks[name]) for name, stream in streams.items()}
    for name, (clock, _) in found.items():
        if not np.any(np.isfinite(clock.ticks)):
            raise DataError(f"{name}: no stamp on its clock {clocks[name].clock}; name another")
    firsts = {name: clock.first_ns(unit) + round(clocks[name].offset * 1e9) for name, (clock, unit) in found.items()}
    origin = min(firsts.values())
    stamps = {name: clock.seconds(unit, origin - round(clocks[name].offset * 1e9)) for name, (clock, unit) in found.items()}
    _check_overlap(stamps)
    return origin, stamps


def _check_overlap(stamps: Mapping[str, np.ndarray]) -> None:
    spans = {name: (float(np.nanmin(each)), float(np.nanmax(each))) for name, each in stamps.items()}
    for one, (first, last) in spans.items():
        for other, (begin, end) in spans.items():
            if one < other and (begin > last or first > end) and len(stamps[one]) > 1 and len(stamps[other]) > 1:
                apart = max(begin - last, first - end)
                raise DataError(
                    f"{one} and {other} share no time, they are {apart:.6g} s apart: different clocks; name another "
                    "clock of one of them, or give its offset"
                )


def in_order(name: str, readings: Readings, mapped: StreamClock, notes: list[str]) -> list[Readings]:
    """Return a stream's rows with stamps that strictly increase; several pieces where it is cut at backward stamps.

    Raises DataError for equal and backward stamps, unless the map says what is to be done.
    """
    stated = np.isfinite(readings.stamps)
    if not np.all(stated):
        notes.append(f"{name}: {np.count_nonzero(~stated)} rows without a stamp are left out")
        readings = readings.rows(stated)
    back = np.flatnonzero(np.diff(readings.stamps) < 0)
    pieces = [readings]
    if len(back):
        if mapped.backward == "refuse":
            at = int(back[0])
            step = float(readings.stamps[at + 1] - readings.stamps[at])
            raise DataError(
                f"{name}: stamps go back {len(back)} times, first by {-step:.6g} s in row {at + 2}; name another clock, or write "
                'backward_stamps = "sort" (late messages) or "cut" (a clock that was reset)'
            )
        if mapped.backward == "sort":
            pieces = [readings.rows(np.argsort(readings.stamps, kind="stable"))]
            notes.append(f"{name}: {len(back)} backward stamps, rows sorted as the map says")
        else:
            pieces = [readings.rows(part) for part in np.split(np.arange(len(readings.stamps)), back + 1)]
            notes.append(f"{name}: {len(back)} backward stamps, a trial ends at each as the map says")
    return [_without_equal(name, piece, mapped, notes) for piece in pieces]


def _without_equal(name: str, readings: Readings, mapped: StreamClock, notes: list[str]) -> Readings:
    """Return rows whose stamps differ. Those that complement each other are one row; others are treated as the map says."""
    stamps, group, counts = np.unique(readings.stamps, return_inverse=True, return_counts=True)
    if len(stamps) == len(readings.stamps):
        return readings
    columns, clash = {}, 0
    for channel, values in readings.columns.items():
        has = ~np.isnan(values)
        number = np.bincount(group[has], minlength=len(stamps))
        clash = max(clash, int(np.count_nonzero(number > 1)))
        column = np.full(len(stamps), np.nan)
        if mapped.equal == "mean":
            np.divide(np.bincount(group[has], values[has], len(stamps)), number, out=column, where=number > 0)
        else:
            column[group[has][::-1]] = values[has][::-1]
        columns[channel] = column
    if clash and mapped.equal == "refuse":
        at = int(np.flatnonzero(counts > 1)[0])
        raise DataError(
            f"{name}: {int(np.count_nonzero(counts > 1))} stamps stand on several rows, the first at {stamps[at]:.6g} s; "
            'name another clock, or write equal_stamps = "mean" or "first"'
        )
    did = {"mean": "averaged", "first": "their first kept"}.get(mapped.equal, "joined")
    notes.append(f"{name}: rows with equal stamps are {did} ({len(readings.stamps) - len(stamps)} rows fewer)")
    return Readings(stamps, columns)


def on_one_line(streams: Sequence[Readings], notes: list[str]) -> Readings:
    """Return all streams on the union of their stamps, empty where a channel has no reading.

    Stamps of different streams closer than `MIN_TIME_STEP` count as one. Raises DataError for steps as short within a stream.
    """
    for each in streams:
        steps = np.diff(each.stamps)
        if len(steps) and steps.min() < MIN_TIME_STEP:
            name = next(iter(each.columns), "a stream")
            raise DataError(f"steps down to {steps.min():.3g} s between readings of {name}: is its time_unit right?")
    if len(streams) == 1:
        return streams[0]
    union = np.unique(np.concatenate([each.stamps for each in streams]))
    begins = np.concatenate([[True], np.diff(union) >= MIN_TIME_STEP])
    moved = int(np.count_nonzero(~begins))
    if moved:
        notes.append(f"{moved} stamps that are less than {MIN_TIME_STEP:g} s after another stream's count as that one")
    kept = union[begins]
    columns = {}
    for each in streams:
        at = np.searchsorted(kept, each.stamps, side="right") - 1
        if len(np.unique(at)) < len(at):
            raise DataError("rows too close together for one time line; is a time_unit right?")
        for name, values in each.columns.items():
            columns[name] = np.full(len(kept), np.nan)
            columns[name][at] = values
    return Readings(kept, columns)


def without_infinities(readings: Readings, notes: list[str]) -> Readings:
    """Return rows whose infinite readings are missing."""
    columns = dict(readings.columns)
    for name, values in columns.items():
        if infinite := int(np.count_nonzero(np.isinf(values))):
            notes.append(f"{infinite} infinite readings of {name} are left empty")
            columns[name] = np.where(np.isinf(values), np.nan, values)
    return replace(readings, columns=columns)
