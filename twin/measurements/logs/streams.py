"""What a log holds: takes of streams of fields, each stream with the clocks that stamp its rows.

    Log  ->  Take, one run of the recorder  ->  Stream, one topic or table  ->  Field, one column of numbers

Nothing is converted here: numbers stay in the units of the log, and every clock that a row carries is kept until the map names one.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

TICKS_A_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
ROW_CLOCK = "row"  # the number of the row, from 0: for tables without a time
MAX_FIELDS = 4096  # fields of a stream


@dataclass(frozen=True, eq=False)
class Field:
    """One column of numbers. A column of texts holds their numbers in `labels` and can only mark trials."""

    values: np.ndarray  # (n,) float64 or int64; NaN where a row has none
    unit: str = ""  # as the log says; empty: it does not
    labels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Clock:
    """The stamps of a stream's rows on one clock. Whole ticks stay whole: nanoseconds since 1970 do not fit a float."""

    ticks: np.ndarray  # (n,) int64 or float64; NaN where a row has none
    unit: str = ""  # s, ms, us, ns; empty: the log does not say

    def first_ns(self, unit: str) -> int:
        """Return the earliest stamp in nanoseconds. Raises ValueError if there is none."""
        if np.issubdtype(self.ticks.dtype, np.integer):
            return int(self.ticks.min()) * (10**9 // TICKS_A_SECOND[unit])
        return round(float(self.ticks[np.isfinite(self.ticks)].min()) * 1e9 / TICKS_A_SECOND[unit])

    def seconds(self, unit: str, origin: int) -> np.ndarray:
        """Return (n,) s since `origin`, which counts in nanoseconds."""
        a_second = TICKS_A_SECOND[unit]
        if np.issubdtype(self.ticks.dtype, np.integer):
            whole, rest = divmod(origin, 10**9 // a_second)
            return (self.ticks - whole) / a_second - rest / 1e9
        return self.ticks / a_second - origin / 1e9


@dataclass(frozen=True, eq=False)
class Stream:
    """Rows of one topic or table."""

    name: str
    kind: str  # the message type, "CSV" ...
    fields: Mapping[str, Field]
    clocks: Mapping[str, Clock]  # the best first; any field may be named as a clock, too
    count: int  # rows
    remarks: tuple[str, ...] = ()

    def clock(self, name: str) -> Clock | None:
        """Return a clock by its name, a field as a clock, or None if there is neither."""
        if name in self.clocks:
            return self.clocks[name]
        if name == ROW_CLOCK:
            return Clock(np.arange(self.count, dtype=np.int64))
        found = self.fields.get(name)
        return None if found is None or found.labels else Clock(found.values, found.unit if found.unit in TICKS_A_SECOND else "")

    def rows(self, chosen: np.ndarray) -> Stream:
        """Return the stream with these rows only, by index or mask."""
        fields = {name: replace(each, values=each.values[chosen]) for name, each in self.fields.items()}
        clocks = {name: replace(each, ticks=each.ticks[chosen]) for name, each in self.clocks.items()}
        count = int(np.arange(self.count)[chosen].size)
        return replace(self, fields=fields, clocks=clocks, count=count)


@dataclass(frozen=True, eq=False)
class Take:
    """One run of the recorder, whose streams share a time line."""

    name: str
    streams: Mapping[str, Stream]


@dataclass(frozen=True, eq=False)
class Log:
    """A log as read, and what is to be said of the reading."""

    path: Path
    format: str  # for people: "MCAP", "ROS 1 bag" ...
    takes: Sequence[Take]
    notes: tuple[str, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict)  # topic -> why it has no fields here

    @property
    def streams(self) -> dict[str, list[Stream]]:
        """The streams of all takes by name."""
        found: dict[str, list[Stream]] = {}
        for take in self.takes:
            for name, stream in take.streams.items():
                found.setdefault(name, []).append(stream)
        return found


class StreamBuilder:
    """A stream that grows message by message; a field that a message lacks is NaN in its row."""

    def __init__(self, name: str, kind: str) -> None:
        self.name, self.kind = name, kind
        self._columns: dict[str, array[float]] = {}
        self._clocks: dict[str, list[int | None]] = {}
        self._texts: dict[str, dict[str, int]] = {}
        self._count = 0
        self._dropped = False

    def add(self, stamps: Mapping[str, int | None], values: Mapping[str, float | str]) -> None:
        """Add a row: its stamps in ns, and its fields."""
        for name, stamp in stamps.items():
            self._clocks.setdefault(name, [None] * self._count).append(stamp)
        for name, value in values.items():
            column = self._columns.get(name)
            if column is None:
                if len(self._columns) >= MAX_FIELDS:
                    self._dropped = True
                    continue
                column = self._columns[name] = array("d")
            if (missing := self._count - len(column)) > 0:
                column.extend([np.nan] * missing)
            column.append(self._code(name, value) if isinstance(value, str) else value)
        self._count += 1

    def _code(self, name: str, text: str) -> float:
        known = self._texts.setdefault(name, {})
        return float(known.setdefault(text, len(known)))

    def build(self, sort_by: str, unit: str = "") -> Stream:
        """Return the stream, its rows in the order of the clock `sort_by`; `unit` is that of a field `data`."""
        fields = {}
        for name, column in self._columns.items():
            column.extend([np.nan] * (self._count - len(column)))
            fields[name] = Field(np.array(column), unit if name == "data" else "", tuple(self._texts.get(name, ())))
        clocks, remarks = {}, [f"only the first {MAX_FIELDS} fields are read"] * self._dropped
        for name, stamps in self._clocks.items():
            missing = sum(stamp is None for stamp in stamps)
            if missing == 0:
                clocks[name] = Clock(np.array(stamps, np.int64), "ns")
            elif missing < self._count:
                remarks.append(f"{name} is not set in {missing} of {self._count} messages, so it is no clock")
        stream = Stream(self.name, self.kind, fields, clocks, self._count, tuple(remarks))
        if sort_by in clocks and np.any(np.diff(clocks[sort_by].ticks) < 0):
            stream = stream.rows(np.argsort(clocks[sort_by].ticks, kind="stable"))
        return stream
