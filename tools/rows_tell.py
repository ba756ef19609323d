"""What the rows of a bench day do not tell: the day as it was against the same day with commands that run straight from row to row.

    python -m tools.rows_tell SEED [SEED ...] --results results/attribution.jsonl

The true robot, effects and law in both; no noise. What differs is left by the best law there is, fed with what was logged. Of days
that `tools.attribution` has run; prints the error over the noise that it alone makes, beside that found on sealed trials.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.bench.amplitude import stack
from tools.bench.bench import run
from tools.bench.day import MISMATCH
from tools.bench.design import Day, bench_day
from tools.bench.effects import all_effects
from tools.bench.nuisance import built


def as_logged(day: Day) -> Day:
    """The day with every command as a straight line between the log's rows."""
    trials = [
        replace(t, command=np.stack([np.interp(t.fine, t.time, np.interp(t.time, t.fine, c)) for c in t.command.T], axis=1))
        for t in day.trials
    ]
    return replace(day, trials=tuple(trials))


def untold(row: dict) -> float:
    """RMS distance (m) of the markers between the two days of a row of results."""
    robot, motions, _, laws = (np.random.default_rng([row["seed"], n]) for n in range(4))
    rod, day = built(robot, spread=MISMATCH[row["mismatch"]]), bench_day(row["design"], motions)
    strength = {t["id"]: t["parameters"]["strength"] for t in row["truth"]}
    effects = [replace(all_effects()[name].draw(laws), strength=strength[name]) for name in row["true"]]
    real, straight = (stack(run(rod, effects, d), "marker") for d in (day, as_logged(day)))
    return float(np.sqrt(3.0 * np.mean((real - straight) ** 2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("seed", type=int, nargs="+")
    parser.add_argument("--results", type=Path, required=True)
    args = parser.parse_args()
    rows = {r["seed"]: r for r in map(json.loads, args.results.read_text().splitlines())}
    print(f"{'day':>7} {'effects':40} {'not told, mm':>12} {'that alone / floor':>19} {'found / floor':>14}")
    for seed in args.seed:
        row, floor = rows[seed], rows[seed]["floor"]
        left = untold(row)
        alone, found = float(np.hypot(left, floor)) / floor, row["after"] / floor
        print(f"{seed:>7} {' + '.join(row['true']):40} {1e3 * left:>12.2f} {alone:>19.2f} {found:>14.2f}", flush=True)


if __name__ == "__main__":
    main()
