"""How often the diagnosis names what is wrong on days of the second independent simulator, tools/simulators/second_rod.

    python -m tools.benchmarks.diagnosis.second_bench_days DIR

DIR is what python -m tools.simulators.second_rod has written. Diagnoses DIR/sets/*, keeps a line a day in DIR/diagnosed.jsonl (a
day that is there is not run again), and prints each day's truth beside its verdict, then the totals. Errors are on held-out
trials, in mm of a marker: calibrated / after the effects / noise floor. Effects that such data hardly tell apart count as one.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from tools.benchmarks.diagnosis.answer import answer, errors_in_words, no_answer
from tools.benchmarks.diagnosis.attribution_table import flagged, same
from tools.benchmarks.table import Row, append_row, read_rows
from twin.foundation.errors import TwinError


def diagnose_days(folder: Path) -> list[Row]:
    """Return a row for every set of the folder, in order; what was not there before is added to the file."""
    log = folder / "diagnosed.jsonl"
    rows = {row["day"]: row for row in read_rows(log)}
    for path in sorted((folder / "sets").iterdir()):
        if path.name in rows:
            continue
        try:
            row, _ = answer(path, 1)
        except TwinError as error:
            row = no_answer(error)
        rows[path.name] = {"day": path.name, **row}
        append_row(log, rows[path.name])
        print(f"{path.name} diagnosed, {row.get('seconds', np.nan):.0f} s", flush=True)
    return [rows[name] for name in sorted(rows)]


def names(truth: dict[str, Any]) -> list[str]:
    """Return the true effects."""
    return [effect["id"] for effect in truth["effects"]]


def first_is_true(row: Row, effects: list[str]) -> bool:
    """Return whether the first claim is one of the true effects."""
    return bool(row["claims"]) and any(same(row["claims"][0], effect) for effect in effects)


def exact(row: Row, effects: list[str]) -> bool:
    """Return whether every claim goes with a true effect of its own, and none is left over."""
    left = list(effects)
    for claim in row["claims"]:
        match = next((effect for effect in left if same(claim, effect)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def kind(truth: dict[str, Any]) -> str:
    """Return "none", "one", "pair", or "odd" where a true effect is in no catalogue."""
    if any(not effect["known"] for effect in truth["effects"]):
        return "odd"
    return ("none", "one", "pair")[len(truth["effects"])]


def day_line(row: Row, truth: dict[str, Any]) -> str:
    """Return one day of the table."""
    effects = " + ".join(f"{e['id']} {e['size']['after_refit']:.1f}" for e in truth["effects"]) or "none"
    claims = ", ".join(f"{c} {p:.2f}" for c, p in zip(row["claims"], row["probability"], strict=True)) or "-"
    return f"{row['day']}  {truth['drive']:12}  {effects:48}  {row['verdict']:16}  {claims:56}  {errors_in_words(row)}"


def totals(pairs: list[tuple[Row, dict[str, Any]]]) -> list[str]:
    """Return counts over rows and their truths."""

    def count(of: str, hits: list[bool]) -> str:
        return f"{of:44}{sum(hits)}/{len(hits)}"

    by = {name: [(row, truth) for row, truth in pairs if kind(truth) == name] for name in ("none", "one", "pair", "odd")}
    over = [row["after"] / row["floor"] for row, _ in (*by["one"], *by["pair"]) if "after" in row]
    ratios = [f"{q:.2f}" for q in np.quantile(over, [0.5, 0.9])] if over else ["-"]
    return [
        count("false positives, no effect", [bool(row["claims"]) or row["verdict"] != "noise" for row, _ in by["none"]]),
        count("right effect first, one effect", [first_is_true(row, names(truth)) for row, truth in by["one"]]),
        count("exact set, one effect", [exact(row, names(truth)) for row, truth in by["one"]]),
        count("first is a true one, two effects", [first_is_true(row, names(truth)) for row, truth in by["pair"]]),
        count("exact set, two effects", [exact(row, names(truth)) for row, truth in by["pair"]]),
        count("out of catalogue, flagged", [flagged(row) for row, _ in by["odd"]]),
        f"{'held-out error over floor, known (median, 90 %)':48}{', '.join(ratios)}",
    ]


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Diagnose the days of a folder and print the table."""
    rows = diagnose_days(folder)
    pairs = [(row, json.loads((folder / "truth" / f"{row['day']}.json").read_text())) for row in rows]
    print("\n".join([*(day_line(*pair) for pair in pairs), "", *totals(pairs)]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
