"""One change of one line."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """Line `number` (from 1) of `file`, which reads `old`, is to read `new`; `kind` says by which operator."""

    file: str
    number: int
    old: str
    new: str
    kind: str

    @property
    def key(self) -> str:
        return f"{self.file}: {self.old.strip()} -> {self.new.strip()}"

    def applied(self, text: str) -> str:
        """The file's text with the change. Raises ValueError where the line reads otherwise."""
        lines = text.split("\n")
        if lines[self.number - 1] != self.old:
            raise ValueError(f"{self.file}:{self.number} reads {lines[self.number - 1]!r}, not {self.old!r}")
        lines[self.number - 1] = self.new
        return "\n".join(lines)

    @staticmethod
    def of(file: str, text: str, old: str, new: str) -> Mutant:
        """The first line that holds `old`, with `new` in its place. Raises ValueError where there is none."""
        for number, line in enumerate(text.split("\n"), 1):
            if old in line:
                return Mutant(file, number, line, line.replace(old, new, 1), "by hand")
        raise ValueError(f"{file} has no line with {old!r}")
