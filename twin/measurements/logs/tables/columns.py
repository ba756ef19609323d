"""Tables (CSV, Parquet, JSON, LeRobot) as streams: columns of numbers, their units as far as the headers say them, and clocks."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from twin.measurements.logs.streams import MAX_FIELDS, TICKS_A_SECOND, Clock, Field, Stream
from twin.measurements.logs.tables.dates import nanoseconds_of_texts
from twin.measurements.logs.tables.headers import split_unit

MAX_LABELS = 1000  # different texts of a column that can mark trials
LEAST_NUMBERS = 0.5  # share of a column's cells that are numbers, for the others to count as missing
_TIME_NAMES = (  # the likelier the name, the earlier
    r"_*(time|t|timestamp|time.?stamp|stamp|times|timestamps)_*",
    r"time[ _.-]?(s|sec|secs|seconds|ms|us|ns|millis|micros|nanos)|(secs?|seconds|millis|micros|msecs?|nanos)",
    r"(elapsed|log|unix|ros|rosbag|epoch|sys|system|host|device|sensor|wall|sim|record\w*)[ _.-]?(time|stamp|timestamp)\w*",
    r".*header.*stamp.*|.*[ _.-](time|stamp|timestamp)|(time|timestamp)[ _.-].*|date|datetime|date.?time|utc|clock",
)
_SECONDS = re.compile(r"(.*?)(secs?|seconds|s)", re.IGNORECASE)
_NANOSECONDS = ("nanosec", "nanosecs", "nsec", "nsecs", "nanoseconds", "ns")


def stream_of_table(name: str, kind: str, table: pa.Table, units: Mapping[str, str] | None = None) -> Stream:
    """Return a table as a stream. `units` are those that the file states in another way than in its headers."""
    remarks: list[str] = []
    fields: dict[str, Field] = {}
    for column, values in _flat_columns(table):
        if len(fields) >= MAX_FIELDS:
            remarks.append(f"only the first {MAX_FIELDS} columns are read")
            break
        stated = (units or {}).get(column, "") or split_unit(column)[1]
        if (made := _field(column, values, stated, remarks)) is not None:
            fields[column] = made
    return Stream(name, kind, fields, _clocks(fields), table.num_rows, tuple(remarks))


def _flat_columns(table: pa.Table) -> list[tuple[str, pa.ChunkedArray]]:
    """Return the columns, structures by their parts and lists by their entries."""
    while any(pa.types.is_struct(kind) for kind in table.schema.types):
        table = table.flatten()
    found: list[tuple[str, pa.ChunkedArray]] = []
    for name, values in zip(table.column_names, table.columns, strict=True):
        if pa.types.is_list(values.type) or pa.types.is_large_list(values.type) or pa.types.is_fixed_size_list(values.type):
            found += list_entries(name, values)
        else:
            found.append((name, values))
    return found


def list_entries(name: str, values: pa.ChunkedArray, names: Sequence[str] = ()) -> list[tuple[str, pa.ChunkedArray]]:
    """Return a column of lists of equal lengths as a column an entry: `name[0]`, or `name[elbow]` by `names`."""
    lengths = pc.call_function("list_value_length", [values]).unique().drop_null().to_pylist()
    inner = values.type.value_type
    if len(lengths) != 1 or not (pa.types.is_integer(inner) or pa.types.is_floating(inner) or pa.types.is_boolean(inner)):
        return []
    named = len(names) == lengths[0] and len(set(names)) == len(names)
    return [
        (f"{name}[{names[n] if named else n}]", pc.call_function("list_element", [values, pa.scalar(n)]))
        for n in range(min(lengths[0], MAX_FIELDS))
    ]


def _field(name: str, values: pa.ChunkedArray, unit: str, remarks: list[str]) -> Field | None:
    """Return a column as a field, or None for one that holds neither numbers nor marks."""
    kind = values.type
    if pa.types.is_dictionary(kind):
        values = values.cast(kind.value_type)
        kind = values.type
    if pa.types.is_timestamp(kind) or pa.types.is_time(kind) or pa.types.is_duration(kind):
        return Field(_nanoseconds(values), "ns")
    if pa.types.is_boolean(kind):
        return Field(_floats(values), unit)
    if pa.types.is_integer(kind):
        small = values.null_count == 0 and not pa.types.is_uint64(kind)
        return Field(values.cast(pa.int64()).to_numpy() if small else _floats(values), unit)
    if pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return Field(_floats(values), unit)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return _text_field(name, values, unit, remarks)
    return None


def _floats(values: pa.ChunkedArray) -> np.ndarray:
    return values.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)


def _nanoseconds(values: pa.ChunkedArray) -> np.ndarray:
    """Return whole nanoseconds of times, since 1970 or midnight; as floats if some are missing."""
    ticks = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}[values.type.unit]
    whole = values.cast(pa.int32() if values.type.bit_width == 32 else pa.int64())
    if values.null_count:
        return _floats(whole) * ticks
    return whole.to_numpy(zero_copy_only=False).astype(np.int64) * ticks


def _text_field(name: str, values: pa.ChunkedArray, unit: str, remarks: list[str]) -> Field | None:
    """Return a column of texts: numbers with odd cells, or marks."""
    texts = values.to_pylist()
    numbers = np.array([_number(text) for text in texts])
    stated = np.array([text is not None for text in texts], bool)
    odd = np.flatnonzero(stated & np.isnan(numbers))
    if stated.any() and len(odd) < (1.0 - LEAST_NUMBERS) * np.count_nonzero(stated):
        where = f"{len(odd)} cells are no numbers and read as missing, the first {texts[odd[0]]!r} in data row {odd[0] + 1}"
        remarks.append(f"{name}: {where}")
        return Field(numbers, unit)
    if (ticks := nanoseconds_of_texts(texts)) is not None:
        return Field(ticks, "ns")
    labels = list(dict.fromkeys(text for text in texts if text is not None))
    if not labels:
        return None
    if len(labels) > MAX_LABELS:
        remarks.append(f"{name}: {len(labels)} different texts, not read")
        return None
    code = {text: float(n) for n, text in enumerate(labels)}
    return Field(np.array([np.nan if text is None else code[text] for text in texts]), "", tuple(labels))


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return np.nan


def _clocks(fields: Mapping[str, Field]) -> dict[str, Clock]:
    """Return the columns that are times by their names, the likeliest first."""
    found: list[tuple[int, str, Clock]] = []
    for name, each in fields.items():
        plain = split_unit(name)[0].strip().lstrip("%#").strip().lower()
        rank = next((n for n, pattern in enumerate(_TIME_NAMES) if re.fullmatch(pattern, plain)), None)
        pair = _nanoseconds_of(name, fields)
        if each.labels or (rank is None and not pair):
            continue
        if pair:
            whole = each.values.astype(np.int64) * 10**9 + fields[pair].values.astype(np.int64)
            found.append((-1, f"{name} + {pair}", Clock(whole, "ns")))
        elif rank is not None and _mostly_rises(each.values):
            found.append((rank, name, Clock(each.values, each.unit if each.unit in TICKS_A_SECOND else "")))
    if not found:  # a column that rises in a unit of time
        found = [
            (0, name, Clock(each.values, each.unit)) for name, each in fields.items()
            if each.unit in TICKS_A_SECOND and len(each.values) > 1 and np.all(np.diff(each.values) >= 0)
        ]  # fmt: skip
    return {name: clock for _, name, clock in sorted(found, key=lambda each: each[0])}


def _mostly_rises(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return len(steps) == 0 or float(np.mean(steps >= 0)) > 0.5


def _nanoseconds_of(name: str, fields: Mapping[str, Field]) -> str:
    """Return the column of nanoseconds beside a column of whole seconds, or an empty text."""
    match = _SECONDS.fullmatch(name)
    if match is None or not np.issubdtype(fields[name].values.dtype, np.integer):
        return ""
    for ending in _NANOSECONDS:
        other = fields.get(match[1] + ending)
        if other is not None and np.issubdtype(other.values.dtype, np.integer) and match[1] + ending != name:
            return match[1] + ending
    return ""
