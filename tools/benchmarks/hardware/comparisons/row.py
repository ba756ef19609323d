"""One line of the table of bars."""

from dataclasses import dataclass

from twin.diagnosis import Settings

SETTINGS = Settings(jobs=1)


@dataclass(frozen=True)
class Row:
    """A bar: what was asked, what came out, both in words, and whether it was met (None: a line without a bar)."""

    what: str
    must: str
    aim: str
    measured: str
    met: bool | None
    aimed: bool | None = None

    def cells(self) -> tuple[str, str, str, str, str]:
        verdict = "" if self.met is None else "aim" if self.aimed else "met" if self.met else "MISSED"
        return self.what, self.must, self.aim, self.measured, verdict
