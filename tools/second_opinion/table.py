"""The answers side by side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tools.attribution_table import same
from twin.effects import catalogue


def table(rows: list[dict]) -> str:
    """One column an opinion; effects are compared by class, as for the diagnosis."""
    none = [r for r in rows if not r["true"]]
    single = [r for r in rows if len(r["true"]) == 1 and set(r["true"]) <= set(catalogue())]
    pairs = [r for r in rows if len(r["true"]) == 2]
    unknown = [r for r in rows if len(r["true"]) == 1 and r not in single]
    names = list(rows[0]["answers"])

    def line(label: str, cell: Callable[[str], str]) -> str:
        return f"{label:42s}" + "".join(f"{cell(n):>20s}" for n in names)

    def share(over: list[dict], hit: Callable[[dict, dict], bool]) -> Callable[[str], str]:
        return lambda name: f"{sum(hit(r, r['answers'][name]) for r in over)}/{len(over)}"

    def spread(values: Callable[[str], list[float]]) -> Callable[[str], str]:
        return lambda name: f"{np.median(v := values(name)):.2f} ({np.quantile(v, 0.9):.2f})" if values(name) else "-"

    lines = [
        f"{len(rows)} sets: {len(none)} none, {len(single)} single, {len(pairs)} pairs, {len(unknown)} out of catalogue",
        line("", str),
        line("false positives on no-effect sets", share(none, lambda r, a: a["missing"])),
        line("says something is missing, one effect", share(single, lambda r, a: a["missing"])),
        line("right effect first, one effect", share(single, _first)),
        line("exact set, one effect", share(single, _exact)),
        line("first is a true one, two effects", share(pairs, _first)),
        line("exact set, two effects", share(pairs, _exact)),
        line("out of catalogue, flagged", share(unknown, lambda r, a: a["flagged"])),
        line("held-out after / floor, no effect", spread(lambda n: [r["answers"][n]["after"] / r["floor"] for r in none])),
        line("held-out after / floor, singles", spread(lambda n: [r["answers"][n]["after"] / r["floor"] for r in single])),
        line("held-out after / floor, pairs", spread(lambda n: [r["answers"][n]["after"] / r["floor"] for r in pairs])),
        line("worse than calibrated on held-out trials", share(rows, lambda r, a: a["after"] > 1.001 * r["calibrated"])),
        line("seconds", spread(lambda n: [r["answers"][n]["seconds"] for r in rows])),
        "ratios and seconds: median (90 %)",
    ]
    return "\n".join(lines)


def _first(row: dict, answer: dict) -> bool:
    return bool(answer["named"]) and any(same(answer["named"][0], t) for t in row["true"])


def _exact(row: dict, answer: dict) -> bool:
    named, true = answer["named"], row["true"]
    return len(named) == len(true) and all(any(same(n, t) for t in true) for n in named)
