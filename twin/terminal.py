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


def cores() -> int:
    return os.cpu_count() or 1


@contextmanager
def working(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner with the present step; says so while the solver is compiled, which happens once."""
    from twin.equilibrium import is_compiled
    from twin.robots import compile_solver

    title = escape(str(plain(title)))
    with err.status(title) as status:
        if not is_compiled():
            status.update("compiling the solver, once on this machine (a minute or more)")
            compile_solver()
        status.update(title)
        yield lambda words: status.update(f"{title}: {words}")


def plain(words: str) -> Text:
    """Words of a file as they stand, without what would steer the terminal."""
    return Text("".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in words))


def command_line() -> str:
    return " ".join(["twin", *sys.argv[1:]])
