"""Tasks of the hand, scored: a policy on shapes against one on raw strains, on the hand shown, on another, and on one that drifts.

    python -m tools.benchmarks.tasks.table --data DIR --out results/ [--seeds 1] [--trials 20] [--jobs 1] [--only hold-]

DIR holds what `twin demonstrate TASK --n 50 --seed 1 --out DIR/TASK` made, of each task that is to be scored. Trials are those of
seed 2000. A cell is a task, a way, a case and a training seed; one file each, with what became of its trials and what it was made
with: an interrupted run goes on.
"""

import json
import sys
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from tools.benchmarks.table import markdown
from twin.prediction.provenance import run_provenance
from twin.robots import load
from twin.tasks import Outcome, make_task, tasks
from twin.tasks.imitation import lerobot
from twin.tasks.imitation.demonstrate import read_order, write_json
from twin.tasks.imitation.imitate import LARGEST_DRIFT, PolicyRunner, make_policy
from twin.tasks.imitation.policy_training import PolicyTrainingSpec, hash_demonstrations
from twin.tasks.imitation.representations import representation_class

FORMAT = "twin-task-cell/1"
TRIALS_OF, OTHER_HAND_SEED = 2000, 2  # seeds
HAND_CASES = {"shown": "the hand shown", "other": "another built hand", "drifting": "drifting", "undone": "drifting, undone"}
POLICY_INPUTS = ("shape", "strain")
COLUMNS = [
    ("nearest", "shape", "shown"),
    *(
        ("diffusion", way, case) for case in HAND_CASES for way in POLICY_INPUTS if (way, case) != ("strain", "undone")
    ),  # strains are tared
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
    hand = OTHER_HAND_SEED if cell.case == "other" else read_order(folder)["seed"]
    policy = make_policy(PolicyTrainingSpec(cell.policy, cell.way, cell.train_seed), folder, print)
    drift = LARGEST_DRIFT if cell.case in ("drifting", "undone") else 0.0
    actor = PolicyRunner(make_task(cell.task), load("hand"), hand, cell.way, policy, drift, cell.case == "undone")
    outcomes = dict(actor.score(trials, TRIALS_OF, jobs))
    law = representation_class(cell.way)
    data_hash = hash_demonstrations([law.from_demonstration(episode) for episode in lerobot.read_episodes(folder, law.columns)])
    made_with = run_provenance(
        " ".join(["python -m tools.benchmarks.tasks.table", *sys.argv[1:]]), TRIALS_OF, data_hash, ("torch", "diffusers")
    )
    return {"format": FORMAT, **asdict(cell), "hand": hand, "trials": trials, "outcomes": outcomes, "provenance": made_with}


def table(results: dict[Cell, Counter[str]]) -> str:
    """Return a Markdown table: a row a task, per cent of all trials of all training seeds, and the mean of the tasks."""
    shares = {}
    for name in sorted({c.task for c in results}):
        found = [[r for c, r in results.items() if (c.task, c.policy, c.way, c.case) == (name, *column)] for column in COLUMNS]
        sums = [sum(each, Counter()) for each in found]
        shares[name] = [100.0 * s[Outcome.SUCCESS] / s.total() if s else np.nan for s in sums]
    shares["mean"] = np.mean(list(shares.values()), axis=0) if shares else []
    heads = [f"{policy}, {way}, {HAND_CASES[case]}" for policy, way, case in COLUMNS]
    return markdown(
        ["success, %", *heads], [[name, *("" if np.isnan(x) else f"{x:.0f}" for x in row)] for name, row in shares.items()]
    )


def main(data: Path, out: Path, seeds: int = 1, trials: int = 20, jobs: int = 1, only: str = "", table_only: bool = False) -> None:
    """Score what is missing, of cells whose file begins with `only`, and print the table."""
    cells = plan(data, seeds)
    for cell in cells:
        path = out / cell.file
        if not table_only and cell.file.startswith(only) and not path.exists():
            write_json(path, score(cell, data, trials, jobs))
            print(cell.file, json.loads(path.read_text("utf-8"))["outcomes"], flush=True)
    there = {c: out / c.file for c in cells if (out / c.file).exists()}
    print(table({c: Counter(json.loads(path.read_text("utf-8"))["outcomes"]) for c, path in there.items()}))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
