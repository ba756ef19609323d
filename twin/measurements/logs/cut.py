"""Where trials begin and end: at pauses of all streams, at marks, or after a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.map.map_file import CutTable
from twin.measurements.logs.streams import Stream

LEAST_ROWS = 3  # rows of a trial that can be used


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks on a take's time line: what is in force from each stamp on."""

    stamps: np.ndarray  # (m,) s, increasing
    values: np.ndarray  # (m,)
    labels: tuple[str, ...]  # the texts behind the values, if they are texts
    only: float | None = None  # the value whose rows are kept


def marks_of(stream: Stream, stamps: np.ndarray, cut: CutTable) -> Marks:
    """Return the marks in a stream. Raises DataError for a field or value that it does not have."""
    order = np.argsort(stamps, kind="stable")
    order = order[np.isfinite(stamps[order])]
    if cut.field is None:
        texts = next((each for each in stream.fields.values() if each.labels), None)
        values = np.arange(len(order), dtype=float)
        labels = () if texts is None else tuple(_label(texts.labels, float(value)) for value in texts.values[order])
        return Marks(stamps[order], values, labels)
    field = stream.fields.get(cut.field)
    if field is None:
        known = ", ".join(list(stream.fields)[:20])
        raise DataError(f"cut: {stream.name} has no field {short_repr(cut.field)}; it has {known}")
    only = None
    if cut.only is not None:
        only = _wanted(cut, field.labels)
    values = field.values[order].astype(float)
    return Marks(stamps[order][np.isfinite(values)], values[np.isfinite(values)], field.labels, only)


def _wanted(cut: CutTable, labels: Sequence[str]) -> float:
    if labels:
        if cut.only not in labels:
            raise DataError(f"cut: {cut.field} is never {short_repr(cut.only)}; it is {', '.join(labels[:20])}")
        return float(labels.index(cut.only))
    if not isinstance(cut.only, int | float):
        raise DataError(f"cut: {cut.field} holds numbers, and only = {short_repr(cut.only)} is none")
    return float(cut.only)


def cut_at_gaps(stamps: np.ndarray, gap: float) -> list[tuple[str, np.ndarray]]:
    """Return the pieces between pauses longer than `gap` (s): a label, empty, and the rows of each."""
    return [("", part) for part in np.split(np.arange(len(stamps)), np.flatnonzero(np.diff(stamps) > gap) + 1)]


def cut_into_lengths(stamps: np.ndarray, every: float) -> list[tuple[str, np.ndarray]]:
    """Return pieces of a continuous log, each `every` (s) long: a label, empty, and the rows of each."""
    piece = np.floor((stamps - stamps[0]) / every).astype(int) if len(stamps) else np.zeros(0, int)
    return [("", part) for part in np.split(np.arange(len(stamps)), np.flatnonzero(np.diff(piece)) + 1)]


def cut_at_marks(stamps: np.ndarray, marks: Marks, notes: list[str]) -> list[tuple[str, np.ndarray]]:
    """Return the pieces of equal marks: a label and the rows of each; rows before the first mark are left out."""
    if len(marks.stamps) == 0:
        raise DataError("cut: there is no mark in the log; name another stream or field, or cut at gaps")
    at = np.searchsorted(marks.stamps, stamps, side="right") - 1
    values = np.where(at >= 0, marks.values[np.maximum(at, 0)], np.nan)
    if before := int(np.count_nonzero(at < 0)):
        notes.append(f"{before} rows before the first mark are left out")
    changes = np.flatnonzero((np.diff(values) != 0) | np.isnan(values[1:])) + 1
    pieces = []
    for part in np.split(np.arange(len(stamps)), changes):
        value = float(values[part[0]]) if len(part) else np.nan
        if np.isfinite(value) and marks.only in (None, value):
            label = "" if marks.only is not None else _label(marks.labels, value) if marks.labels else f"{value:g}"
            pieces.append((label, part))
    return pieces


def _label(labels: Sequence[str], value: float) -> str:
    return labels[int(value)] if np.isfinite(value) and int(value) < len(labels) else ""
