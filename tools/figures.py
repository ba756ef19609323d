"""Draw the picture on the README's first screen: the bundled recording before and after the diagnosis. Needs matplotlib.

python -m tools.figures
"""

from pathlib import Path
from typing import Any

import numpy as np

from twin.diagnosis import Settings, diagnose
from twin.measurements import read
from twin.prediction.twin import Twin
from twin.robots.robot import models_folder

OUT = Path(__file__).parent / "figures/friday.svg"
STYLE: Any = {  # matplotlib names every key in its types
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "twin",
}
STAGES = {"calibrated": ("#b0413e", "calibrated"), "after": ("#1f6f8b", "with tendon friction")}


def main() -> None:
    """Diagnose the recording and draw."""
    recording = read(models_folder() / "continuum/samples/friday")
    d = diagnose(recording, Twin.of("continuum"), Settings())
    bench = d.prepared
    tip = [next(j for j, o in enumerate(bench.outputs) if o.channel.name == f"disk_8_{a}") for a in "xyz"]
    pulls = {k: int(np.argmax(np.ptp(bench.inputs[k].command, axis=0))) for k in d.held_out_trials}
    trial = max(pulls, key=lambda k: float(np.ptp(bench.inputs[k].command)))
    tension = bench.inputs[trial].command[:, pulls[trial]]
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams.update(STYLE)
    figure, (loop, bars) = plt.subplots(1, 2, figsize=(8.0, 2.9), layout="constrained", width_ratios=(1.7, 1.0))
    for stage, (colour, label) in STAGES.items():
        error = 1e3 * np.linalg.norm(bench.measured[trial][:, tip] - d.predictions[stage][trial][:, tip], axis=1)
        loop.plot(tension, error, ".-", color=colour, lw=0.7, ms=3, label=label)
    loop.set(xlabel=f"tension of tendon {pulls[trial] + 1}, N", ylabel="tip error, mm", ylim=(0, None))
    loop.set_title(f"a held-out trial ({bench.inputs[trial].name.removesuffix('.csv')})", fontsize=9, loc="left")
    loop.legend(frameon=False)
    values = [1e3 * e["marker"] for e in (d.errors.nominal, d.errors.calibrated, d.errors.after)]
    bars.barh(["as described", "calibrated", "with friction"], values, color=["#999999", "#b0413e", "#1f6f8b"])
    bars.axvline(1e3 * d.errors.floor["marker"], color="black", lw=0.8, ls="--")
    bars.invert_yaxis()
    for y, v in enumerate(values):
        bars.text(v, y, f" {v:.2f}", va="center")
    bars.set(xlabel="RMS error on held-out trials, mm", xlim=(0, 1.2 * max(values)))
    bars.set_title("dashed: noise floor", fontsize=9, loc="left")
    figure.savefig(OUT, metadata={"Date": None})
    print(OUT)


if __name__ == "__main__":
    main()
