"""Measured and predicted shapes of a few poses of held-out trials, in 3-D with equal axes."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report.contents import labels
from twin.report.numbers import MM
from twin.report.plots import BEFORE, MEASURED, Plot, figure, numbers
from twin.report.sections.section import Section, Story
from twin.report.stages import before_and_after, markers

POSES = 4
HEIGHT = 560
LARGER = 10.0  # times: the second view draws predictions this much further from the measured shape


def section(story: Story) -> Section:
    d = story.diagnosis
    whole = markers(d.bench)
    chosen = poses(d) if len(whole) > 1 else []
    content = {"plot": _plot(d, chosen) if chosen else None, "poses": _words(d, chosen)}
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
    columns = [three for _, three in markers(d.bench)]
    measured = [MM * d.bench.measured[k][n][columns] for k, n in chosen]  # (n_marker, 3) mm each
    traces = [_trace(measured, "measured", "markers", marker={"size": 4, "color": MEASURED})]
    for times, visible in ((1.0, True), (LARGER, False)):
        for stage in before_and_after(d):
            predicted = [MM * d.predictions[stage.key][k][n][columns] for k, n in chosen]
            shapes = [m + times * (p - m) for m, p in zip(measured, predicted, strict=True)]
            traces.append(_trace(shapes, stage.words, "lines", line={"width": 4, "color": stage.color}, visible=visible))
    origin = {"size": 5, "color": BEFORE, "symbol": "square"}
    traces.append(go.Scatter3d(x=[0], y=[0], z=[0], name="origin of the base frame", mode="markers", marker=origin))
    gravity = d.bench.inputs[chosen[0][0]].loads.gravity
    axis = {"backgroundcolor": "rgba(0,0,0,0)", "gridcolor": "#dfe3e6", "showspikes": False}
    axes = {f"{a}axis": {"title": {"text": f"{a} (mm)"}, **axis} for a in "xyz"}
    scene = {**axes, "aspectmode": "data", "dragmode": "orbit", "camera": _camera(gravity)}
    out = figure(traces, HEIGHT, scene=scene, updatemenus=[_buttons()], margin={"l": 0, "r": 0, "t": 44, "b": 44})
    return Plot("Measured and predicted shapes", HEIGHT, out)


def _camera(gravity: np.ndarray) -> dict[str, dict[str, float]]:
    """A view from the side and a little above, with gravity pointing down the page."""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    along = np.cross(across, up)
    eye, center = 1.5 * across + 1.25 * along + 0.4 * up, -0.2 * up
    vectors = {"up": up, "eye": eye, "center": center}
    return {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in vectors.items()}


def _buttons() -> dict[str, object]:
    """Two views: true to scale, and with every prediction drawn further from the measured shape."""
    views = {
        "true to scale": [True, True, True, False, False, True],
        f"differences \N{MULTIPLICATION SIGN} {LARGER:g}": [True, False, False, True, True, True],
    }
    buttons = [{"label": label, "method": "restyle", "args": [{"visible": shown}]} for label, shown in views.items()]
    place = {"direction": "right", "x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "pad": {"t": 4}}
    return {"type": "buttons", "buttons": buttons, "bgcolor": "#ffffff", "bordercolor": "#c3c9cd", "font": {"size": 13}, **place}


def _trace(shapes: list[np.ndarray], name: str, mode: str, **style: object) -> go.Scatter3d:
    """Several shapes as one trace, with a gap between."""
    gap = np.full((1, 3), np.nan)
    xyz = np.concatenate([part for shape in shapes for part in (shape, gap)])
    x, y, z = (numbers(c) for c in xyz.T)
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.1f}, %{y:.1f}, %{z:.1f} mm", **style)
