"""Markdown tables, shares of cases, and rows kept as JSON lines so that a long run goes on where it stopped."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.foundation.parallel import run_parallel

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


def kept_rows(log: Path, work: Mapping[Any, Any], jobs: int, told: Callable[[Row], str]) -> list[Row]:
    """Run what has no row in a file yet, `jobs` tasks side by side, and return all rows of the file.

    `work` has the tasks (`joblib.delayed(...)(...)`) by the day of their row, or by the seed of a row without a day. Each row goes
    to the file as it comes, and what is told of it is printed.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    done = {row.get("day", row.get("seed")) for row in read_rows(log)}
    for row in run_parallel([task for key, task in work.items() if key not in done], jobs):
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(told(row), flush=True)
    return read_rows(log)


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
