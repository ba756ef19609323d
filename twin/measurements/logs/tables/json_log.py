"""JSON logs: a list of records, an object that holds one, columns of equal lengths, or a record a line."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.bags.messages import flatten
from twin.measurements.logs.streams import Stream
from twin.measurements.logs.tables.columns import stream_of_table
from twin.measurements.logs.tables.text_files import read_text


def read_json(path: Path, name: str) -> tuple[Stream, tuple[str, ...]]:
    """Return a JSON log as a stream, and its values outside the records as remarks. Raises DataError for JSON without records."""
    text, notes = read_text(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = _lines(path, text)
    records, beside = _records(content)
    if not records:
        raise DataError(f"{path}: JSON without a list of records that hold numbers; write it as CSV")
    rows = [_with_texts(each) for each in records]
    names = list(dict.fromkeys(key for row in rows for key in row))
    table = pa.table({key: _column([row.get(key) for row in rows]) for key in names})
    said = (f"{path.name} says beside its rows: {', '.join(beside)}",) if beside else ()
    return stream_of_table(name, "JSON records", table), (*notes, *said)


def _lines(path: Path, text: str) -> list[Any]:
    try:
        return [json.loads(line) for line in text.split("\n") if line.strip()]
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{path}: begins like JSON, but is none ({short_repr(str(fault))}); correct the file") from None


def _records(content: Any) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the longest list of records in JSON, and the plain values beside it."""
    if isinstance(content, list):
        return [each for each in content if isinstance(each, dict)], []
    if not isinstance(content, dict):
        return [], []
    beside = [f"{key} = {value!r}" for key, value in content.items() if isinstance(value, str | int | float)]
    lists = {key: value for key, value in content.items() if isinstance(value, list) and value}
    records = [value for value in lists.values() if isinstance(value[0], dict)]
    if records:
        return [each for each in max(records, key=len) if isinstance(each, dict)], beside
    lengths = {len(value) for value in lists.values()}
    if lists and len(lengths) == 1:
        return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)], beside
    return [], beside


def _with_texts(record: dict[str, Any]) -> dict[str, float | str | int | bool]:
    """Return a record flat; whole numbers and texts at its top stay as they are."""
    top = {key: value for key, value in record.items() if isinstance(value, int | str)}
    return {**flatten(record), **top}


def _column(values: list[Any]) -> pa.Array:
    try:
        return pa.array(values)
    except (pa.ArrowException, OverflowError):
        return pa.array([None if value is None else str(value) for value in values])
