"""Draw the hardware rigs for models/<robot>/README.md: measured against predicted. Needs matplotlib.

python -m tools.benchmarks.hardware.figures FOLDER    FOLDER as for tools.benchmarks.hardware.run
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.figure import axes, save
from tools.benchmarks.hardware.comparisons.cable_tool import split as runs
from tools.benchmarks.hardware.comparisons.tentacle import HOOKE, calibrated
from tools.benchmarks.hardware.comparisons.three_cable import halves
from tools.benchmarks.hardware.importers import cable_tool, tentacle, three_cable
from twin.diagnosis import Settings, diagnose
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

BEFORE, AFTER = "#b0413e", "#1f6f8b"


def predicted(bench: PreparedRecording, twin: Twin, rows: list[int]) -> list[np.ndarray]:
    """Return what a twin predicts of each of the trials."""
    return [t.outputs(twin, bench) for t in simulate(twin, bench, trials=rows)]


def draw_tentacle(folder: Path) -> None:
    """Draw two-tendon holds seen from the side, by twins fitted to single-tendon holds."""
    recording, _ = tentacle.read(folder)
    bench = prepare(recording, load("tentacle"))
    pulls = np.stack([i.command[0] for i in bench.inputs])
    both = [int(k) for k in np.flatnonzero((pulls > 0).all(axis=1))]
    alone = np.setdiff1d(np.arange(len(pulls)), both)
    twins = {"Hooke's law": (calibrated(bench, alone, (), HOOKE), BEFORE), "neo-Hookean": (calibrated(bench, alone), AFTER)}
    figure, panels = axes(4, (9.0, 3.0), sharey=True)
    for axis, k in zip(panels, sorted(both, key=lambda k: pulls[k].sum())[1::2], strict=True):
        there = bench.measured[k].mean(axis=0)
        seen = 1e3 * tentacle.joined(there).reshape(4, 3)
        axis.plot(seen[:, 0], -seen[:, 2], "ko", ms=4, label="measured")
        for name, (twin, colour) in twins.items():
            at = np.where(np.isnan(there), np.nan, predicted(bench, twin, [k])[0].mean(axis=0))
            x = 1e3 * tentacle.joined(at).reshape(4, 3)
            axis.plot(x[:, 0], -x[:, 2], "x", color=colour, ms=6, label=name)
        axis.set(xlabel="x, mm", aspect="equal", xlim=(-40, 200))
        axis.set_title(f"{pulls[k, 0]:.1f} and {pulls[k, 1]:.1f} N", fontsize=9, loc="left")
    panels[0].set_ylabel("height, mm")
    panels[0].legend(frameon=False, fontsize=7, loc="upper right")
    save(figure, models_folder() / "tentacle/two_tendons.svg")


def draw_three_cable(folder: Path) -> None:
    """Draw the tip's error over unseen sweeps, of the robot calibrated and diagnosed on every other sweep of block 1."""
    recording, _ = three_cable.read(folder)
    bench = prepare(recording, load("three_cable"))
    fitted, beside, other = halves(recording, 1)
    found = diagnose(recording.select(fitted), Twin.of(load("three_cable")), Settings(jobs=1))
    figure, panels = axes(2, (8.0, 2.8), sharey=True)
    for twin, colour, name in ((found.calibrated, BEFORE, "calibrated"), (found.twin, AFTER, "after the diagnosis")):
        for axis, rows, cable in ((panels[0], beside, 1), (panels[1], other, 0)):
            off = [bench.measured[k] - y for k, y in zip(rows, predicted(bench, twin, rows), strict=True)]
            error = [1e3 * np.sqrt((e**2).sum(axis=1).mean()) for e in off]
            axis.plot([1e3 * bench.inputs[k].command[0, cable] for k in rows], error, ".-", color=colour, label=name)
    panels[0].set(xlabel="cable 2 held at, mm", ylabel="tip error of a sweep, mm", ylim=(0, None))
    panels[0].set_title("block 1, the other sweeps", fontsize=9, loc="left")
    panels[1].set(xlabel="cable 1 held at, mm")
    panels[1].set_title("block 2, where cable 1 first moves", fontsize=9, loc="left")
    panels[0].legend(frameon=False)
    save(figure, models_folder() / "three_cable/sweep.svg")


def draw_cable_tool(folder: Path) -> None:
    """Draw how far the jaw is from where the drum alone would have it: measured, and by the twin diagnosed at two loads."""
    recording, _ = cable_tool.read(folder)
    found = diagnose(runs(recording)[0], Twin.of(load("cable_tool")), Settings(jobs=1))
    predicted = found.twin.predict(recording)
    drum, jaw = (np.concatenate([t.values[f"joint_{j}_angle"] for t in recording.trials]) for j in (1, 2))
    ratio = np.polyfit(drum, jaw, 1)
    figure, panels = axes(4, (9.0, 2.8), sharey=True)
    for axis, percent in zip(panels, cable_tool.LOADS, strict=True):
        name = f"load{percent}_0.5Hz.csv"
        k = next(k for k, t in enumerate(recording.trials) if t.name == name)
        q, half = recording.trials[k].values["joint_1_angle"], slice(len(recording.trials[k].time) // 2, None)
        for of, style, words in ((recording, "k-", "measured"), (predicted, "-", "twin")):
            off = np.rad2deg(of.trials[k].values["joint_2_angle"] - np.polyval(ratio, q))
            colour = {} if of is recording else {"color": AFTER}
            axis.plot(np.rad2deg(q[half]), off[half], style, lw=0.8, label=words, **colour)
        axis.set(xlabel="drum, deg")
        axis.set_title(f"load {percent} %", fontsize=9, loc="left")
    panels[0].set_ylabel("jaw less ratio x drum, deg")
    panels[-1].legend(frameon=False, fontsize=7, loc="lower right")
    save(figure, models_folder() / "cable_tool/loops.svg")


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Draw all rigs from a folder of their raw data."""
    draw_tentacle(folder / "tentacle")
    draw_three_cable(folder / "three-cable")
    draw_cable_tool(folder / "cable-tool")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
