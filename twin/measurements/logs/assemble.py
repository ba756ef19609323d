"""A log and its map as a recording, ready to be written as a measurement set. Nothing is moved or left out without a note."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import MAX_SET_NUMBERS, prefix_errors
from twin.measurements.logs.bags.topics import HEADER_CLOCK, LOG_CLOCK, OWN_CLOCK
from twin.measurements.logs.clocks import EPOCH_SECONDS, header_skew
from twin.measurements.logs.cut import LEAST_ROWS, cut_at_gaps, cut_at_marks, cut_into_lengths, marks_of
from twin.measurements.logs.map.map_file import ImportMap, StreamClock
from twin.measurements.logs.stamps import Readings, in_order, on_one_line, stamp_streams, without_infinities
from twin.measurements.logs.streams import Log, Stream, Take
from twin.measurements.parsing.plausible import check_roles, check_table, check_trials
from twin.measurements.parsing.tables import Table
from twin.measurements.recording import Recording, Trial

MAX_NAME = 80  # characters of a trial's name


@dataclass(frozen=True, eq=False)
class Piece:
    """One trial to be: its name, when it began, and its rows in the units of the log."""

    name: str
    began: int | None  # ns on the take's clock; None if that is reset between takes
    readings: Readings


def assemble(log: Log, import_map: ImportMap) -> tuple[Recording, tuple[str, ...]]:
    """Return the recording that a map makes of a log, and what is to be said.

    Raises DataError for a stream, field or clock that the log does not have, for stamps that the map does not say what to do with,
    and for numbers that the set's contract does not allow.
    """
    notes: list[str] = []
    channels = tuple(each.channel for each in import_map.channels)
    with prefix_errors(import_map.path):
        check_roles(channels)
        _check_names(log, import_map)
        pieces: list[Piece] = []
        of_take: dict[str, list[str]] = {}
        for take in log.takes:
            if missing := _used(import_map) - set(take.streams):
                notes.append(f"{take.name} is left out: it has no {', '.join(sorted(missing))}")
                continue
            said: list[str] = []
            with prefix_errors(take.name):
                pieces += _pieces(take, import_map, said, absolute=len(log.takes) == 1)
            of_take[take.name] = said
        notes += _told(of_take)
        pieces = _long_enough(pieces, notes)
        if not pieces:
            raise DataError(f"no trial is left ({short_repr('; '.join(notes[-3:]), 300)}); correct the map")
        if sum(piece.readings.stamps.size for piece in pieces) * (1 + len(channels)) > MAX_SET_NUMBERS:
            raise DataError(
                f"more than {MAX_SET_NUMBERS} numbers in all; choose fewer channels, or cut and import the log in parts"
            )
        trials = _trials(pieces, import_map)
        check_trials(channels, trials, (), least_trials=1)
    notes.append("time of each trial counts from its first row, in s")
    head = (import_map.robot, import_map.title or log.path.name, import_map.source, import_map.gravity)
    return Recording(*head, channels, tuple(trials)), tuple(dict.fromkeys(notes))


def _told(of_take: Mapping[str, list[str]]) -> list[str]:
    """Return what was said of takes: once where it is the same of all, else with the take's name."""
    texts = list(of_take.values())
    of_all = [note for note in texts[0] if all(note in others for others in texts)] if texts else []
    return of_all + [f"{name}: {note}" for name, notes in of_take.items() for note in notes if note not in of_all]


def _used(import_map: ImportMap) -> set[str]:
    marks = {import_map.cut.stream} if import_map.cut is not None and import_map.cut.stream else set()
    return {each.stream for each in import_map.channels} | marks


def _check_names(log: Log, import_map: ImportMap) -> None:
    streams = log.streams
    for name in _used(import_map):
        if name not in streams:
            raise DataError(f"the log has no stream {short_repr(name)}; it has {', '.join(list(streams)[:20])}")
        if name not in import_map.clocks:
            raise DataError(f"stream = [...] says nothing of {name}; add a line with its clock")
    for each in import_map.channels:
        fields = {name: field for stream in streams[each.stream] for name, field in stream.fields.items()}
        if each.field not in fields:
            raise DataError(f"{each.stream} has no field {short_repr(each.field)}; it has {', '.join(list(fields)[:20])}")
        if fields[each.field].labels:
            raise DataError(f"{each.field} of {each.stream} holds texts; it can mark trials (cut), but be no channel")


def _pieces(take: Take, import_map: ImportMap, notes: list[str], absolute: bool) -> list[Piece]:
    used = {name: take.streams[name] for name in sorted(_used(import_map))}
    origin, stamps = stamp_streams(used, import_map.clocks)
    notes += _mixed_clocks(used, import_map)
    of_stream = {name: _readings(stream, stamps[name], import_map) for name, stream in used.items()}
    ordered = {name: in_order(name, each, import_map.clocks[name], notes) for name, each in of_stream.items() if each.columns}
    reset = any(len(parts) > 1 for parts in ordered.values())
    if reset and len(ordered) > 1:
        raise DataError('backward_stamps = "cut" is for a single stream; sort the stamps, or name another clock')
    lines = [[part] for part in next(iter(ordered.values()))] if reset else [[parts[0] for parts in ordered.values()]]
    known = not reset and (absolute or origin > EPOCH_SECONDS * 1e9)
    pieces = []
    for number, streams in enumerate(lines, start=1):
        merged = without_infinities(on_one_line(streams, notes), notes)
        base = f"{take.name}_{number}" if reset else take.name
        parts = _cut(merged, used, stamps, import_map, notes)
        for n, (label, rows) in enumerate(parts, start=1):
            name = base if len(parts) == 1 and not label else f"{base}_{label or n}"
            began = origin + round(float(merged.stamps[rows[0]]) * 1e9) if len(rows) and known else None
            pieces.append(Piece(name, began, merged.rows(rows)))
    return pieces


def _mixed_clocks(used: Mapping[str, Stream], import_map: ImportMap) -> list[str]:
    """Return what is to be said of rows stamped when they were measured beside rows stamped when they were recorded."""
    by = {name: import_map.clocks[name] for name in used}
    late = [name for name, clock in by.items() if clock.clock == LOG_CLOCK and not clock.offset]
    delays = [float(np.median(header_skew(used[name]))) for name, clock in by.items() if clock.clock in (HEADER_CLOCK, OWN_CLOCK)]
    if not late or not delays:
        return []
    usual = 1e3 * float(np.median(delays))
    return [
        f"{', '.join(late)}: stamped by the recorder, the other streams by their headers, which it received {usual:.3g} ms later; "
        "an offset in the map shifts a stream"
    ]


def _readings(stream: Stream, stamps: np.ndarray, import_map: ImportMap) -> Readings:
    """Return a stream's channels; rows of a bag in which none of them has a reading are messages about something else."""
    empty = np.full(stream.count, np.nan)
    columns = {
        each.channel.name: stream.fields[each.field].values.astype(float) if each.field in stream.fields else empty
        for each in import_map.channels
        if each.stream == stream.name
    }
    readings = Readings(stamps, columns)
    readings = Readings(stamps, columns)
    if LOG_CLOCK in stream.clocks and columns:
        return readings.rows(np.any([~np.isnan(values) for values in columns.values()], axis=0))
    return readings


def _cut(
    merged: Readings, used: Mapping[str, Stream], stamps: Mapping[str, np.ndarray], import_map: ImportMap, notes: list[str]
) -> list[tuple[str, np.ndarray]]:
    cut = import_map.cut
    if cut is None:
        return [("", np.arange(len(merged.stamps)))]
    if import_map.gap is not None:
        return cut_at_gaps(merged.stamps, import_map.gap)
    if import_map.every is not None:
        return cut_into_lengths(merged.stamps, import_map.every)
    assert cut.stream is not None
    return cut_at_marks(merged.stamps, marks_of(used[cut.stream], stamps[cut.stream], cut), notes)


def _long_enough(pieces: list[Piece], notes: list[str]) -> list[Piece]:
    long = [piece for piece in pieces if len(piece.readings.stamps) >= LEAST_ROWS]
    if len(long) < len(pieces):
        notes.append(f"{len(pieces) - len(long)} pieces of fewer than {LEAST_ROWS} rows are left out")
    return long


def _trials(pieces: list[Piece], import_map: ImportMap) -> list[Trial]:
    channels = [each.channel for each in import_map.channels]
    began = [piece.began for piece in pieces if piece.began is not None]
    first = min(began) if len(began) == len(pieces) else None
    names: list[str] = []
    trials = []
    for piece in pieces:
        name = plain = re.sub(r"[^\w.-]+", "_", piece.name).strip("._")[:MAX_NAME] or "trial"
        again = 1
        while name in names:
            again += 1
            name = f"{plain}_{again}"
        names.append(name)
        time = np.round(piece.readings.stamps - piece.readings.stamps[0], 12)  # 0.3, not 0.30000000000000004
        columns = {"time": time, **piece.readings.columns}
        check_table(Table(Path(f"{name}.csv"), columns, (), first_row=2), channels)
        values = {channel.name: channel.scale.to_si(columns[channel.name]) for channel in channels}
        start = None if first is None or piece.began is None else (piece.began - first) / 1e9
        trials.append(Trial(f"{name}.csv", time, values, start=start))
    return trials


def clock_words(import_map: ImportMap) -> list[str]:
    """Return for each stream by which clock its rows are stamped, in words."""
    return [f"{name}: {_words(clock)}" for name, clock in import_map.clocks.items()]


def _words(clock: StreamClock) -> str:
    words = f"stamped by {clock.clock}"
    words += f" at {clock.rate:g} a second" if clock.rate is not None else ""
    return words + (f", moved by {clock.offset:g} s" if clock.offset else "")
