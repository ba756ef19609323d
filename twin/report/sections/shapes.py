"""Measured and predicted shapes of a few poses of sealed trials, in 3-D with equal axes."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from twin.diagnose import Diagnosis
from twin.report import skin
from twin.report.numbers import MM
from twin.report.plots import BEFORE, MEASURED, Plot, box, figure, numbers
from twin.report.sections.section import Section, Story
from twin.report.sentence import labels
from twin.report.stages import before_and_after, markers

POSES = 4
HEIGHT = 560


def section(story: Story) -> Section:
    d = story.diagnosis
    whole = markers(d.bench)
    chosen = poses(d) if len(whole) > 1 else []
    content = {"plot": _plot(d, chosen) if chosen else None, "poses": _words(d, chosen)}
    beside = skin.before_after(d)
    content |= {"skin": skin.plot(d, beside), "off": skin.words(d, beside)} if beside else {"skin": None, "off": None}
    return Section("shapes", "Shapes", "shapes.html", content)


def poses(d: Diagnosis) -> list[tuple[int, int]]:
    """(trial, sample) of up to four complete sealed poses that differ most: the most bent first, then the furthest from those."""
    columns = [c for _, three in markers(d.bench) for c in three]
    tip = columns[-3:]
    at = [(k, n) for k in d.sealed_trials for n in np.flatnonzero(np.isfinite(d.bench.measured[k][:, columns]).all(axis=1))]
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
    measured = np.array([MM * d.bench.measured[k][n][columns] for k, n in chosen])  # (n_pose, n_marker, 3) mm
    stages = before_and_after(d)
    predicted = [np.array([MM * d.predictions[s.key][k][n][columns] for k, n in chosen]) for s in stages]
    times = _magnification(measured, predicted)
    larger = [measured + times * (p - measured) for p in predicted]
    traces = [_trace(measured, "measured", "markers", marker={"size": 4, "color": MEASURED})]
    for shapes, visible in ((predicted, True), (larger, False)):
        for s, shape in zip(stages, shapes, strict=True):
            traces.append(_trace(shape, s.words, "lines", line={"width": 4, "color": s.color}, visible=visible))
    origin = {"size": 5, "color": BEFORE, "symbol": "square"}
    traces.append(go.Scatter3d(x=[0], y=[0], z=[0], name="origin of the base frame", mode="markers", marker=origin))
    every = np.concatenate([measured, *predicted, *larger]).reshape(-1, 3)
    scene = {**box(np.vstack([every, np.zeros(3)])), "camera": _camera(d.bench.inputs[chosen[0][0]].loads.gravity)}
    out = figure(traces, HEIGHT, scene=scene, updatemenus=[_buttons(times)], margin={"l": 0, "r": 0, "t": 44, "b": 44})
    return Plot("Measured and predicted shapes", HEIGHT, out)


def _magnification(measured: np.ndarray, predicted: list[np.ndarray]) -> float:
    """How many times larger the second view draws differences: a round number that makes the largest a sixth of the picture."""
    largest = max(float(np.abs(p - measured).max()) for p in predicted)
    wanted = float(np.ptp(measured.reshape(-1, 3), axis=0).max()) / (6.0 * max(largest, 1e-9))
    return max([n for n in (2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if n <= wanted], default=2.0)


def _camera(gravity: np.ndarray) -> dict[str, dict[str, float]]:
    """A view from the side and a little above, with gravity pointing down the page."""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    along = np.cross(across, up)
    eye, center = 1.6 * across + 1.35 * along + 0.45 * up, -0.12 * up
    vectors = {"up": up, "eye": eye, "center": center}
    return {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in vectors.items()}


def _buttons(times: float) -> dict[str, object]:
    """Two views: true to scale, and with every prediction drawn further from the measured shape."""
    views = {
        "true to scale": [True, True, True, False, False, True],
        f"differences \N{MULTIPLICATION SIGN} {times:g}": [True, False, False, True, True, True],
    }
    buttons = [{"label": label, "method": "restyle", "args": [{"visible": shown}]} for label, shown in views.items()]
    place = {"direction": "right", "x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "pad": {"t": 4}}
    return {"type": "buttons", "buttons": buttons, "bgcolor": "#ffffff", "bordercolor": "#c3c9cd", "font": {"size": 13}, **place}


def _trace(shapes: np.ndarray, name: str, mode: str, **style: object) -> go.Scatter3d:
    """Several shapes as one trace, with a gap between."""
    gap = np.full((1, 3), np.nan)
    xyz = np.concatenate([part for shape in shapes for part in (shape, gap)])
    x, y, z = (numbers(c) for c in xyz.T)
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.1f}, %{y:.1f}, %{z:.1f} mm", **style)
