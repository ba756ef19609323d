"""A TOML file of a declared format, whose faults are told with its path."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from twin.errors import DataError, TwinError


@contextmanager
def opened(path: Path, form: str) -> Iterator[dict[str, Any]]:
    """The content of a file whose `format` is `form`. Whatever TwinError is raised over it comes out as a DataError naming it."""
    try:
        table = tomllib.loads(path.read_text("utf-8"))
        if table.get("format") != form:
            raise DataError(f"format is {table.get('format')!r}; this program reads {form!r}")
        yield table
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, TwinError) as error:
        raise DataError(f"{path}: {error}") from None
