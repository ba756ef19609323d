"""Seconds a diagnosis takes with the machine to itself: days of `tools.attribution`, drawn by chance, one by one on all cores.

    python -m tools.diagnosis_speed RESULTS [--days 8] [--seed 0]

RESULTS is a folder of that benchmark. Prints a line a day and, for each kind of day, the median beside the benchmark's own, which
was with one core for each of several at once. Days driven by currents, which solve springs too, are a kind of their own. The solver
is compiled on a day that does not count.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import time
from pathlib import Path
from typing import Any

from twin.diagnose import Settings, diagnose
from twin.measurements import read
from twin.robots import load
from twin.twin import Twin


def kinds(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        found.setdefault("by current" if row["design"] == "by_current" else row["kind"], []).append(row)
    return found


def seconds(folder: Path) -> tuple[float, str]:
    recording = read(folder)
    began = time.perf_counter()
    found = diagnose(recording, Twin.of(load(recording.robot)), Settings())
    return time.perf_counter() - began, f"{found.verdict} {' + '.join(c.effect for c in found.claims)}"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    asked.add_argument("results", type=Path)
    asked.add_argument("--days", type=int, default=8, help="of each kind")
    asked.add_argument("--seed", type=int, default=0)
    args = asked.parse_args()
    lines = (args.results / "attribution.jsonl").read_text("utf-8").splitlines()
    made = [row for row in map(json.loads, lines) if "verdict" in row and (args.results / f"set_{row['seed']}").is_dir()]
    drawn = random.Random(args.seed)
    for kind, rows in sorted(kinds(made).items()):
        picked = drawn.sample(rows, min(args.days, len(rows)))
        seconds(args.results / f"set_{picked[0]['seed']}")
        took = []
        for row in picked:
            spent, said = seconds(args.results / f"set_{row['seed']}")
            took.append(spent)
            print(f"  {row['seed']} {row['design']}, {' + '.join(row['true']) or 'no effect'}: {spent:.1f} s, {said}", flush=True)
        before = statistics.median(row["seconds"] for row in picked)
        print(f"{kind}: {statistics.median(took):.1f} s (median of {len(took)}; {before:.1f} in the benchmark)", flush=True)


if __name__ == "__main__":
    main()
