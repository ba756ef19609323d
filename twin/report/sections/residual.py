"""The residual against what gives the effect away, before and after side by side."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.giveaway import Giveaway, bins, giveaways
from twin.report.plots import ACCENT, MEASURED, MOST_POINTS, Plot, figure, numbers, thin
from twin.report.sections.section import Section, Story
from twin.report.stages import Stage, before_and_after, residuals

BRANCHES = {1.0: ("pulling", ACCENT), -1.0: ("releasing", "#b9893a")}
HEIGHT = 380


def section(story: Story) -> Section:
    d = story.diagnosis
    pairs = []
    for g in giveaways(d):
        stages = before_and_after(d)
        pairs.append(
            {
                "why": g.why,
                "channel": d.bench.outputs[g.column].channel.name,
                "loop": g.variable.side is not None,
                "panels": [{"words": s.words, "plot": p} for s, p in zip(stages, plots(d, g, stages), strict=True)],
            }
        )
    return Section("residual", "What gives it away", "residual.html", {"pairs": pairs, "trials": len(d.bench.inputs)})


def plots(d: Diagnosis, giveaway: Giveaway, stages: tuple[Stage, Stage]) -> list[Plot]:
    """The same axes twice: one residual (mm) before, one after."""
    sides = [1e3 * np.concatenate(residuals(d, s))[:, giveaway.column] for s in stages]
    reach = 1.08 * max((float(np.nanquantile(np.abs(r), 0.998)) for r in sides if np.isfinite(r).any()), default=1.0)
    name = d.bench.outputs[giveaway.column].channel.name
    return [_plot(giveaway, r, s, reach, name) for r, s in zip(sides, stages, strict=True)]


def _plot(giveaway: Giveaway, residual: np.ndarray, stage: Stage, reach: float, name: str) -> Plot:
    variable = giveaway.variable
    x = np.concatenate(variable.values)
    ok = np.isfinite(x) & np.isfinite(residual)
    if variable.side is None:
        branches = [(ok, "residual", ACCENT)]
    else:
        side = np.concatenate(variable.side)
        branches = [(ok & (side == sign), words, color) for sign, (words, color) in BRANCHES.items()]
    traces = []
    for mask, words, color in branches:
        keep = np.flatnonzero(mask)
        keep = keep[thin(len(keep), MOST_POINTS // (2 * len(branches)))]
        dots = {"color": color, "size": 4, "opacity": 0.35}
        traces.append(go.Scatter(x=numbers(x[keep]), y=numbers(residual[keep]), mode="markers", marker=dots, name=words, showlegend=False,
                                 hovertemplate="%{x:.3g}, %{y:.3f} mm<extra></extra>"))  # fmt: skip
    for mask, words, color in branches:
        if mask.sum() > 3:
            line = {"color": MEASURED if variable.side is None else color, "width": 2.5}
            traces.append(go.Scatter(**_means(x[mask], residual[mask]), mode="lines+markers", line=line, marker={"size": 6}, name=words,
                                     showlegend=variable.side is not None, hovertemplate="mean %{y:.3f} mm<extra></extra>"))  # fmt: skip
    out = figure(traces, HEIGHT)
    out.update_xaxes(title=variable.words)
    out.update_yaxes(title=f"{name}, measured − predicted (mm)", range=[-reach, reach])  # noqa: RUF001
    return Plot(f"Residual of {name} against {variable.words}, {stage.words}", HEIGHT, out)


def _means(x: np.ndarray, y: np.ndarray) -> dict[str, np.ndarray]:
    """Mean of x and y in every bin of x, from left to right."""
    place, count = bins(x)
    n = np.bincount(place, minlength=count)
    full = n > 0
    return {k: numbers((np.bincount(place, v, minlength=count) / np.maximum(n, 1))[full]) for k, v in (("x", x), ("y", y))}
