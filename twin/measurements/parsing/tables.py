"""Reading of a trial's CSV or Parquet file as columns of numbers; errors name the cell.

pyarrow reads a CSV. If it fails, a slow reader finds the row and column to name.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import MAX_LINE_BYTES, MAX_TABLE_NUMBERS, MAX_TRIAL_BYTES, check_file_size, read_utf8

_DATE_PATTERN = re.compile(r"\d{4}-\d{2}-\d{2}|\d{1,2}:\d{2}")
_NUMBER_PATTERN = re.compile(r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf(?:inity)?)", re.IGNORECASE)
_MISSING = ("", "nan", "+nan", "-nan")  # compared in lower case


@dataclass(frozen=True)
class Table:
    """Columns as written, not yet in SI."""

    path: Path
    columns: dict[str, np.ndarray]  # wanted name -> (n,), NaN where missing
    extra: tuple[str, ...]  # names of columns that are not declared
    first_row: int  # row number of the first sample in messages: 2 under a CSV's header, 1 in Parquet

    def cell(self, index: int, name: str) -> str:
        """Return the place of a sample, for a message."""
        return f"{self.path}, row {index + self.first_row}, column {name}"


def read_table(path: Path, names: Sequence[str]) -> Table:
    """Read the columns `names` of a CSV or Parquet file.

    Raises DataError for a file that is too large or no table, a column that is missing or doubled, a row of another length, and a
    cell that is no number.
    """
    return _read_parquet(path, names) if path.suffix.lower() == ".parquet" else _read_csv(path, names)


def _read_csv(path: Path, names: Sequence[str]) -> Table:
    data = read_utf8(path, MAX_TRIAL_BYTES)
    end = data.find(b"\n")
    header = [name.strip() for name in _cells(path, 1, (data if end < 0 else data[:end]).decode())]
    extra = _check_header(f"{path}, row 1", header, names)
    return Table(path, _fast_columns(data, header, names) or _slow_columns(path, data, header, names), extra, first_row=2)


def _check_header(where: str, header: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise DataError(f"{where}: column {short_repr(twice)} is there twice; keep one")
    for name in names:
        if name not in header:
            hint = " (columns are separated by commas)" if len(header) == 1 else ""
            found = f"no column {name}{hint}, only {short_repr(', '.join(header))}"
            raise DataError(f"{where}: {found}; add it, or remove the channel from measurements.toml")
    return tuple(name for name in header if name not in names)


def _fast_columns(data: bytes, header: Sequence[str], names: Sequence[str]) -> dict[str, np.ndarray] | None:
    """Return the columns, or None for a table that the slow reader must read or reject, such as one with quoted numbers."""
    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(data.rstrip()),
            read_options=pyarrow.csv.ReadOptions(
                use_threads=False, block_size=2 * MAX_LINE_BYTES, column_names=list(header), skip_rows=1
            ),
            parse_options=pyarrow.csv.ParseOptions(quote_char=False, ignore_empty_lines=False),
            convert_options=pyarrow.csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.float64()), include_columns=list(names), null_values=["", "NaN", "nan"]
            ),
        )
    except pa.ArrowException:
        return None
    columns = {name: _numbers(table.column(name)) for name in names}
    unlike = any(np.count_nonzero(np.isnan(columns[name])) > table.column(name).null_count for name in names)
    return None if unlike else columns  # pyarrow reads `nan(1)` as NaN


def _slow_columns(path: Path, data: bytes, header: Sequence[str], names: Sequence[str]) -> dict[str, np.ndarray]:
    rows: list[list[float]] = []
    where = [header.index(name) for name in names]
    for row, line in enumerate(data.rstrip().decode().split("\n")[1:], start=2):
        cells = _cells(path, row, line)
        if len(cells) != len(header):
            raise DataError(f"{path}, row {row}: {len(cells)} cells under {len(header)} headings; give each row one a column")
        rows.append([_cell_number(path, row, name, cells[at]) for name, at in zip(names, where, strict=True)])
    array = np.array(rows, float).reshape(len(rows), len(names))
    return {name: array[:, at] for at, name in enumerate(names)}


def _cells(path: Path, row: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line], strict=True), [])
    except csv.Error as fault:
        raise DataError(f"{path}, row {row}: no CSV ({fault}); separate cells by commas, without quotes") from None


def _cell_number(path: Path, row: int, name: str, cell: str) -> float:
    text = cell.strip()
    if text.lower() in _MISSING:
        return np.nan
    if not _NUMBER_PATTERN.fullmatch(text):
        if name == "time" and _DATE_PATTERN.match(text):
            raise DataError(
                f"{path}, row {row}, column time: {short_repr(cell)} is a date; write the seconds since a start of your choice, "
                "or use `twin import`"
            )
        raise DataError(
            f"{path}, row {row}, column {name}: {short_repr(cell)} is not a number; write one, or nothing if it is missing"
        )
    return float(text)


def _read_parquet(path: Path, names: Sequence[str]) -> Table:
    check_file_size(path, MAX_TRIAL_BYTES)
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            schema, count = file.schema_arrow, file.metadata.num_rows
            extra = _check_header(str(path), schema.names, names)
            if count * len(names) > MAX_TABLE_NUMBERS:
                raise DataError(f"{path}: {count} rows; at most {MAX_TABLE_NUMBERS // len(names)} are read, split the trial")
            for name in names:
                kind = schema.field(name).type
                if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
                    raise DataError(f"{path}, column {name}: holds {kind}; store it as a number (float64)")
            table = file.read(columns=list(names), use_threads=False)
            columns = {name: _numbers(table.column(name)) for name in names}
    except (pa.ArrowException, OSError, ValueError, KeyError, OverflowError, MemoryError) as fault:
        raise DataError(f"{path}: cannot be read as Parquet ({short_repr(str(fault))}); write it again") from None
    return Table(path, columns, extra, first_row=1)


def _numbers(column: pa.ChunkedArray) -> np.ndarray:
    return column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)  # nanoseconds since 1970, to 256 of them
