"""How often the diagnosis names what is wrong on days of the second independent simulator, tools/simulators/second_rod.

    python -m tools.benchmarks.diagnosis.days.second_bench_days DIR

DIR is what python -m tools.simulators.second_rod has written. Diagnoses DIR/sets/*, keeps a line a day in DIR/diagnosed.jsonl (a
day that is there is not run again), and prints each day's truth beside its verdict, then the totals. Errors are on held-out
trials, in mm of a marker: calibrated / after the effects / noise floor. Effects that such data hardly tell apart count as one.
"""

import json
from pathlib import Path

import numpy as np
import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.answer import answer, errors_in_words, no_answer
from tools.benchmarks.diagnosis.days.attribution_table import first, flagged, same
from tools.benchmarks.table import Row, kept_rows
from twin.foundation.errors import TwinError


def true_row(day: Path) -> Row:
    """Return what is true of a day that the simulator wrote: its name, drive, kind and effects, and their sizes in sigma."""
    truth = json.loads((day.parent.parent / "truth" / f"{day.name}.json").read_text())
    effects = truth["effects"]
    kind = "unknown" if not all(e["known"] for e in effects) else ("none", "one", "pair")[len(effects)]
    return {
        "day": day.name, "drive": truth["drive"], "kind": kind, "true": [e["id"] for e in effects],
        "sigmas": [e["size"]["after_refit"] for e in effects],
    }  # fmt: skip


def diagnosed(day: Path) -> Row:
    """Return the answer on a day."""
    try:
        return {"day": day.name, **answer(day, 1)[0]}
    except TwinError as error:
        return {"day": day.name, **no_answer(error)}


def exact(row: Row) -> bool:
    """Return whether every claim goes with a true effect of its own, and none is left over."""
    left = list(row["true"])
    for claim in row["claims"]:
        match = next((effect for effect in left if same(claim, effect)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def day_line(row: Row) -> str:
    """Return one day of the table."""
    effects = " + ".join(f"{name} {sigma:.1f}" for name, sigma in zip(row["true"], row["sigmas"], strict=True)) or "none"
    claims = ", ".join(f"{c} {p:.2f}" for c, p in zip(row["claims"], row["probability"], strict=True)) or "-"
    return f"{row['day']}  {row['drive']:12}  {effects:48}  {row['verdict']:16}  {claims:56}  {errors_in_words(row)}"


def totals(rows: list[Row]) -> list[str]:
    """Return counts over rows that have their truths."""

    def count(of: str, hits: list[bool]) -> str:
        return f"{of:44}{sum(hits)}/{len(hits)}"

    by = {kind: [row for row in rows if row["kind"] == kind] for kind in ("none", "one", "pair", "unknown")}
    over = [row["after"] / row["floor"] for row in (*by["one"], *by["pair"]) if "after" in row]
    ratios = [f"{q:.2f}" for q in np.quantile(over, [0.5, 0.9])] if over else ["-"]
    return [
        count("false positives, no effect", [bool(row["claims"]) or row["verdict"] != "noise" for row in by["none"]]),
        count("right effect first, one effect", [first(row) for row in by["one"]]),
        count("exact set, one effect", [exact(row) for row in by["one"]]),
        count("first is a true one, two effects", [first(row) for row in by["pair"]]),
        count("exact set, two effects", [exact(row) for row in by["pair"]]),
        count("out of catalogue, flagged", [flagged(row) for row in by["unknown"]]),
        f"{'held-out error over floor, known (median, 90 %)':48}{', '.join(ratios)}",
    ]


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Diagnose the days of a folder and print the table."""
    days = {day.name: day for day in sorted((folder / "sets").iterdir())}
    work = {name: delayed(diagnosed)(day) for name, day in days.items()}

    def told(row: Row) -> str:
        return f"{row['day']} diagnosed, {row.get('seconds', np.nan):.0f} s"

    found = {row["day"]: row for row in kept_rows(folder / "diagnosed.jsonl", work, 1, told)}
    rows = [found[name] | true_row(day) for name, day in days.items()]
    print("\n".join([*(day_line(row) for row in rows), "", *totals(rows)]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
