"""Measured and predicted shapes of a few poses of held-out trials, in 3-D with equal axes."""

import numpy as np
import plotly.graph_objects as go

from twin.diagnosis import Diagnosis
from twin.report.numbers import MM_PER_M
from twin.report.plots import skin
from twin.report.plots.figures import BEFORE_COLOUR, MEASURED_COLOUR, Plot, equal_axes, single_precision, styled_figure
from twin.report.plots.predictions import compared_stages, complete_markers
from twin.report.sections.section import Section, Story
from twin.report.sentence import trial_labels

POSES_DRAWN = 4
SHAPES_HEIGHT = 560


def section(story: Story) -> Section | None:
    """Return the section with the shapes; None of a recording with neither two markers nor clouds."""
    d = story.diagnosis
    whole = complete_markers(d.prepared)
    chosen = choose_poses(d) if len(whole) > 1 else []
    content: dict[str, object] = {"plot": _plot(d, chosen) if chosen else None, "poses": _pose_labels(d, chosen)}
    clouds = skin.clouds_before_after(d)
    if len(whole) < 2 and not clouds:
        return None
    content["skin"] = skin.plot(d, clouds) if clouds else None
    content["distances"] = skin.describe_distances(d, clouds) if clouds else None
    return Section("shapes", "Shapes", "data/shapes.html", content)


def choose_poses(d: Diagnosis) -> list[tuple[int, int]]:
    """Choose (trial, sample) of up to four complete held-out poses that differ most, the most bent first."""
    columns = [c for _, three in complete_markers(d.prepared) for c in three]
    tip = columns[-3:]
    at = [(k, n) for k in d.held_out_trials for n in np.flatnonzero(np.isfinite(d.prepared.measured[k][:, columns]).all(axis=1))]
    if not at:
        return []
    place = np.array([d.prepared.measured[k][n, tip] for k, n in at])
    chosen = [int(np.argmax(np.hypot(place[:, 0], place[:, 1])))]
    while len(chosen) < min(POSES_DRAWN, len(at)):
        distance = np.linalg.norm(place[:, None] - place[chosen][None], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    return [(at[i][0], int(at[i][1])) for i in chosen]


def _pose_labels(d: Diagnosis, chosen: list[tuple[int, int]]) -> list[str]:
    names = trial_labels(d, tuple(k for k, _ in chosen))
    return [f"{name} at {d.prepared.inputs[k].time[n]:.1f} s" for name, (k, n) in zip(names, chosen, strict=True)]


def _plot(d: Diagnosis, chosen: list[tuple[int, int]]) -> Plot:
    columns = [three for _, three in complete_markers(d.prepared)]
    measured = np.array([MM_PER_M * d.prepared.measured[k][n][columns] for k, n in chosen])  # (n_pose, n_marker, 3) mm
    stages = compared_stages(d)
    predicted = [np.array([MM_PER_M * d.predictions[s.key][k][n][columns] for k, n in chosen]) for s in stages]
    times = _magnification(measured, predicted)
    larger = [measured + times * (p - measured) for p in predicted]
    traces = [_trace(measured, "measured", "markers", marker={"size": 4, "color": MEASURED_COLOUR})]
    for shapes, visible in ((predicted, True), (larger, False)):
        for s, shape in zip(stages, shapes, strict=True):
            traces.append(_trace(shape, s.label, "lines", line={"width": 4, "color": s.colour}, visible=visible))
    origin = {"size": 5, "color": BEFORE_COLOUR, "symbol": "square"}
    traces.append(go.Scatter3d(x=[0], y=[0], z=[0], name="origin of the base frame", mode="markers", marker=origin))
    every = np.concatenate([measured, *predicted, *larger]).reshape(-1, 3)
    scene = {**equal_axes(np.vstack([every, np.zeros(3)])), "camera": _camera(d.prepared.inputs[chosen[0][0]].loads.gravity)}
    out = styled_figure(
        traces, SHAPES_HEIGHT, scene=scene, updatemenus=[_buttons(times)], margin={"l": 0, "r": 0, "t": 44, "b": 44}
    )
    return Plot("Measured and predicted shapes", SHAPES_HEIGHT, out)


def _magnification(measured: np.ndarray, predicted: list[np.ndarray]) -> float:
    """Return the round factor by which the second view enlarges differences, up to a sixth of the picture."""
    largest = max(float(np.abs(p - measured).max()) for p in predicted)
    wanted = float(np.ptp(measured.reshape(-1, 3), axis=0).max()) / (6.0 * max(largest, 1e-9))
    return max([n for n in (2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if n <= wanted], default=2.0)


def _camera(gravity: np.ndarray) -> dict[str, dict[str, float]]:
    """Return a view from the side and a little above, with gravity down the page."""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    along = np.cross(across, up)
    eye, center = 1.6 * across + 1.35 * along + 0.45 * up, -0.12 * up
    vectors = {"up": up, "eye": eye, "center": center}
    return {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in vectors.items()}


def _buttons(times: float) -> dict[str, object]:
    """Return the buttons for two views: true to scale, and with enlarged differences."""
    views = {
        "true to scale": [True, True, True, False, False, True],
        f"differences \N{MULTIPLICATION SIGN} {times:g}": [True, False, False, True, True, True],
    }
    buttons = [{"label": label, "method": "restyle", "args": [{"visible": shown}]} for label, shown in views.items()]
    place = {"direction": "right", "x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "pad": {"t": 4}}
    return {"type": "buttons", "buttons": buttons, "bgcolor": "#ffffff", "bordercolor": "#c3c9cd", "font": {"size": 13}, **place}


def _trace(shapes: np.ndarray, name: str, mode: str, **style: object) -> go.Scatter3d:
    """Draw several shapes as one trace, with gaps between."""
    gap = np.full((1, 3), np.nan)
    xyz = np.concatenate([part for shape in shapes for part in (shape, gap)])
    x, y, z = (single_precision(c) for c in xyz.T)
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.1f}, %{y:.1f}, %{z:.1f} mm", **style)
