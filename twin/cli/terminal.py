"""The terminal: two consoles, a spinner with the present step, and output in any encoding."""

import codecs
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.text import Text

out = Console()
err = Console(stderr=True)
COMPILING_NOTE = "compiling inner loops, once on this machine (half a minute or more)"
REPLACEMENTS = {  # characters of our own texts that small encodings lack
    "±": "+/-", "−": "-", "–": "-", "°": " deg", "²": "^2", "×": "x", "→": "->", "·": "-", "•": "*", "…": "...",  # noqa: RUF001
}  # fmt: skip


def accept_any_encoding() -> None:
    """Replace characters that the encoding of the terminal or file lacks, rather than fail on them."""
    codecs.register_error("twin", _replace)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="twin")


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(REPLACEMENTS.get(c, "?") for c in error.object[error.start : error.end]), error.end


def cpu_count() -> int:
    """Return the number of processor cores."""
    return os.cpu_count() or 1


@contextmanager
def show_progress(title: str) -> Iterator[Callable[[str], None]]:
    """Show a spinner with the present step, or that inner loops are being compiled."""
    from twin.foundation.compiled import report_compiling

    title = step = escape(str(printable(title)))
    spinner = "dots" if err.encoding.startswith("utf") else "line"
    with err.status(title, spinner=spinner) as status:

        def now(words: str) -> None:
            nonlocal step
            step = f"{title}: {words}"
            status.update(step)

        with report_compiling(lambda on: status.update(f"{title}: {COMPILING_NOTE}" if on else step)):
            yield now


def printable(words: str) -> Text:
    """Return words of a file without characters that would control the terminal."""
    return Text("".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in words))


def command_line() -> str:
    """Return the command line of this run."""
    return " ".join(["twin", *sys.argv[1:]])
