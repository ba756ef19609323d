"""One sealed trial in time: where the tip was, where the twins put it, and how far off they are."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from twin.diagnose import Diagnosis
from twin.report.numbers import SHOWN
from twin.report.plots import MEASURED, MOST_POINTS, Plot, figure, numbers, plain, thin
from twin.report.sections.section import Section, Story
from twin.report.sentence import labels
from twin.report.stages import before_and_after, markers, residuals

ROW, LONG = 170, 16  # pixels; letters


def section(story: Story) -> Section:
    d = story.diagnosis
    whole = markers(d.bench)
    seen = [m for m in whole if any(np.isfinite(d.bench.measured[k][:, m[1]]).any() for k in d.sealed_trials)]
    name, columns = (seen or whole)[-1] if whole else _first_group(d)
    k = _telling(d, columns)
    content = {"trial": labels(d, (k,))[0], "name": name, "plot": _plot(d, k, columns), "distance": bool(whole)}
    return Section("tip", "One trial in time", "tip.html", content)


def _first_group(d: Diagnosis) -> tuple[str, list[int]]:
    group = d.bench.outputs[0].group
    return group, [j for j, o in enumerate(d.bench.outputs) if o.group == group][:3]


def _telling(d: Diagnosis, columns: list[int]) -> int:
    """The sealed trial in which the two predictions differ most where these columns were measured; markers may be put on anew."""
    first, second = (d.predictions[s.key] for s in before_and_after(d))

    def apart(k: int) -> float:
        seen = np.isfinite(d.bench.measured[k][:, columns])
        moved = np.nan_to_num((first[k] - second[k])[:, columns])[seen]
        return float(np.mean(moved**2)) if moved.size else -1.0

    return max(d.sealed_trials, key=apart)


def _plot(d: Diagnosis, k: int, columns: list[int]) -> Plot:
    time = d.bench.inputs[k].time
    stages = before_and_after(d)
    unit, factor = SHOWN[d.bench.outputs[columns[0]].group]
    n_row = len(columns) + 1
    keep = thin(len(time), MOST_POINTS // (3 * n_row))
    grid = make_subplots(rows=n_row, cols=1, shared_xaxes=True, vertical_spacing=0.03)
    for row, j in enumerate(columns, 1):
        for s in stages:
            y = numbers(factor * d.predictions[s.key][k][keep, j])
            grid.add_trace(_line(time[keep], y, s.words, s.color, row == 1), row=row, col=1)
        dots = {"size": 4, "color": MEASURED}
        y = numbers(factor * d.bench.measured[k][keep, j])
        grid.add_trace(go.Scatter(x=numbers(time[keep]), y=y, mode="markers", marker=dots,
                                  name="measured", showlegend=row == 1), row=row, col=1)  # fmt: skip
    for s in stages:
        off = factor * np.sqrt((residuals(d, s)[k][:, columns] ** 2).sum(axis=1))[keep]
        grid.add_trace(_line(time[keep], numbers(off), s.words, s.color, False), row=n_row, col=1)
    height = ROW * n_row + 60
    out = figure(list(grid.data), height, **{a: grid.layout[a] for a in grid.layout if a.startswith(("xaxis", "yaxis"))})
    for row, j in enumerate(columns, 1):
        out.update_yaxes(
            title_text=f"{_in_lines(d.bench.outputs[j].channel.name)} ({unit})", selector={"anchor": "x" if row == 1 else f"x{row}"}
        )
    out.update_yaxes(title_text=f"error ({unit})", rangemode="tozero", selector={"anchor": f"x{n_row}"})
    out.update_xaxes(title_text="time (s)", selector={"anchor": f"y{n_row}"})
    out.update_layout(hovermode="x", margin_l=84)
    return Plot(f"Time series of {plain(labels(d, (k,))[0])}", height, out)


def _in_lines(name: str) -> str:
    """A long name in two lines: one is as long as a panel is high."""
    first, _, last = name.rpartition("_")
    return f"{first}<br>{last}" if len(name) > LONG else name


def _line(x: np.ndarray, y: np.ndarray, name: str, color: str, legend: bool) -> go.Scatter:
    return go.Scatter(x=numbers(x), y=y, mode="lines", name=name, line={"color": color, "width": 2}, showlegend=legend,
                      hovertemplate="%{y:.3f}")  # fmt: skip
