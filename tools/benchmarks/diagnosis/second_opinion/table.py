"""The answers of all opinions side by side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tools.benchmarks.diagnosis.attribution_table import exact, first
from twin.effects import catalogue


def table(rows: list[dict]) -> str:
    """Return the table, one column an opinion; effects are compared by class, as for the diagnosis."""
    none = [r for r in rows if not r["true"]]
    single = [r for r in rows if len(r["true"]) == 1 and set(r["true"]) <= set(catalogue())]
    pairs = [r for r in rows if len(r["true"]) == 2]
    unknown = [r for r in rows if len(r["true"]) == 1 and r not in single]

    def answers(over: list[dict], name: str) -> list[dict]:
        return [{**r, **r["answers"][name], "claims": r["answers"][name]["named"]} for r in over]

    def share(over: list[dict], hit: Callable[[dict], bool]) -> Callable[[str], str]:
        return lambda name: f"{sum(hit(a) for a in answers(over, name))}/{len(over)}"

    def spread(over: list[dict], value: Callable[[dict], float]) -> Callable[[str], str]:
        def cell(name: str) -> str:
            values = [value(a) for a in answers(over, name)]
            return f"{np.median(values):.2f} ({np.quantile(values, 0.9):.2f})" if values else "-"

        return cell

    def over_floor(a: dict) -> float:
        return a["after"] / a["floor"]

    cells: dict[str, Callable[[str], str]] = {
        "": str,
        "false positives on no-effect sets": share(none, lambda a: a["missing"]),
        "says something is missing, one effect": share(single, lambda a: a["missing"]),
        "right effect first, one effect": share(single, first),
        "exact set, one effect": share(single, exact),
        "first is a true one, two effects": share(pairs, first),
        "exact set, two effects": share(pairs, exact),
        "out of catalogue, flagged": share(unknown, lambda a: a["flagged"]),
        "held-out after / floor, no effect": spread(none, over_floor),
        "held-out after / floor, singles": spread(single, over_floor),
        "held-out after / floor, pairs": spread(pairs, over_floor),
        "worse than calibrated on held-out trials": share(rows, lambda a: a["after"] > 1.001 * a["calibrated"]),
        "seconds": spread(rows, lambda a: a["seconds"]),
    }
    counts = f"{len(rows)} sets: {len(none)} none, {len(single)} single, {len(pairs)} pairs, {len(unknown)} out of catalogue"
    lines = [f"{label:42s}" + "".join(f"{cell(name):>20s}" for name in rows[0]["answers"]) for label, cell in cells.items()]
    return "\n".join([counts, *lines, "ratios and seconds: median (90 %)"])
