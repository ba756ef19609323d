"""A TOML file of a declared format, whose faults are told with its path."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from twin.errors import DataError, TwinError, shown
from twin.measurements.files import parse_toml, read_text

LARGEST = 2**20  # bytes


@contextmanager
def opened(path: Path, form: str) -> Iterator[dict[str, Any]]:
    """The content of a file whose `format` is `form`. Whatever TwinError is raised over it comes out as a DataError naming it."""
    data = read_text(path, LARGEST)
    try:
        yield checked(data, form)
    except TwinError as error:
        raise DataError(f"{path}: {error}") from None


def checked(data: bytes, form: str) -> dict[str, Any]:
    """TOML bytes as a table whose `format` is `form`. Raises DataError for anything else."""
    table = parse_toml(data)
    if table.get("format") != form:
        raise DataError(f"format is {shown(table.get('format'))}; this program reads {form!r}")
    return table
