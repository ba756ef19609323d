"""Measured and predicted shapes of a few poses of held-out trials, in 3-D with equal axes."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.contents import labels
from twin.report.plots import MEASURED, Plot, figure, numbers
from twin.report.sections.section import Section, Story
from twin.report.stages import Stage, before_and_after, markers

POSES = 4
HEIGHT = 560
LARGER = 10.0  # times: the second view draws predictions this much further from the measured shape


def section(story: Story) -> Section:
    d = story.diagnosis
    whole = markers(d.bench)
    chosen = poses(d) if len(whole) > 1 else []
    content = {"plot": _plot(d, chosen) if chosen else None, "poses": _words(d, chosen), "larger": f"{LARGER:g}"}
    return Section("shapes", "Shapes", "shapes.html", content)


def poses(d: Diagnosis) -> list[tuple[int, int]]:
    """(trial, sample) of up to four complete held-out poses that differ most: the most bent first, then the furthest from those."""
    columns = [c for _, three in markers(d.bench) for c in three]
    tip = columns[-3:]
    at = [(k, n) for k in d.held_trials for n in np.flatnonzero(np.isfinite(d.bench.measured[k][:, columns]).all(axis=1))]
    if not at:
        return []
    place = np.array([d.bench.measured[k][n, tip] for k, n in at])
    chosen = [int(np.argmax(np.hypot(place[:, 0], place[:, 1])))]
    while len(chosen) < min(POSES, len(at)):
        distance = np.linalg.norm(place[:, None] - place[chosen][None], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    return [(at[i][0], int(at[i][1])) for i in chosen]


def _words(d: Diagnosis, chosen: list[tuple[int, int]]) -> list[str]:
    names = labels(d, tuple(k for k, _ in chosen))
    return [f"{name} at {d.bench.inputs[k].time[n]:.1f} s" for name, (k, n) in zip(names, chosen, strict=True)]


def _plot(d: Diagnosis, chosen: list[tuple[int, int]]) -> Plot:
    first, second = before_and_after(d)
    columns = [three for _, three in markers(d.bench)]
    measured = [1e3 * d.bench.measured[k][n][columns] for k, n in chosen]  # (n_marker, 3) mm each
    traces: list[go.Scatter3d] = [_trace(measured, "measured", "markers", marker={"size": 4, "color": MEASURED})]
    for times, visible in ((1.0, True), (LARGER, False)):
        for stage in (first, second):
            traces.append(_predicted(d, chosen, measured, stage, times, visible, columns))
    shown = [[True, True, True, False, False], [True, False, False, True, True]]
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": mask}]}
        for label, mask in zip(("true to scale", f"differences × {LARGER:g}"), shown, strict=True)  # noqa: RUF001
    ]
    axes = {a + "axis": {"title": f"{a} (mm)", "backgroundcolor": "rgba(0,0,0,0)", "gridcolor": "#dfe3e6", "showspikes": False} for a in "xyz"}
    scene = {**axes, "aspectmode": "data", "camera": {"eye": {"x": 1.5, "y": 1.3, "z": 0.5}, "up": {"x": 0, "y": 0, "z": -1}}}
    menu = {"type": "buttons", "direction": "right", "x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "buttons": buttons,
            "bgcolor": "#ffffff", "bordercolor": "#c3c9cd", "font": {"size": 13}, "pad": {"t": 4}}  # fmt: skip
    out = figure(traces, HEIGHT, scene=scene, updatemenus=[menu], margin={"l": 0, "r": 0, "t": 34, "b": 44})
    return Plot("Measured and predicted shapes", HEIGHT, out)


def _predicted(
    d: Diagnosis, chosen: list[tuple[int, int]], measured: list[np.ndarray], stage: Stage, times: float, visible: bool, columns: list[list[int]]
) -> go.Scatter3d:
    shapes = [m + times * (1e3 * d.predictions[stage.key][k][n][columns] - m) for m, (k, n) in zip(measured, chosen, strict=True)]
    return _trace(shapes, stage.words, "lines", line={"width": 4, "color": stage.color}, visible=visible)


def _trace(shapes: list[np.ndarray], name: str, mode: str, **style: object) -> go.Scatter3d:
    """Several shapes as one trace, with a gap between."""
    gap = np.full((1, 3), np.nan)
    xyz = np.concatenate([part for shape in shapes for part in (shape, gap)])
    x, y, z = (numbers(c) for c in xyz.T)
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.1f}, %{y:.1f}, %{z:.1f} mm", **style)
