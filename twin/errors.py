"""The one family of errors a user meets: each names what came, what is allowed and the way out."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class TwinError(Exception):
    """Base of every error the twin raises on purpose; the command line prints it as one line and exits with 2."""


class DataError(TwinError):
    """A measurement set, twin or robot file that breaks its contract; names the file, and the row and column if any."""


class UnknownNameError(TwinError):
    """A robot, effect, channel or parameter that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str], besides: str = "") -> None:
        """`besides` says what else would do."""
        known = sorted(known)
        super().__init__(
            f"no {kind} named {shown(name)}; available: {', '.join(known) or 'none'}{besides}{did_you_mean(name, known)}"
        )


class SolveError(TwinError):
    """The statics or dynamics found no answer; says where it stopped and what usually helps."""

    def __init__(self, words: str, sample: int | None = None) -> None:
        """`sample` (from 0) is the first of a trial without an answer, where that is known."""
        super().__init__(words)
        self.sample = sample


def shown(value: object, longest: int = 60) -> str:
    """What came, in one short line for a message."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deep, or a whole number of thousands of digits
        text = f"a {type(value).__name__} too long to show"
    return text if len(text) <= longest else text[: longest - 3] + "..."


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?` where a known name is close to `name`, else nothing."""
    spelt = {each.lower(): each for each in known}
    close = difflib.get_close_matches(name[:100].lower(), list(spelt), n=1, cutoff=0.75)
    return f"; did you mean {spelt[close[0]]!r}?" if close else ""


def listed(problems: list[str]) -> str:
    """All that is wrong with a file in one line."""
    if len(problems) == 1:
        return problems[0]
    shortened = [*problems[:20], *([f"{len(problems) - 20} more"] if len(problems) > 20 else [])]
    return f"{len(problems)} things are wrong: " + "; ".join(f"({n}) {problem}" for n, problem in enumerate(shortened, 1))
