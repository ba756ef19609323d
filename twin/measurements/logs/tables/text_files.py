"""Text of a log file, plain or gzipped, in the encodings that loggers write."""

import gzip
import zlib
from pathlib import Path

from twin.foundation.errors import DataError

MAX_TEXT_BYTES = 512 * 2**20  # bytes of a text log, unpacked
_GZIP = b"\x1f\x8b"


def read_head(path: Path, count: int = 4096) -> bytes:
    """Return the first bytes of a file, unpacked. Raises DataError for one that cannot be opened or is empty."""
    try:
        with path.open("rb") as file:
            head = file.read(count)
        if head.startswith(_GZIP):
            with gzip.open(path) as packed:
                head = packed.read(count)
    except (OSError, EOFError, zlib.error, ValueError) as fault:
        raise DataError(f"{path}: cannot be read ({_reason(fault)}); name another file") from None
    if not head.strip():
        raise DataError(f"{path}: the file is empty; name another log")
    return head


def read_bytes(path: Path) -> bytes:
    """Return all bytes of a file, unpacked. Raises DataError for one that cannot be read or is too large."""
    try:
        data = path.read_bytes() if path.stat().st_size <= MAX_TEXT_BYTES else b""
        if data.startswith(_GZIP):
            with gzip.open(path) as packed:
                data = packed.read(MAX_TEXT_BYTES + 1)
    except (OSError, EOFError, zlib.error) as fault:
        raise DataError(f"{path}: cannot be read ({_reason(fault)}); was it copied whole?") from None
    if not data or len(data) > MAX_TEXT_BYTES:
        raise DataError(f"{path}: empty, or more than {MAX_TEXT_BYTES} bytes; split it into several files")
    return data


def read_text(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return a file's text with lines ended by a newline, and what is to be said of its encoding.

    Raises DataError for a binary file.
    """
    data, notes = read_bytes(path), ()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    elif b"\0" in data[:65536]:
        raise DataError(f"{path}: a binary file of a kind that is not read; write it as CSV, Parquet or MCAP")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")
            notes = (f"{path.name} is not UTF-8; it is read as Windows-1252",)
    return text.replace("\r\n", "\n").replace("\r", "\n"), notes


def _reason(fault: Exception) -> str:
    return getattr(fault, "strerror", None) or str(fault) or type(fault).__name__
