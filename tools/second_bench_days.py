"""How often the diagnosis names what is wrong on days of the second bench, tools/second_bench.

    python -m tools.second_bench_days DIR

Diagnoses DIR/sets/*, keeps a line a day in DIR/diagnosed.jsonl (a day that is there is not run again), and prints each day's truth
beside its verdict, then the totals. Errors are on sealed trials, in mm of a marker: calibrated / after the effects / noise floor.
Effects that such data hardly tell apart count as one (attribution_table.py).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from tools.attribution_table import same
from twin.diagnose import Diagnosis, Settings, diagnose
from twin.errors import TwinError
from twin.measurements import read
from twin.robots import load
from twin.twin import Twin

FLAGS = ("unexplained", "partly_explained")


def told(found: Diagnosis) -> dict[str, Any]:
    """What is kept of a diagnosis."""
    errors = found.errors
    return {
        "verdict": found.verdict,
        "claims": [
            {
                "id": claim.effect,
                "probability": claim.probability,
                "parameters": {name: [fit.value, fit.std] for name, fit in claim.parameters.items()},
            }
            for claim in found.claims
        ],
        "small": [claim.effect for claim in found.below_materiality],
        "ambiguous": [list(names) for names in found.ambiguous],
        "errors": [1e3 * error["marker"] for error in (errors.calibrated, errors.after, errors.floor)],
        "structure": [found.structure_before, found.structure_after, found.structure_unseen],
        "description": found.description,
    }


def diagnosed(folder: Path) -> list[dict[str, Any]]:
    """A row for every set of the folder, in order; what was not there before is added to the file."""
    kept = folder / "diagnosed.jsonl"
    rows = {row["day"]: row for row in map(json.loads, kept.read_text().splitlines())} if kept.exists() else {}
    for path in sorted((folder / "sets").iterdir()):
        if path.name in rows:
            continue
        began = time.process_time()
        try:
            answer = told(diagnose(read(path), Twin.of(load("continuum")), Settings(seed=1, jobs=1)))
        except TwinError as error:
            answer = {"verdict": "no answer", "claims": [], "errors": [], "description": str(error)}
        row = {"day": path.name, **answer, "seconds": time.process_time() - began}
        with kept.open("a") as file:
            file.write(json.dumps(row) + "\n")
        rows[path.name] = row
        print(f"{path.name} diagnosed, {row['seconds']:.0f} s", flush=True)
    return [rows[name] for name in sorted(rows)]


def claims(row: dict[str, Any]) -> list[str]:
    return [claim["id"] for claim in row["claims"]]


def true(truth: dict[str, Any]) -> list[str]:
    return [effect["id"] for effect in truth["effects"]]


def first(row: dict[str, Any], effects: list[str]) -> bool:
    """Whether the first claim is one of the true effects."""
    named = claims(row)
    return bool(named) and any(same(named[0], effect) for effect in effects)


def exact(row: dict[str, Any], effects: list[str]) -> bool:
    """Whether every claim goes with a true effect of its own, and none is left over."""
    left = list(effects)
    for claim in claims(row):
        match = next((effect for effect in left if same(claim, effect)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def kind(truth: dict[str, Any]) -> str:
    if any(not effect["known"] for effect in truth["effects"]):
        return "odd"
    return ("none", "one", "pair")[len(truth["effects"])]


def line(row: dict[str, Any], truth: dict[str, Any]) -> str:
    """One day of the table."""
    effects = " + ".join(f"{e['id']} {e['size']['after_refit']:.1f}" for e in truth["effects"]) or "none"
    named = ", ".join(f"{claim['id']} {claim['probability']:.2f}" for claim in row["claims"]) or "-"
    errors = " / ".join(f"{error:.2f}" for error in row["errors"])
    return f"{row['day']}  {truth['drive']:12}  {effects:48}  {row['verdict']:16}  {named:56}  {errors}"


def totals(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> list[str]:
    """Counts over rows and their truths."""

    def count(of: str, hits: list[bool]) -> str:
        return f"{of:44}{sum(hits)}/{len(hits)}"

    by = {name: [(row, truth) for row, truth in pairs if kind(truth) == name] for name in ("none", "one", "pair", "odd")}
    over = [row["errors"][1] / row["errors"][2] for row, _ in (*by["one"], *by["pair"]) if row["errors"]]
    ratios = [f"{q:.2f}" for q in np.quantile(over, [0.5, 0.9])] if over else ["-"]
    return [
        count("false positives, no effect", [bool(claims(row)) or row["verdict"] != "noise" for row, _ in by["none"]]),
        count("right effect first, one effect", [first(row, true(truth)) for row, truth in by["one"]]),
        count("exact set, one effect", [exact(row, true(truth)) for row, truth in by["one"]]),
        count("first is a true one, two effects", [first(row, true(truth)) for row, truth in by["pair"]]),
        count("exact set, two effects", [exact(row, true(truth)) for row, truth in by["pair"]]),
        count("out of catalogue, flagged", [row["verdict"] in FLAGS for row, _ in by["odd"]]),
        f"{'sealed error over floor, known (median, 90 %)':46}{', '.join(ratios)}",
    ]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path, metavar="DIR", help="as written by python -m tools.second_bench")
    folder = asked.parse_args().folder
    rows = diagnosed(folder)
    pairs = [(row, json.loads((folder / "truth" / f"{row['day']}.json").read_text())) for row in rows]
    print("\n".join([*(line(*pair) for pair in pairs), "", *totals(pairs)]))


if __name__ == "__main__":
    main()
