"""One held-out trial over time: the tip as measured and predicted, and the error."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from twin.diagnosis import Diagnosis
from twin.report.numbers import DISPLAY_UNITS
from twin.report.plots.figures import (
    MEASURED_COLOUR,
    MOST_POINTS,
    Plot,
    escape_markup,
    single_precision,
    styled_figure,
    thinned_indices,
)
from twin.report.plots.predictions import compared_stages, complete_markers, residuals
from twin.report.sections.section import Section, Story
from twin.report.sentence import trial_labels

PANEL_HEIGHT, LONGEST_LABEL = 170, 16  # pixels; letters


def section(story: Story) -> Section:
    """Return the section with one trial over time."""
    d = story.diagnosis
    whole = complete_markers(d.prepared)
    seen = [m for m in whole if any(np.isfinite(d.prepared.measured[k][:, m[1]]).any() for k in d.held_out_trials)]
    name, columns = (seen or whole)[-1] if whole else _first_group(d)
    k = _most_different_trial(d, columns)
    content = {"trial": trial_labels(d, (k,))[0], "name": name, "plot": _plot(d, k, columns), "distance": bool(whole)}
    return Section("tip", "One trial over time", "data/tip.html", content)


def _first_group(d: Diagnosis) -> tuple[str, list[int]]:
    group = d.prepared.outputs[0].group
    return group, [j for j, o in enumerate(d.prepared.outputs) if o.group == group][:3]


def _most_different_trial(d: Diagnosis, columns: list[int]) -> int:
    """Return the held-out trial in which the two predictions differ most where these columns were measured."""
    first, second = (d.predictions[s.key] for s in compared_stages(d))

    def apart(k: int) -> float:
        seen = np.isfinite(d.prepared.measured[k][:, columns])
        moved = np.nan_to_num((first[k] - second[k])[:, columns])[seen]
        return float(np.mean(moved**2)) if moved.size else -1.0

    return max(d.held_out_trials, key=apart)


def _plot(d: Diagnosis, k: int, columns: list[int]) -> Plot:
    time = d.prepared.inputs[k].time
    stages = compared_stages(d)
    unit, factor = DISPLAY_UNITS[d.prepared.outputs[columns[0]].group]
    n_row = len(columns) + 1
    keep = thinned_indices(len(time), MOST_POINTS // (3 * n_row))
    grid = make_subplots(rows=n_row, cols=1, shared_xaxes=True, vertical_spacing=0.03)
    for row, j in enumerate(columns, 1):
        for s in stages:
            y = single_precision(factor * d.predictions[s.key][k][keep, j])
            grid.add_trace(_line(time[keep], y, s.label, s.colour, row == 1), row=row, col=1)
        dots = {"size": 4, "color": MEASURED_COLOUR}
        y = single_precision(factor * d.prepared.measured[k][keep, j])
        grid.add_trace(go.Scatter(x=single_precision(time[keep]), y=y, mode="markers", marker=dots,
                                  name="measured", showlegend=row == 1), row=row, col=1)  # fmt: skip
    for s in stages:
        off = factor * np.sqrt((residuals(d, s)[k][:, columns] ** 2).sum(axis=1))[keep]
        grid.add_trace(_line(time[keep], single_precision(off), s.label, s.colour, False), row=n_row, col=1)
    height = PANEL_HEIGHT * n_row + 60
    out = styled_figure(list(grid.data), height, **{a: grid.layout[a] for a in grid.layout if a.startswith(("xaxis", "yaxis"))})
    for row, j in enumerate(columns, 1):
        out.update_yaxes(
            title_text=f"{_two_lines(d.prepared.outputs[j].channel.name)} ({unit})",
            selector={"anchor": "x" if row == 1 else f"x{row}"},
        )
    out.update_yaxes(title_text=f"error ({unit})", rangemode="tozero", selector={"anchor": f"x{n_row}"})
    out.update_xaxes(title_text="time (s)", selector={"anchor": f"y{n_row}"})
    out.update_layout(hovermode="x", margin_l=84)
    return Plot(f"Time series of {escape_markup(trial_labels(d, (k,))[0])}", height, out)


def _two_lines(name: str) -> str:
    """Break a long name into two lines, since one line is as long as a panel is high."""
    first, _, last = name.rpartition("_")
    return f"{first}<br>{last}" if len(name) > LONGEST_LABEL else name


def _line(x: np.ndarray, y: np.ndarray, name: str, color: str, legend: bool) -> go.Scatter:
    return go.Scatter(x=single_precision(x), y=y, mode="lines", name=name, line={"color": color, "width": 2}, showlegend=legend,
                      hovertemplate="%{y:.3f}")  # fmt: skip
