"""Plot the width of loops against the load, measured and predicted."""

from dataclasses import replace

import numpy as np
import plotly.graph_objects as go

from twin.diagnosis import Diagnosis
from twin.diagnosis.checks.loops import Loops, loops
from twin.report.numbers import DISPLAY_UNITS
from twin.report.plots.figures import MEASURED_COLOUR, Plot, escape_markup, single_precision, styled_figure
from twin.report.plots.predictions import compared_stages
from twin.report.sentence import trial_labels

LOOP_WIDTHS_HEIGHT = 320
SAME_LOAD_TOLERANCE = 0.1  # of the largest load: torques closer than that are one load


def plot(d: Diagnosis) -> Plot | None:
    """Plot the mean |release - pull| of every trial with a loop against its mean load torque.

    Dots are measured, crosses predicted. None unless there are loops under two torques or more.
    """
    prepared = d.prepared
    torque = np.array([float(np.mean(i.loads.torque)) for i in prepared.inputs])
    measured = loops(prepared)
    held = torque[[x.trial for x in measured.by_trial]]
    if not held.size or np.ptp(held) <= SAME_LOAD_TOLERANCE * np.abs(held).max():
        return None
    unit, factor = DISPLAY_UNITS[measured.group]

    def points(found: Loops, name: str, **look: object) -> go.Scatter:
        trials = [x.trial for x in found.by_trial]
        text = [escape_markup(n) for n in trial_labels(d, tuple(trials))]
        shown = f"%{{text}}: %{{y:.3g}} {unit}<extra></extra>"
        x, y = single_precision(torque[trials]), single_precision([factor * abs(x.lag) for x in found.by_trial])
        return go.Scatter(x=x, y=y, mode="markers", name=name, marker={"size": 9, **look}, text=text, hovertemplate=shown)

    drawn = [points(measured, "measured", color=MEASURED_COLOUR, opacity=0.6)]
    for stage in compared_stages(d):
        predicted = loops(replace(prepared, measured=tuple(d.predictions[stage.key])))
        drawn.append(points(predicted, stage.label, color=stage.colour, symbol="x"))
    out = styled_figure(drawn, LOOP_WIDTHS_HEIGHT)
    out.update_xaxes(title_text="load torque (N m)")
    out.update_yaxes(title_text=f"loop width, {escape_markup(measured.name)} ({unit})", rangemode="tozero")
    return Plot("Loop width against load, measured and predicted", LOOP_WIDTHS_HEIGHT, out)
