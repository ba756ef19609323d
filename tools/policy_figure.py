"""How policies learn on their own twins, and how they do on the bench robot. Needs matplotlib and what tools.policy_table left.

python -m tools.policy_figure results/
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from tools.policy.days import DAYS, TWINS
from tools.policy_table import OWN_NEAR, Results, kept, reached, shares

OUT = Path(__file__).parent / "figures" / "policies.svg"
COLOURS = dict(zip(TWINS, ("#999999", "#b0413e", "#1f6f8b", "#79b4c8"), strict=True))
SIGHT = {False: "load cells and tip camera", True: "load cells only"}
MOST_SEEDS = 20


def learning(axes: Axes, results: Results) -> None:
    """A thin line a policy, a thick one their mean."""
    for blind, colour in ((False, "#1f6f8b"), (True, "#b0413e")):
        curves = [r["curve"] for c, r in results.items() if c.seed is not None and c.blind == blind]
        if not curves:
            continue
        steps = [step for step, _ in curves[0]]
        lines = np.array([[reached(d, OWN_NEAR) for _, d in curve] for curve in curves])
        axes.plot(steps, lines.T, color=colour, lw=0.4, alpha=0.5)
        axes.plot(steps, lines.mean(axis=0), color=colour, lw=2.0, label=SIGHT[blind])
    axes.set(xlabel="moves practised", ylabel="% of goals within 3 mm, own twin", ylim=(0, 102))
    axes.legend(frameon=False, loc="lower right")


def tried(axes: Axes, results: Results, blind: bool) -> None:
    """A bar a twin, a dot a seed, a line where inverse kinematics on that twin is."""
    for k, effect in enumerate(DAYS):
        for j, twin in enumerate(TWINS):
            found, by_inverse = (shares(results, twin, effect, blind, inverse) for inverse in (False, True))
            x = k + 0.2 * (j - 1.5)
            if found:
                axes.bar(x, np.mean(found), 0.18, color=COLOURS[twin], label=twin if k == 0 else None)
                axes.plot(np.full(len(found), x), found, ".", color="black", ms=3)
            if by_inverse:
                axes.hlines(by_inverse, x - 0.09, x + 0.09, color="black", lw=1.2)
    axes.set_xticks(range(len(DAYS)), [name.replace("_", "\n") for name in DAYS])
    axes.set(ylim=(0, 104), title=SIGHT[blind])


def main(out: Path) -> None:
    results = kept(out, MOST_SEEDS)
    plt.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False, "svg.hashsalt": "twin"})
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(10.0, 3.0), width_ratios=(1.0, 1.3, 1.3), layout="constrained")
    learning(left, results)
    for axes, blind in ((middle, False), (right, True)):
        tried(axes, results, blind)
    middle.set_ylabel("% of goals within 5 mm, bench robot")
    figure.legend(*middle.get_legend_handles_labels(), loc="outside lower right", ncols=4, frameon=False)
    figure.savefig(OUT, metadata={"Date": None})
    print(OUT)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
