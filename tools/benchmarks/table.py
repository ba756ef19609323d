"""Markdown tables, shares of cases, and rows kept as JSON lines so that a long run goes on where it stopped."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def read_rows(log: Path) -> list[Row]:
    """Return the rows kept in a file, none where it is absent; a line that was cut off in the writing is skipped."""
    rows = []
    for line in log.read_text("utf-8").splitlines() if log.exists() else ():
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    return rows


def append_row(log: Path, row: Row) -> None:
    """Add a row to a file."""
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")


def share(hits: Sequence[bool]) -> str:
    """Return how many of the cases hold, and per cent."""
    return f"{sum(hits)}/{len(hits)}" + (f" {100 * sum(hits) / len(hits):.0f} %" if hits else "")


def line(*cells: object) -> str:
    """Return one row of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def head(*cells: object) -> str:
    """Return the first two rows of a Markdown table."""
    return line(*cells) + "\n" + "|---" * len(cells) + "|"


def markdown(heads: Sequence[object], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table."""
    return "\n".join([head(*heads), *(line(*row) for row in rows)])
