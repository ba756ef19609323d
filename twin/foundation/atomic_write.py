"""Whole-or-nothing writing of files."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from twin.foundation.errors import DataError

Content = bytes | Callable[[BinaryIO], object]  # or a function that writes it to an open file


def write_atomically(path: Path, data: Content, way_out: str = "choose another place") -> None:
    """Write a file whole or not at all: to a neighbour `path`.part first, which is then renamed.

    The neighbour is removed after any error. Raises DataError, naming the file and the `way_out`, if the disk refuses it.
    """
    write_all_atomically({path: data}, way_out)


def write_all_atomically(files: Mapping[Path, Content], way_out: str = "choose another place") -> None:
    """Write several files as `write_atomically` does: none is renamed before all are written."""
    parts = {path: path.with_name(path.name + ".part") for path in files}
    path = next(iter(files))
    try:
        for path, data in files.items():
            with parts[path].open("wb") as file:
                file.write(data) if isinstance(data, bytes) else data(file)
        for path, part in parts.items():
            part.replace(path)
    except OSError as fault:
        raise DataError(f"{path}: cannot be written ({fault.strerror or fault}); {way_out}") from None
    finally:
        for part in parts.values():
            with suppress(OSError):
                part.unlink(missing_ok=True)
