"""Parquet tables of any layout, by pyarrow."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.streams import Stream
from twin.measurements.logs.tables.columns import stream_of_table

MAX_VALUES = 64 * 2**20  # values of a table


def read_parquet(path: Path, name: str) -> tuple[Stream, tuple[str, ...]]:
    """Return a Parquet file as a stream. Raises DataError for one that is broken, empty or too large."""
    table = read_parquet_table(path)
    if table.num_rows == 0:
        raise DataError(f"{path}: a table without rows; name another log")
    return stream_of_table(name, "Parquet table", table), ()


def read_parquet_table(path: Path) -> pa.Table:
    """Return the numbers and texts of a Parquet file; pictures and the like are left out. Raises DataError as `read_parquet`."""
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            schema, rows = file.schema_arrow, file.metadata.num_rows
            names = [each.name for each in schema if not (pa.types.is_binary(each.type) or _holds_bytes(each.type))]
            if rows * len(names) > MAX_VALUES:
                raise DataError(f"{path}: {rows} rows of {len(names)} columns; at most {MAX_VALUES} values are read, split it")
            return file.read(columns=names, use_threads=False)
    except (pa.ArrowException, OSError, ValueError, KeyError, OverflowError, MemoryError) as fault:
        raise DataError(f"{path}: cannot be read as Parquet ({short_repr(str(fault), 150)}); was it copied whole?") from None


def _holds_bytes(kind: pa.DataType) -> bool:
    return pa.types.is_struct(kind) and any(pa.types.is_binary(kind.field(n).type) for n in range(kind.num_fields))
