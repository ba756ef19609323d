"""What libraries warn of and log: one plain line each on the terminal, or nothing."""

import logging
import os
import sys
import warnings
from typing import TextIO

import rich

from twin.cli.terminal import err

FOR_DEVELOPERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ImportWarning, ResourceWarning)
DROPPED_LOGS = ("websockets", "asyncio")  # browsers open connections ahead and drop those they do not need


def route_library_messages() -> None:
    """Show every warning and log record of a library as one plain line, once; those for developers not at all.

    Where Python was given `-W` or PYTHONWARNINGS, warnings stay as they are. Errors are not touched.
    """
    if not sys.warnoptions:
        warnings.showwarning = _show_warning
        os.environ["PYTHONWARNINGS"] = "ignore"  # worker processes have no line of their own; their errors come back to this one
    logging.lastResort = _OneLine(logging.WARNING)
    rich.get_console().quiet = True  # viser prints through it that its server has stopped


def _show_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: TextIO | None = None, line: str | None = None
) -> None:
    """Take the place of `warnings.showwarning`, whose arguments these are."""
    if not issubclass(category, FOR_DEVELOPERS) and not category.__module__.startswith("numba."):
        _note(str(message))


class _OneLine(logging.Handler):
    """Take log records that no other handler takes."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.name.partition(".")[0] not in DROPPED_LOGS:
            _note(record.getMessage())


_shown: set[str] = set()


def _note(text: str) -> None:
    first = text.strip().partition("\n")[0].strip()
    if first and first not in _shown:
        _shown.add(first)
        err.print(f"note: {first}", markup=False, highlight=False, soft_wrap=True)
