"""The residual against what gives the effect away, before and after side by side."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.giveaway import Giveaway, giveaways, means
from twin.report.numbers import MINUS, SHOWN, upper_first
from twin.report.plots import ACCENT, MEASURED, MOST_POINTS, Plot, figure, numbers, thin
from twin.report.sections.section import Section, Story
from twin.report.stages import Stage, before_and_after, residuals

BRANCHES = {1.0: ("pulling", ACCENT), -1.0: ("releasing", "#b9893a")}
HEIGHT = 380


def section(story: Story) -> Section:
    d = story.diagnosis
    stages = before_and_after(d)
    pairs = []
    for g in giveaways(d):
        panels = [{"words": upper_first(s.words), "plot": p} for s, p in zip(stages, plots(d, g, stages), strict=True)]
        channel = d.bench.outputs[g.column].channel.name
        pairs.append(
            {"why": upper_first(g.why), "channel": channel, "loop": g.variable.loop, "which": g.variable.which, "panels": panels}
        )
    title = "What gives it away" if d.claims else "The residual"
    return Section("residual", title, "residual.html", {"pairs": pairs, "trials": len(d.bench.inputs)})


def plots(d: Diagnosis, giveaway: Giveaway, stages: tuple[Stage, Stage]) -> list[Plot]:
    """The same axes twice: one residual, in the unit people read, before, one after."""
    channel = d.bench.outputs[giveaway.column]
    unit, factor = SHOWN[channel.group]
    sides = [factor * np.concatenate(residuals(d, s))[:, giveaway.column] for s in stages]
    seen = [np.abs(r[np.isfinite(r) & giveaway.variable.shown]) for r in sides]
    reach = 1.1 * max((float(np.quantile(r, 0.998)) for r in seen if r.size), default=1.0)
    return [_plot(giveaway, r, s, reach, channel.channel.name, unit) for r, s in zip(sides, stages, strict=True)]


def _plot(giveaway: Giveaway, residual: np.ndarray, stage: Stage, reach: float, name: str, unit: str) -> Plot:
    v = giveaway.variable
    ok = v.shown & np.isfinite(v.values) & np.isfinite(residual)
    branches = [(ok, "mean", ACCENT)]
    if v.loop:
        branches = [(ok & (v.side == sign), words, color) for sign, (words, color) in BRANCHES.items()]
    dots, lines = [], []
    for mask, words, color in branches:
        keep = np.flatnonzero(mask)
        keep = keep[thin(len(keep), MOST_POINTS // len(branches))]
        x, y = numbers(v.values[keep]), numbers(residual[keep])
        hover = f"%{{x:.3g}}, %{{y:.3f}} {unit}<extra></extra>"
        faint = {"color": color, "size": 4, "opacity": 0.35}
        dots.append(go.Scatter(x=x, y=y, mode="markers", marker=faint, showlegend=False, hovertemplate=hover))
        if mask.sum() > 3:
            x, y = means(v.values[mask], residual[mask])
            line = {"width": 2.5, "color": color if v.loop else MEASURED}
            hover = f"{words} %{{y:.3f}} {unit}<extra></extra>"
            style = {"mode": "lines+markers", "line": line, "marker": {"size": 6}, "name": words, "showlegend": v.loop}
            lines.append(go.Scatter(x=numbers(x), y=numbers(y), hovertemplate=hover, **style))
    out = figure(dots + lines, HEIGHT)
    out.update_xaxes(title_text=v.words)
    out.update_yaxes(title_text=f"{name}, measured {MINUS} predicted ({unit})", range=[-reach, reach])
    return Plot(f"Residual of {name} against {v.words}, {stage.words}", HEIGHT, out)
