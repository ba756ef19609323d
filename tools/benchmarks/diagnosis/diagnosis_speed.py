"""Seconds a diagnosis takes with the machine to itself, on days of the attribution benchmark drawn by chance.

    python -m tools.benchmarks.diagnosis.diagnosis_speed RESULTS [--days 8] [--seed 0]

RESULTS is a folder of tools.benchmarks.diagnosis.attribution. Days are diagnosed one by one on all cores. Prints a line a day
and, for each kind of day, the median beside the benchmark's own, which had one core for each of several days at once. Days driven
by currents, which solve springs too, are a kind of their own. The solver is compiled on a day that does not count.
"""

from __future__ import annotations

import random
import statistics
import time
from pathlib import Path

import tyro

from tools.benchmarks.diagnosis.answer import in_words
from tools.benchmarks.table import Row, read_rows
from twin.diagnosis import Settings, diagnose
from twin.measurements import read
from twin.prediction.twin import Twin


def kinds(rows: list[Row]) -> dict[str, list[Row]]:
    """Return rows by the kind of their day."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault("by current" if row["design"] == "by_current" else row["kind"], []).append(row)
    return found


def seconds(folder: Path) -> tuple[float, str]:
    """Return the seconds of a diagnosis on all cores, and its verdict and claims."""
    recording = read(folder)
    began = time.perf_counter()
    found = diagnose(recording, Twin.of(recording.robot), Settings())
    return time.perf_counter() - began, in_words({"verdict": found.verdict, "claims": [c.effect for c in found.claims]})


def main(results: tyro.conf.Positional[Path], days: int = 8, seed: int = 0) -> None:
    """Time so many days of each kind."""
    made = [r for r in read_rows(results / "attribution.jsonl") if (results / f"set_{r['seed']}").is_dir()]
    drawn = random.Random(seed)
    for kind, rows in sorted(kinds(made).items()):
        picked = drawn.sample(rows, min(days, len(rows)))
        seconds(results / f"set_{picked[0]['seed']}")
        took = []
        for row in picked:
            spent, said = seconds(results / f"set_{row['seed']}")
            took.append(spent)
            print(f"  {row['seed']} {row['design']}, {' + '.join(row['true']) or 'no effect'}: {spent:.1f} s, {said}", flush=True)
        before = statistics.median(row.get("seconds", 0.0) for row in picked)
        print(f"{kind}: {statistics.median(took):.1f} s (median of {len(took)}; {before:.1f} in the benchmark)", flush=True)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
