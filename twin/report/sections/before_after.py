"""The error on trials no fit has seen: as described, calibrated, with the effects; and the noise floor."""

from __future__ import annotations

import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.contents import KINDS, labels
from twin.report.numbers import MM, column
from twin.report.plots import ACCENT, BEFORE, MEASURED, Plot, figure
from twin.report.sections.section import Section, Story

ROWS = {"nominal": "as described", "calibrated": "calibrated", "after": "with the effects"}


def section(story: Story) -> Section:
    d = story.diagnosis
    groups = list(d.errors.after)
    tables = [{"kind": KINDS.get(g, g).replace("_", " "), "rows": rows(d, g), "plot": _plot(d, g)} for g in groups]
    return Section("before-after", "Before and after", "before_after.html", {"tables": tables, "trials": labels(d, d.held_trials)})


def rows(d: Diagnosis, group: str) -> list[dict[str, str]]:
    """The table: stage, error, 95 % interval, all in mm with the same decimals; the noise floor last."""
    e = d.errors
    low = {"nominal": None, "calibrated": e.ci_calibrated[group][0], "after": e.ci_after[group][0]}
    high = {"nominal": None, "calibrated": e.ci_calibrated[group][1], "after": e.ci_after[group][1]}
    shown = list(stages(d))
    value = [{"nominal": e.nominal, "calibrated": e.calibrated, "after": e.after}[s][group] for s in shown]
    cells = column([MM * v for v in (*value, e.floor[group])], 3)
    out = []
    for stage, text in zip(shown, cells[:-1], strict=True):
        ends = [low[stage], high[stage]]
        interval = column([None if x is None else MM * x for x in ends], 3)
        out.append({"stage": ROWS[stage], "error": text, "interval": "" if ends[0] is None else " to ".join(interval)})
    return [*out, {"stage": "noise floor", "error": cells[-1], "interval": ""}]


def stages(d: Diagnosis) -> tuple[str, ...]:
    """The stages that differ: without effects, what comes after is the calibrated twin itself."""
    return ("nominal", "calibrated", "after") if d.claims else ("nominal", "calibrated")


def _plot(d: Diagnosis, group: str) -> Plot:
    e = d.errors
    shown = list(stages(d))
    value = {"nominal": e.nominal[group], "calibrated": e.calibrated[group], "after": e.after[group]}
    ends = {"calibrated": e.ci_calibrated[group], "after": e.ci_after[group]}
    names = [ROWS[s] for s in shown]
    x = [MM * value[s] for s in shown]
    up = [MM * (ends[s][1] - value[s]) if s in ends else 0.0 for s in shown]
    down = [MM * (value[s] - ends[s][0]) if s in ends else 0.0 for s in shown]
    colors = [BEFORE] * (len(shown) - 1) + [ACCENT]
    bars = go.Bar(x=x, y=names, orientation="h", marker={"color": colors}, width=0.5, hovertemplate="%{y}: %{x:.3f} mm<extra></extra>",
                  error_x={"type": "data", "array": up, "arrayminus": down, "color": MEASURED, "thickness": 1.3, "width": 5})  # fmt: skip
    floor = MM * e.floor[group]
    out = figure([bars], 90 + 44 * len(shown), showlegend=False, margin={"l": 120, "r": 14, "t": 26, "b": 44})
    out.update_yaxes(autorange="reversed", ticks="", showgrid=False)
    out.update_xaxes(title="root-mean-square error (mm)", rangemode="tozero")
    out.add_vline(x=floor, line={"color": MEASURED, "width": 1.2, "dash": "dot"})
    out.add_annotation(x=floor, y=1, yref="paper", yanchor="bottom", text=f"noise floor {floor:.2f}", showarrow=False, font={"size": 12})
    return Plot("Error before and after, with the noise floor", 90 + 44 * len(shown), out)
