"""TOML files of a declared format, whose errors name the file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from twin.foundation.errors import DataError, TwinError, short_repr
from twin.foundation.files import parse_toml, read_utf8

MAX_TOML_BYTES = 2**20  # bytes


@contextmanager
def open_toml(path: Path, file_format: str) -> Iterator[dict[str, Any]]:
    """Read a file whose `format` is `file_format`; a TwinError raised inside the `with` becomes a DataError that names the file."""
    data = read_utf8(path, MAX_TOML_BYTES)
    try:
        yield parse_toml_of_format(data, file_format)
    except TwinError as error:
        raise DataError(f"{path}: {error}") from None


def parse_toml_of_format(data: bytes, file_format: str) -> dict[str, Any]:
    """Parse TOML bytes whose `format` is `file_format`. Raises DataError for anything else."""
    table = parse_toml(data)
    if table.get("format") != file_format:
        raise DataError(f"format is {short_repr(table.get('format'))}; this program reads {file_format!r}")
    return table
