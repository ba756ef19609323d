"""The one family of errors a user meets: each names what came, what is allowed and the way out."""


class TwinError(Exception):
    """Base of every error the twin raises on purpose; the command line prints it as one line and exits with 2."""


class DataError(TwinError):
    """A measurement set, twin or robot file that breaks its contract; names the file, and the row and column if any."""


class UnknownNameError(TwinError):
    """A robot, effect, channel or parameter that does not exist."""

    def __init__(self, kind: str, name: str, known: "list[str] | tuple[str, ...]") -> None:
        super().__init__(f"no {kind} named {name!r}; available: {', '.join(sorted(known)) or 'none'}")


class SolveError(TwinError):
    """The statics or dynamics found no answer; says where it stopped and what usually helps."""
