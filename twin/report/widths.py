"""How wide loops are at each load: measured, and as the twins have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.diagnose.loops import Loops, loops
from twin.report.numbers import SHOWN
from twin.report.plots import MEASURED, Plot, figure, numbers, plain
from twin.report.sentence import labels
from twin.report.stages import before_and_after

HEIGHT = 320
MOVED = 0.1  # of the largest load: torques closer than that are one load


def plot(d: Diagnosis) -> Plot | None:
    """Mean |release less pull| of every trial that comes back over its commands, against its mean load torque: dots measured,
    crosses the twins. None unless loops were run under two torques or more."""
    bench = d.bench
    torque = np.array([float(np.mean(i.loads.torque)) for i in bench.inputs])
    measured = loops(bench)
    held = torque[[x.trial for x in measured.each]]
    if not held.size or np.ptp(held) <= MOVED * np.abs(held).max():
        return None
    unit, factor = SHOWN[measured.group]

    def points(found: Loops, name: str, **look: object) -> go.Scatter:
        trials = [x.trial for x in found.each]
        text = [plain(n) for n in labels(d, tuple(trials))]
        shown = f"%{{text}}: %{{y:.3g}} {unit}<extra></extra>"
        x, y = numbers(torque[trials]), numbers([factor * abs(x.lag) for x in found.each])
        return go.Scatter(x=x, y=y, mode="markers", name=name, marker={"size": 9, **look}, text=text, hovertemplate=shown)

    drawn = [points(measured, "measured", color=MEASURED, opacity=0.6)]
    for stage in before_and_after(d):
        predicted = loops(replace(bench, measured=tuple(d.predictions[stage.key])))
        drawn.append(points(predicted, stage.words, color=stage.color, symbol="x"))
    out = figure(drawn, HEIGHT)
    out.update_xaxes(title_text="load torque (N m)")
    out.update_yaxes(title_text=f"loop width, {plain(measured.name)} ({unit})", rangemode="tozero")
    return Plot("Loop width against load, measured and predicted", HEIGHT, out)
