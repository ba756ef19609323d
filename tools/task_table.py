"""Tasks of the hand, scored: a policy on shapes against one on raw strains, on the hand shown, on another, and on one that drifts.

    python -m tools.task_table --data DIR --out results/ [--seeds 1] [--trials 20] [--jobs 1] [--only hold-] [--table-only]

DIR holds what `twin demonstrate TASK --n 50 --seed 1 --out DIR/TASK` made, of each task that is to be scored. Trials are those of
seed 2000. A cell is a task, a way, a case and a training seed; one file each, with what became of its trials and what it was made
with: an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twin.learn import lerobot
from twin.learn.demonstrate import read, write_json
from twin.learn.imitate import DRIFT, Actor, learn
from twin.learn.teach import Lesson, digest
from twin.learn.ways import way
from twin.report import stamp
from twin.robots import load
from twin.tasks import Outcome, task, tasks

FORMAT = "twin-task-cell/1"
TRIALS_OF, OTHER = 2000, 2  # seeds
CASES = {"shown": "the hand shown", "other": "another built hand", "drifting": "drifting", "undone": "drifting, undone"}
WAYS = ("shape", "strain")
COLUMNS = [
    ("nearest", "shape", "shown"),
    *(("diffusion", way, case) for case in CASES for way in WAYS if (way, case) != ("strain", "undone")),  # strains are tared
]


@dataclass(frozen=True)
class Cell:
    task: str
    policy: str
    way: str
    case: str
    train_seed: int

    @property
    def file(self) -> str:
        return f"{self.task}-{self.policy}-{self.way}-{self.case}-{self.train_seed}.json"


def plan(data: Path, seeds: int) -> list[Cell]:
    """All cells of what is shown in `data`, those of the first training seed first; the nearest frame has no seed."""
    shown = [name for name in tasks() if (data / name).is_dir()]
    return [
        Cell(name, *column, seed)
        for seed in range(seeds)
        for column in COLUMNS
        for name in shown
        if column[0] != "nearest" or not seed
    ]


def score(cell: Cell, data: Path, trials: int, jobs: int) -> dict[str, Any]:
    folder = data / cell.task
    hand = OTHER if cell.case == "other" else read(folder)["seed"]
    policy = learn(Lesson(cell.policy, cell.way, cell.train_seed), folder, print)
    drift = DRIFT if cell.case in ("drifting", "undone") else 0.0
    actor = Actor(task(cell.task), load("hand"), hand, cell.way, policy, drift, cell.case == "undone")
    outcomes = dict(actor.score(trials, TRIALS_OF, jobs))
    law = way(cell.way)
    data_hash = digest([law.shown(episode) for episode in lerobot.read_episodes(folder, law.columns)])
    made_with = stamp(" ".join(["python -m tools.task_table", *sys.argv[1:]]), TRIALS_OF, data_hash, ("torch", "diffusers"))
    return {"format": FORMAT, **asdict(cell), "hand": hand, "trials": trials, "outcomes": outcomes, "provenance": made_with}


def table(results: dict[Cell, Counter[str]]) -> str:
    """Markdown: a row a task, per cent of all trials of all training seeds, and the mean of the tasks."""
    names = sorted({c.task for c in results})
    heads = [f"{policy}, {way}, {CASES[case]}" for policy, way, case in COLUMNS]
    lines = [f"| success, % | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    rows = []
    for name in names:
        found = [[r for c, r in results.items() if (c.task, c.policy, c.way, c.case) == (name, *column)] for column in COLUMNS]
        sums = [sum(each, Counter()) for each in found]
        rows.append([100.0 * s[Outcome.SUCCESS] / s.total() if s else np.nan for s in sums])
        lines.append(f"| {name} | " + " | ".join(said(x) for x in rows[-1]) + " |")
    means = np.mean(rows, axis=0) if rows else []
    return "\n".join([*lines, "| mean | " + " | ".join(said(x) for x in means) + " |"])


def said(share: float) -> str:
    return "" if np.isnan(share) else f"{share:.0f}"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--data", type=Path, required=True)
    asked.add_argument("--out", type=Path, required=True)
    asked.add_argument("--seeds", type=int, default=1)
    asked.add_argument("--trials", type=int, default=20)
    asked.add_argument("--jobs", type=int, default=1)
    asked.add_argument("--only", default="", help="cells whose file begins so")
    asked.add_argument("--table-only", action="store_true")
    given = asked.parse_args()
    cells = plan(given.data, given.seeds)
    for cell in cells:
        path = given.out / cell.file
        if not given.table_only and cell.file.startswith(given.only) and not path.exists():
            write_json(path, score(cell, given.data, given.trials, given.jobs))
            print(cell.file, json.loads(path.read_text("utf-8"))["outcomes"], flush=True)
    there = {c: given.out / c.file for c in cells if (given.out / c.file).exists()}
    print(table({c: Counter(json.loads(path.read_text("utf-8"))["outcomes"]) for c, path in there.items()}))


if __name__ == "__main__":
    main()
