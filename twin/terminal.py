"""What every command says and shows: the two consoles, a spinner with the present step, words of files without their teeth."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.text import Text

out = Console()
err = Console(stderr=True)
COMPILING = "compiling inner loops, once on this machine (half a minute or more)"


def cores() -> int:
    return os.cpu_count() or 1


@contextmanager
def working(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner with the present step; says so while inner loops are compiled, which happens once on a machine."""
    from twin.compiled import compiling

    title = step = escape(str(plain(title)))
    with err.status(title) as status:

        def now(words: str) -> None:
            nonlocal step
            step = f"{title}: {words}"
            status.update(step)

        with compiling(lambda on: status.update(f"{title}: {COMPILING}" if on else step)):
            yield now


def plain(words: str) -> Text:
    """Words of a file as they stand, without what would steer the terminal."""
    return Text("".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in words))


def command_line() -> str:
    return " ".join(["twin", *sys.argv[1:]])
