"""What a diagnosis is worth to a policy: trained on described, calibrated and diagnosed twins, tried on the bench robot.

    python -m tools.benchmarks.tasks.policy_table --out results/ [--seeds 5] [--jobs 1] [--table-only]

Days of four effects that nobody declared (policy/days.py) are made, calibrated and diagnosed; a policy is trained on each twin by
`tools.examples.reach_policy`, with and without a tip camera, and tried on 50 goals of the robot of its day, which the independent
rod simulator stands for (policy/bench_reach.py). Inverse kinematics on the same twins stands beside it. A goal counts as reached
where the true tip is within 5 mm of it at the end of an episode of 4 s. One file a cell: an interrupted run goes on.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from joblib import Parallel, delayed

from tools.benchmarks.table import markdown
from tools.benchmarks.tasks.policy.cells import Cell, plan, run
from tools.benchmarks.tasks.policy.days import EFFECT_DAYS, TWIN_KINDS, prepare

REACHED_WITHIN, REACHED_WITHIN_OWN = 5e-3, 3e-3  # m
Results = dict[Cell, dict[str, Any]]


def kept(out: Path, seeds: int) -> Results:
    """What has been done of the plan."""
    return {c: json.loads((out / c.file).read_text()) for c in plan(seeds) if (out / c.file).is_file()}


def reached(distance: list[float], near: float = REACHED_WITHIN) -> float:
    return 100.0 * float(np.mean(np.array(distance) < near))


def shares(results: Results, twin: str, effect: str, blind: bool, inverse: bool = False) -> list[float]:
    """Per cent of goals reached on the robot of that day, a number a seed."""
    return [
        reached(r["bench"][effect])
        for c, r in results.items()
        if (c.twin, c.blind, c.seed is None) == (twin, blind, inverse) and effect in c.days
    ]


def shown(values: list[float]) -> str:
    """Mean and, of several, the range."""
    if not values:
        return ""
    spread = f" ({min(values):.0f} to {max(values):.0f})" if len(values) > 1 else ""
    return f"{np.mean(values):.0f}{spread}"


def table(results: Results, blind: bool) -> str:
    """Return a Markdown table: a row an effect."""
    columns = [(twin, False) for twin in TWIN_KINDS] + [(twin, True) for twin in TWIN_KINDS[:3]]
    heads = ["load cells only" if blind else "load cells and tip camera", *TWIN_KINDS, *(f"IK, {t}" for t in TWIN_KINDS[:3])]
    heads[0] += ", % within 5 mm"
    cells = [[shares(results, twin, effect, blind, inverse) for twin, inverse in columns] for effect in EFFECT_DAYS]
    rows = [[effect.replace("_", " "), *map(shown, row)] for effect, row in zip(EFFECT_DAYS, cells, strict=True)]
    means = [f"{np.mean([np.mean(of) for of in column]):.0f}" if all(column) else "" for column in zip(*cells, strict=True)]
    return markdown(heads, [*rows, ["mean of the four", *means]])


def at_home(results: Results, blind: bool) -> str:
    """How the policies do on the twins they were trained on."""
    found = [reached(r["own"], REACHED_WITHIN_OWN) for c, r in results.items() if c.seed is not None and c.blind == blind]
    what = "load cells only" if blind else "with the camera"
    return f"{what}: within 3 mm on its own twin {np.mean(found):.1f} %, least {min(found):.0f} % of {len(found)} policies"


def main(out: Path, seeds: int = 5, jobs: int = 1, table_only: bool = False) -> None:
    """Train and try what is missing, and print the tables."""
    if not table_only:
        (out / "days").mkdir(parents=True, exist_ok=True)
        work = Parallel(jobs)
        work(delayed(prepare)(effect, out / "days") for effect in EFFECT_DAYS)
        work(delayed(run)(cell, out) for cell in plan(seeds))
    results = kept(out, seeds)
    for blind in (False, True):
        print(f"\n{table(results, blind)}\n")
    for blind in (False, True):
        if any(c.seed is not None and c.blind == blind for c in results):
            print(at_home(results, blind))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
