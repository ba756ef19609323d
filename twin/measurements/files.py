"""Files at the border: which may be opened, how much of them is read, and where a fault in them sits."""

from __future__ import annotations

import codecs
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from twin.errors import DataError, shown

LARGEST_TRIAL = 96 * 2**20  # bytes of a trial's table: read in less than a gigabyte
LARGEST_TABLE = 16 * 2**20  # numbers in it
LARGEST_SET = 2 * LARGEST_TABLE  # numbers in all trials together
LARGEST_CLOUD = 128 * 2**20  # bytes of a trial's clouds, unpacked
LONGEST_NAME = 200  # bytes
LARGEST_TOML = 4 * 2**20  # bytes of measurements.toml
LONGEST_LINE = 2**20  # bytes


@contextmanager
def located(where: object) -> Iterator[None]:
    """Puts `where` (file, row, column) before the message of a DataError raised inside."""
    try:
        yield
    except DataError as fault:
        raise DataError(f"{where}: {fault}") from None


def is_file(path: Path) -> bool:
    """Whether there is a file; a path that cannot be one, too long or with a NUL in it, is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_name(name: object) -> str:
    """A file name relative to the set's folder. Raises DataError for one that leads out of it."""
    if not isinstance(name, str) or not name.strip():
        raise DataError(f"{shown(name)} is no file name; write one in quotes, relative to the set's folder")
    if len(name.encode()) > LONGEST_NAME:
        raise DataError(f"file {shown(name)}: a name of {len(name)} characters; at most {LONGEST_NAME} are allowed")
    path = PurePosixPath(name)
    abroad = path.is_absolute() or ".." in path.parts or "\\" in name or PureWindowsPath(name).drive
    if abroad or not path.name or not name.isprintable():
        raise DataError(f"file {shown(name)} leads out of the set's folder; write a relative path with / and without ..")
    return name


def inside(folder: Path, name: object) -> Path:
    """The path of file `name` of a set. Raises DataError if it is missing or leads out of the folder, also by a link."""
    path = folder / check_name(name)
    try:
        if not path.is_file():
            raise DataError(f"{path}: no such file; put it there or correct its name in measurements.toml")
        if not path.resolve().is_relative_to(folder.resolve()):
            raise DataError(f"{path}: links to a file outside the set's folder; copy the file into the folder")
    except (OSError, ValueError) as fault:
        raise DataError(f"{path}: cannot be opened ({_reason(fault)})") from None
    return path


def check_size(path: Path, largest: int) -> None:
    """Raises DataError for a file of more than `largest` bytes, or one that cannot be looked at."""
    try:
        size = path.stat().st_size
    except OSError as fault:
        raise DataError(f"{path}: cannot be opened ({_reason(fault)})") from None
    if size > largest:
        raise DataError(f"{path}: {size} bytes; at most {largest} are read, split it into several files")


def read_text(path: Path, largest: int) -> bytes:
    """The file as UTF-8 bytes, without byte order mark, lines ended by a newline; never more than `largest` bytes are read.

    Raises DataError for a file or line that is too long, NUL bytes, and text that is not UTF-8.
    """
    check_size(path, largest)
    chunks: list[bytes] = []
    decoder = codecs.getincrementaldecoder("utf-8")()
    row, line, total = 1, 0, 0  # number and bytes so far of the line being read
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(LONGEST_LINE):
                total += len(chunk)
                ends = chunk.find(b"\n")
                if total > largest:
                    raise DataError(f"{path}: more than {largest} bytes; split it into several files")
                if line + (len(chunk) if ends < 0 else ends) > LONGEST_LINE:
                    raise DataError(f"{path}, row {row}: line longer than {LONGEST_LINE} bytes; is this a text table?")
                if b"\0" in chunk:
                    at = row + chunk[: chunk.index(b"\0")].count(b"\n")
                    raise DataError(f"{path}, row {at}: NUL byte; a text file in UTF-8 is needed, this one is binary or UTF-16")
                decoder.decode(chunk)
                line = line + len(chunk) if ends < 0 else len(chunk) - chunk.rfind(b"\n") - 1
                row += chunk.count(b"\n")
                chunks.append(chunk)
            decoder.decode(b"", final=True)
    except UnicodeDecodeError as fault:
        at = row + fault.object[: fault.start].count(b"\n")
        raise DataError(f"{path}, row {at}: byte 0x{fault.object[fault.start]:02x} is not UTF-8; save the file as UTF-8") from None
    except OSError as fault:
        raise DataError(f"{path}: cannot be read ({_reason(fault)})") from None
    data = b"".join(chunks).removeprefix(codecs.BOM_UTF8)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def parse_toml(data: bytes) -> dict[str, Any]:
    """TOML bytes as a table. Raises DataError for text that is none, is nested too deep or has numbers of thousands of digits."""
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as fault:
        raise DataError(f"not TOML ({str(fault)[:120]}); correct the file") from None


def _reason(fault: Exception) -> str:
    return (fault.strerror if isinstance(fault, OSError) else None) or str(fault) or type(fault).__name__
