"""How policies learn on their own twins, and how they do on the simulated robot. Needs matplotlib.

python -m tools.benchmarks.tasks.policy_figure results/        the folder of tools.benchmarks.tasks.policy_table
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tyro

from tools.benchmarks.figure import FIGURES, axes, save
from tools.benchmarks.tasks.policy.days import DAYS, TWINS
from tools.benchmarks.tasks.policy_table import OWN_NEAR, Results, kept, reached, shares

COLOURS = dict(zip(TWINS, ("#999999", "#b0413e", "#1f6f8b", "#79b4c8"), strict=True))
SIGHT = {False: "load cells and tip camera", True: "load cells only"}
MOST_SEEDS = 20


def learning(axis: Any, results: Results) -> None:
    """Draw a thin line a policy, a thick one their mean."""
    for blind, colour in ((False, "#1f6f8b"), (True, "#b0413e")):
        curves = [r["curve"] for c, r in results.items() if c.seed is not None and c.blind == blind]
        if not curves:
            continue
        steps = [step for step, _ in curves[0]]
        lines = np.array([[reached(d, OWN_NEAR) for _, d in curve] for curve in curves])
        axis.plot(steps, lines.T, color=colour, lw=0.4, alpha=0.5)
        axis.plot(steps, lines.mean(axis=0), color=colour, lw=2.0, label=SIGHT[blind])
    axis.set(xlabel="moves practised", ylabel="% of goals within 3 mm, own twin", ylim=(0, 102))
    axis.legend(frameon=False, loc="lower right")


def goals_reached(axis: Any, results: Results, blind: bool) -> None:
    """Draw a bar a twin, a dot a seed, a line where inverse kinematics on that twin is."""
    for k, effect in enumerate(DAYS):
        for j, twin in enumerate(TWINS):
            found, by_inverse = (shares(results, twin, effect, blind, inverse) for inverse in (False, True))
            x = k + 0.2 * (j - 1.5)
            if found:
                axis.bar(x, np.mean(found), 0.18, color=COLOURS[twin], label=twin if k == 0 else None)
                axis.plot(np.full(len(found), x), found, ".", color="black", ms=3)
            if by_inverse:
                axis.hlines(by_inverse, x - 0.09, x + 0.09, color="black", lw=1.2)
    axis.set_xticks(range(len(DAYS)), [name.replace("_", "\n") for name in DAYS])
    axis.set(ylim=(0, 104), title=SIGHT[blind])


def main(out: tyro.conf.Positional[Path]) -> None:
    """Draw what a folder of results holds."""
    results = kept(out, MOST_SEEDS)
    figure, (left, middle, right) = axes(3, (10.0, 3.0), 8.0, width_ratios=(1.0, 1.3, 1.3))
    learning(left, results)
    for axis, blind in ((middle, False), (right, True)):
        goals_reached(axis, results, blind)
    middle.set_ylabel("% of goals within 5 mm, simulated robot")
    figure.legend(*middle.get_legend_handles_labels(), loc="outside lower right", ncols=4, frameon=False)
    save(figure, FIGURES / "policies.svg")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
