"""The residual against the variable that shows the effect, before and after side by side."""

import numpy as np
import plotly.graph_objects as go

from twin.body import Drive
from twin.diagnosis import Diagnosis
from twin.report.numbers import DISPLAY_UNITS, MINUS, capitalised
from twin.report.plots.effect_plot import ResidualPlot, bin_means, choose_residual_plots
from twin.report.plots.figures import (
    ACCENT_COLOUR,
    MEASURED_COLOUR,
    MOST_POINTS,
    Plot,
    single_precision,
    styled_figure,
    thinned_indices,
)
from twin.report.plots.predictions import TwinStage, compared_stages, residuals
from twin.report.sections.section import Section, Story

BRANCH_STYLES = {1.0: ("pulling", ACCENT_COLOUR), -1.0: ("releasing", "#b9893a")}
RESIDUAL_HEIGHT = 380


def section(story: Story) -> Section:
    """Return the section with the residual plots."""
    d = story.diagnosis
    stages = compared_stages(d)
    pairs = []
    for g in choose_residual_plots(d):
        panels = [
            {"label": capitalised(s.label), "plot": p} for s, p in zip(stages, panels_before_after(d, g, stages), strict=True)
        ]
        channel = d.prepared.outputs[g.column].channel.name
        pairs.append(
            {
                "reason": capitalised(g.reason),
                "channel": channel,
                "is_loop": g.variable.is_loop,
                "is_control": Drive.CONTROL in d.prepared.drives,
                "selection": g.variable.selection,
                "panels": panels,
            }
        )
    title = "Where the effect shows" if d.claims else "Residual"
    return Section("residual", title, "answer/residual.html", {"pairs": pairs, "trials": len(d.prepared.inputs)})


def panels_before_after(d: Diagnosis, chosen: ResidualPlot, stages: tuple[TwinStage, TwinStage]) -> list[Plot]:
    """Plot one residual before and after on equal axes, in display units."""
    channel = d.prepared.outputs[chosen.column]
    unit, factor = DISPLAY_UNITS[channel.group]
    sides = [factor * np.concatenate(residuals(d, s))[:, chosen.column] for s in stages]
    seen = [np.abs(r[np.isfinite(r) & chosen.variable.relevant]) for r in sides]
    reach = 1.1 * max((float(np.quantile(r, 0.998)) for r in seen if r.size), default=1.0)
    return [_plot(chosen, r, s, reach, channel.channel.name, unit) for r, s in zip(sides, stages, strict=True)]


def _plot(chosen: ResidualPlot, residual: np.ndarray, stage: TwinStage, reach: float, name: str, unit: str) -> Plot:
    v = chosen.variable
    ok = v.relevant & np.isfinite(v.values) & np.isfinite(residual)
    branches = [(ok, "mean", ACCENT_COLOUR)]
    if v.is_loop:
        branches = [(ok & (v.branch == sign), words, color) for sign, (words, color) in BRANCH_STYLES.items()]
    dots, lines = [], []
    for mask, words, color in branches:
        keep = np.flatnonzero(mask)
        keep = keep[thinned_indices(len(keep), MOST_POINTS // len(branches))]
        x, y = single_precision(v.values[keep]), single_precision(residual[keep])
        hover = f"%{{x:.3g}}, %{{y:.3f}} {unit}<extra></extra>"
        faint = {"color": color, "size": 4, "opacity": 0.35}
        dots.append(go.Scatter(x=x, y=y, mode="markers", marker=faint, showlegend=False, hovertemplate=hover))
        if mask.sum() > 3:
            x, y = bin_means(v.values[mask], residual[mask])
            line = {"width": 2.5, "color": color if v.is_loop else MEASURED_COLOUR}
            hover = f"{words} %{{y:.3f}} {unit}<extra></extra>"
            style = {"mode": "lines+markers", "line": line, "marker": {"size": 6}, "name": words, "showlegend": v.is_loop}
            lines.append(go.Scatter(x=single_precision(x), y=single_precision(y), hovertemplate=hover, **style))
    out = styled_figure(dots + lines, RESIDUAL_HEIGHT)
    out.update_xaxes(title_text=v.title)
    out.update_yaxes(title_text=f"{name}, measured {MINUS} predicted ({unit})", range=[-reach, reach])
    return Plot(f"Residual of {name} against {v.title}, {stage.label}", RESIDUAL_HEIGHT, out)
