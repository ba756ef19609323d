"""A skin as predicted beside the point clouds of sealed trials: one-way distances, as clouds have no points that correspond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
import trimesh
from scipy.spatial import KDTree

from twin.diagnose import Diagnosis
from twin.errors import TwinError
from twin.figure import Figure, Frames
from twin.report.numbers import MM
from twin.report.plots import Plot, figure, numbers, thin
from twin.report.stages import Stage, before_and_after
from twin.twin import Twin, simulate

POSES, POINTS = 3, 1200  # drawn; of each cloud
WORST = 3.0  # mm, where the colours end
HEIGHT = 520


@dataclass(frozen=True)
class Beside:
    """A cloud (m, 3) m of a sealed trial and how far each point stands off the skin, (m,) m, outwards positive."""

    trial: int
    time: float
    points: np.ndarray
    skin: np.ndarray
    off: np.ndarray


def clouds(d: Diagnosis, stage: Stage) -> list[Beside]:
    """Every cloud of the sealed trials beside the skin that a stage's twin predicts; none where the robot has no skin, or where
    each trial had a twin of its own."""
    of = {t.name: t.clouds for t in d.bench.recording.trials}
    if d.folds or all(of[d.bench.inputs[k].name] is None for k in d.sealed_trials):
        return []
    twin = {"nominal": Twin.of(d.bench.robot), "calibrated": d.calibrated, "after": d.twin}[stage.key]
    try:
        drawn = twin.figure()
        traces = simulate(twin, d.bench, trials=d.sealed_trials) if len(drawn.faces) else []
    except TwinError:
        return []
    found = []
    for k, trace in zip(d.sealed_trials, traces, strict=False):
        inputs, seen = d.bench.inputs[k], of[d.bench.inputs[k].name]
        if seen is not None and trace.path is not None:
            frames = drawn.frames(trace.path, twin.laws.surround(inputs.loads), twin.laws.route)
            found += [
                _beside(k, t, seen.points[a:b], drawn, frames.at(int(np.abs(inputs.time - t).argmin())))
                for t, a, b in zip(seen.time, seen.offsets[:-1], seen.offsets[1:], strict=True)
                if b > a
            ]
    return found


def _beside(trial: int, time: float, points: np.ndarray, drawn: Figure, frames: Frames) -> Beside:
    skin = frames.skin[0]
    return Beside(trial, float(time), points, skin, off(points, trimesh.Trimesh(skin, drawn.faces, process=False)))


def off(points: np.ndarray, skin: trimesh.Trimesh) -> np.ndarray:
    """How far points (m, 3) m stand off a skin, (m,) m, outwards positive: off the nearest of those triangles that meet at the
    nearest corner."""
    around = skin.vertex_faces[KDTree(skin.vertices).query(points)[1]]  # (m, k), -1 where fewer meet
    each = np.repeat(points[:, None], around.shape[1], axis=1)
    nearest = trimesh.triangles.closest_point(skin.triangles[around].reshape(-1, 3, 3), each.reshape(-1, 3)).reshape(each.shape)
    away = np.where(around < 0, np.inf, np.linalg.norm(each - nearest, axis=2))
    row, best = np.arange(len(points)), away.argmin(axis=1)
    outwards = ((points - nearest[row, best]) * skin.face_normals[around[row, best]]).sum(axis=1)
    return np.copysign(away[row, best], outwards)


def before_after(d: Diagnosis) -> list[list[Beside]]:
    """`clouds` of each stage that the report compares; none where a stage has none."""
    each = [clouds(d, stage) for stage in before_and_after(d)]
    return each if all(each) else []


def words(d: Diagnosis, each: list[list[Beside]]) -> str:
    """Median distances of the sealed clouds before and after."""
    said = []
    for stage, found in zip(before_and_after(d), each, strict=True):
        off = MM * np.abs(np.concatenate([b.off for b in found]))
        said.append(f"{np.median(off):.2f} mm {stage.words} (90 % within {np.quantile(off, 0.9):.2f})")
    told = ", ".join(said)
    return f"Points of the clouds of sealed trials, which nothing was fitted to, stand off the predicted skin by {told}; medians."


def plot(d: Diagnosis, each: list[list[Beside]]) -> Plot:
    """A few clouds of sealed trials, those that differ most, on the predicted skin, coloured by their distance from it; before and
    after at a click."""
    stages = before_and_after(d)
    chosen = _apart(each[-1])
    faces = d.twin.figure().faces
    up, sight = _view(d, [each[-1][i] for i in chosen])
    aside = 1.3 * MM * max(np.ptp(each[-1][i].skin, axis=0).max() for i in chosen) / POSES**0.5 * np.cross(up, sight)
    traces = []
    for stage_index, found in enumerate(each):
        for place, i in enumerate(chosen):
            traces += _drawn(found[i], faces, place * aside, stage_index == len(each) - 1, place == 0)
    per = len(traces) // len(stages)
    buttons = [
        {"label": stage.words, "method": "restyle", "args": [{"visible": [k // per == s for k in range(len(traces))]}]}
        for s, stage in enumerate(stages)
    ]
    menu = {"type": "buttons", "direction": "right", "buttons": buttons, "active": len(stages) - 1}
    menu |= {"x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "pad": {"t": 4}}
    hidden = {"visible": False}
    scene = {"aspectmode": "data", "dragmode": "orbit", "camera": _camera(up, sight), **{f"{a}axis": hidden for a in "xyz"}}
    out = figure(traces, HEIGHT, scene=scene, updatemenus=[menu], showlegend=False, margin={"l": 0, "r": 0, "t": 10, "b": 44})
    return Plot("Point clouds of sealed trials on the predicted skin, coloured by their distance from it", HEIGHT, out)


def _view(d: Diagnosis, shown: list[Beside]) -> tuple[np.ndarray, np.ndarray]:
    """Upwards, and from where the cameras saw the body: two directions (3,) at right angles."""
    gravity = d.bench.inputs[shown[0].trial].loads.gravity
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    sight = np.mean([b.points.mean(axis=0) - b.skin.mean(axis=0) for b in shown], axis=0)
    sight -= (sight @ up) * up
    return up, sight / max(float(np.linalg.norm(sight)), 1e-12)


def _camera(up: np.ndarray, sight: np.ndarray) -> dict[str, dict[str, float]]:
    return {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in (("up", up), ("eye", 1.5 * sight + 0.25 * up))}


def _apart(found: list[Beside]) -> list[int]:
    """Clouds whose skins differ most: the one furthest from the mean, then the furthest from those."""
    shapes = np.stack([b.skin.ravel() for b in found])
    chosen = [int(np.linalg.norm(shapes - shapes.mean(axis=0), axis=1).argmax())]
    while len(chosen) < min(POSES, len(found)):
        distance = np.linalg.norm(shapes[:, None] - shapes[chosen][None], axis=2).min(axis=1)
        chosen.append(int(distance.argmax()))
    return chosen


def _drawn(beside: Beside, faces: np.ndarray, aside: np.ndarray, visible: bool, barred: bool) -> list[object]:
    x, y, z = (numbers(c) for c in (MM * beside.skin + aside).T)
    i, j, k = faces.T
    skin = go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, color="#cfd6da", opacity=0.55, hoverinfo="skip", visible=visible)
    few = thin(len(beside.points), POINTS)
    px, py, pz = (numbers(c) for c in (MM * beside.points[few] + aside).T)
    bar = {"title": {"text": "off the skin, mm"}, "thickness": 12, "len": 0.7}
    marker = {"size": 2.5, "color": numbers(MM * beside.off[few]), "colorscale": "RdBu", "cmin": -WORST, "cmax": WORST}
    marker |= {"showscale": barred, "colorbar": bar}
    shown = "%{marker.color:.2f} mm<extra></extra>"
    points = go.Scatter3d(x=px, y=py, z=pz, mode="markers", marker=marker, visible=visible, hovertemplate=shown)
    return [skin, points]
