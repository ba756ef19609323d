"""What importers share: an account of every sample left out."""

from dataclasses import dataclass, field


@dataclass
class Dropped:
    """Samples left out, by file and reason."""

    rows: list[tuple[str, str, int, int]] = field(default_factory=list)

    def count(self, file: str, reason: str, dropped: int, of: int) -> None:
        self.rows.append((file, reason, dropped, of))

    def __str__(self) -> str:
        told = [f"  {file}: {n}{f' of {of}' if of else ''} samples dropped, {reason}" for file, reason, n, of in self.rows if n]
        total, of = sum(r[2] for r in self.rows), sum(r[3] for r in self.rows)
        return "\n".join([*told, f"  {total} of {of} samples dropped in all"])
