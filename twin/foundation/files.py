"""Safe reading of files: which may be opened, how much is read, and where a fault is. Folders written whole or not at all."""

import codecs
import os
import shutil
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from twin.foundation.errors import DataError, short_repr

MAX_TRIAL_BYTES = 96 * 2**20  # bytes of a trial's table: read in less than a gigabyte
MAX_TABLE_NUMBERS = 16 * 2**20  # numbers in a trial's table
MAX_SET_NUMBERS = 2 * MAX_TABLE_NUMBERS  # numbers in all trials together
MAX_CLOUD_BYTES = 128 * 2**20  # bytes of a trial's clouds, unpacked
MAX_NAME_BYTES = 200  # bytes
MAX_SET_TOML_BYTES = 4 * 2**20  # bytes of measurements.toml
MAX_LINE_BYTES = 2**20  # bytes


@contextmanager
def prefix_errors(where: object) -> Iterator[None]:
    """Put `where` (file, row, column) before the message of a DataError raised inside."""
    try:
        yield
    except DataError as fault:
        raise DataError(f"{where}: {fault}") from None


@contextmanager
def written_whole(folder: Path) -> Iterator[Path]:
    """Lend a new folder next to `folder`, and give it that name at the end; after an error nothing of it stays.

    An empty `folder` may be there already.
    """
    draft = folder.absolute().parent / f".{folder.absolute().name}.{os.getpid()}.writing"
    draft.mkdir(parents=True)
    try:
        yield draft
        if folder.exists():
            folder.rmdir()
        draft.rename(folder)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def is_file(path: Path) -> bool:
    """Return whether the file exists; False for an impossible path, such as one too long or with a NUL."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def check_file_name(name: object) -> str:
    """Return a file name relative to the set's folder. Raises DataError for a name that leads out of it."""
    if not isinstance(name, str) or not name.strip():
        raise DataError(f"{short_repr(name)} is no file name; write one in quotes, relative to the set's folder")
    if len(name.encode()) > MAX_NAME_BYTES:
        raise DataError(f"file {short_repr(name)}: a name of {len(name)} characters; at most {MAX_NAME_BYTES} are allowed")
    path = PurePosixPath(name)
    leads_out = path.is_absolute() or ".." in path.parts or "\\" in name or PureWindowsPath(name).drive
    if leads_out or not path.name or not name.isprintable():
        raise DataError(f"file {short_repr(name)} leads out of the set's folder; write a relative path with / and without ..")
    return name


def resolve_in_folder(folder: Path, name: object) -> Path:
    """Return the path of file `name` of a set. Raises DataError if it is missing or leads out of the folder, also by a link."""
    path = folder / check_file_name(name)
    try:
        if not path.is_file():
            raise DataError(f"{path}: no such file; put it there or correct its name in measurements.toml")
        if not path.resolve().is_relative_to(folder.resolve()):
            raise DataError(f"{path}: links to a file outside the set's folder; copy the file into the folder")
    except (OSError, ValueError) as fault:
        raise DataError(f"{path}: cannot be opened ({_describe_os_error(fault)})") from None
    return path


def check_file_size(path: Path, largest: int) -> None:
    """Raise DataError for a file of more than `largest` bytes, or one that cannot be accessed."""
    try:
        size = path.stat().st_size
    except OSError as fault:
        raise DataError(f"{path}: cannot be opened ({_describe_os_error(fault)})") from None
    if size > largest:
        raise DataError(f"{path}: {size} bytes; at most {largest} are read, split it into several files")


def read_utf8(path: Path, largest: int) -> bytes:
    """Read a file as UTF-8 bytes, without byte order mark, lines ended by a newline; at most `largest` bytes are read.

    Raises DataError for a file or line that is too long, for NUL bytes, and for text that is not UTF-8.
    """
    check_file_size(path, largest)
    chunks: list[bytes] = []
    decoder = codecs.getincrementaldecoder("utf-8")()
    row, line, total = 1, 0, 0  # number and bytes so far of the line being read
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(MAX_LINE_BYTES):
                total += len(chunk)
                ends = chunk.find(b"\n")
                if total > largest:
                    raise DataError(f"{path}: more than {largest} bytes; split it into several files")
                if line + (len(chunk) if ends < 0 else ends) > MAX_LINE_BYTES:
                    raise DataError(f"{path}, row {row}: line longer than {MAX_LINE_BYTES} bytes; is this a text table?")
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
        raise DataError(f"{path}: cannot be read ({_describe_os_error(fault)})") from None
    data = b"".join(chunks).removeprefix(codecs.BOM_UTF8)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def parse_toml(data: bytes) -> dict[str, Any]:
    """Parse TOML bytes. Raises DataError for other text, for too deep nesting and for numbers of thousands of digits."""
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as fault:
        raise DataError(f"not TOML ({str(fault)[:120]}); correct the file") from None


def _describe_os_error(fault: Exception) -> str:
    return (fault.strerror if isinstance(fault, OSError) else None) or str(fault) or type(fault).__name__
