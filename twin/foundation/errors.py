"""The errors a user sees: each names what came, what is allowed and the way out."""

import difflib
from collections.abc import Iterable


class TwinError(Exception):
    """Base of all errors of the twin; the command line prints it as one line and exits with 2."""


class DataError(TwinError):
    """A measurement set, twin or robot file breaks its contract; names the file, and the row and column if any."""


class UnknownNameError(TwinError):
    """A robot, effect, channel or parameter that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str], alternative: str = "") -> None:
        """`alternative` is added to the list of known names, such as ", or a path"."""
        known = sorted(known)
        super().__init__(
            f"no {kind} named {short_repr(name)}; available: {', '.join(known) or 'none'}{alternative}{did_you_mean(name, known)}"
        )


class SolveError(TwinError):
    """The statics or dynamics found no solution; says where it stopped and what usually helps."""

    def __init__(self, message: str, sample: int | None = None) -> None:
        """`sample` (from 0) is the trial's first sample without a solution, where that is known."""
        super().__init__(message)
        self.sample = sample


def short_repr(value: object, longest: int = 60) -> str:
    """Return a value as one short line for a message."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deep, or a whole number of thousands of digits
        text = f"a {type(value).__name__} too long to show"
    return text if len(text) <= longest else text[: longest - 3] + "..."


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return `; did you mean 'x'?` if a known name is close to `name`, else an empty string."""
    spelt = {each.lower(): each for each in known}
    close = difflib.get_close_matches(name[:100].lower(), list(spelt), n=1, cutoff=0.75)
    return f"; did you mean {spelt[close[0]]!r}?" if close else ""


def join_problems(problems: list[str]) -> str:
    """Return all problems of a file in one line, the first 20 in full."""
    if len(problems) == 1:
        return problems[0]
    shortened = [*problems[:20], *([f"{len(problems) - 20} more"] if len(problems) > 20 else [])]
    return f"{len(problems)} things are wrong: " + "; ".join(f"({n}) {problem}" for n, problem in enumerate(shortened, 1))
