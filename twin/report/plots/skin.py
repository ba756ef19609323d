"""Compare the predicted skin with the point clouds of held-out trials.

Distances go one way, from cloud to skin, because the points of clouds do not correspond.
"""

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
import trimesh
from scipy.spatial import KDTree

from twin.body.drawable import Drawable, Frames
from twin.diagnosis import Diagnosis
from twin.foundation.errors import TwinError
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.report.numbers import MM_PER_M
from twin.report.plots.figures import Plot, single_precision, styled_figure, thinned_indices
from twin.report.plots.predictions import TwinStage, compared_stages

CLOUDS_DRAWN, POINTS_DRAWN = 3, 1200  # points of each cloud
COLOUR_LIMIT = 3.0  # mm, where the colours end
SKIN_HEIGHT = 520


@dataclass(frozen=True)
class CloudOnSkin:
    """A cloud (m, 3) m of a held-out trial and the distance of each point from the skin, (m,) m, outwards positive."""

    trial: int
    time: float
    points: np.ndarray
    skin: np.ndarray
    distance: np.ndarray


def clouds_on_skin(d: Diagnosis, stage: TwinStage) -> list[CloudOnSkin]:
    """Return every cloud of the held-out trials with the skin that the twin of a stage predicts.

    Empty where the robot has no skin, and where each trial had a twin of its own.
    """
    recorded = {t.name: t.clouds for t in d.prepared.recording.trials}
    if d.folds or all(recorded[d.prepared.inputs[k].name] is None for k in d.held_out_trials):
        return []
    twin = {"nominal": Twin.of(d.prepared.robot), "calibrated": d.calibrated, "after": d.twin}[stage.key]
    try:
        drawn = twin.figure()
        traces = simulate(twin, d.prepared, trials=d.held_out_trials) if len(drawn.faces) else []
    except TwinError:
        return []
    found = []
    for k, trace in zip(d.held_out_trials, traces, strict=False):
        inputs, seen = d.prepared.inputs[k], recorded[d.prepared.inputs[k].name]
        if seen is not None and trace.solution is not None:
            frames = drawn.frames(trace.solution, twin.effect_chain.surround(inputs.loads), twin.effect_chain.route)
            found += [
                _measure_distances(k, t, seen.points[a:b], drawn, frames.frame_at(int(np.abs(inputs.time - t).argmin())))
                for t, a, b in zip(seen.time, seen.offsets[:-1], seen.offsets[1:], strict=True)
                if b > a
            ]
    return found


def _measure_distances(trial: int, time: float, points: np.ndarray, drawn: Drawable, frames: Frames) -> CloudOnSkin:
    skin = frames.skin[0]
    return CloudOnSkin(
        trial, float(time), points, skin, distances_to_skin(points, trimesh.Trimesh(skin, drawn.faces, process=False))
    )


def distances_to_skin(points: np.ndarray, skin: trimesh.Trimesh) -> np.ndarray:
    """Return the signed distance (m,) m of points (m, 3) m from a skin, positive outside.

    It uses the nearest of the triangles that meet at the nearest vertex.
    """
    around = skin.vertex_faces[KDTree(skin.vertices).query(points)[1]]  # (m, k), -1 where fewer meet
    each = np.repeat(points[:, None], around.shape[1], axis=1)
    nearest = trimesh.triangles.closest_point(skin.triangles[around].reshape(-1, 3, 3), each.reshape(-1, 3)).reshape(each.shape)
    away = np.where(around < 0, np.inf, np.linalg.norm(each - nearest, axis=2))
    row, best = np.arange(len(points)), away.argmin(axis=1)
    outwards = ((points - nearest[row, best]) * skin.face_normals[around[row, best]]).sum(axis=1)
    return np.copysign(away[row, best], outwards)


def clouds_before_after(d: Diagnosis) -> list[list[CloudOnSkin]]:
    """Return `clouds_on_skin` of each stage that the report compares; empty where a stage has none."""
    each = [clouds_on_skin(d, stage) for stage in compared_stages(d)]
    return each if all(each) else []


def describe_distances(d: Diagnosis, each: list[list[CloudOnSkin]]) -> str:
    """State the median distances of the held-out clouds before and after."""
    medians = []
    for stage, found in zip(compared_stages(d), each, strict=True):
        distances = MM_PER_M * np.abs(np.concatenate([b.distance for b in found]))
        medians.append(f"{np.median(distances):.2f} mm {stage.label} (90 % within {np.quantile(distances, 0.9):.2f})")
    return f"Median distance from the points of held-out clouds to the predicted skin: {', '.join(medians)}."


def plot(d: Diagnosis, each: list[list[CloudOnSkin]]) -> Plot:
    """Plot the held-out clouds that differ most on the predicted skin, coloured by distance; a click switches before and after."""
    stages = compared_stages(d)
    chosen = _most_different(each[-1])
    faces = d.twin.figure().faces
    up, sight = _view_directions(d, [each[-1][i] for i in chosen])
    aside = 1.3 * MM_PER_M * max(np.ptp(each[-1][i].skin, axis=0).max() for i in chosen) / CLOUDS_DRAWN**0.5 * np.cross(up, sight)
    traces = []
    for stage_index, found in enumerate(each):
        for place, i in enumerate(chosen):
            traces += _traces(found[i], faces, place * aside, stage_index == len(each) - 1, place == 0)
    per = len(traces) // len(stages)
    buttons = [
        {"label": stage.label, "method": "restyle", "args": [{"visible": [k // per == s for k in range(len(traces))]}]}
        for s, stage in enumerate(stages)
    ]
    menu = {"type": "buttons", "direction": "right", "buttons": buttons, "active": len(stages) - 1}
    menu |= {"x": 0, "xanchor": "left", "y": 0, "yanchor": "top", "pad": {"t": 4}}
    hidden = {"visible": False}
    scene = {"aspectmode": "data", "dragmode": "orbit", "camera": _camera(up, sight), **{f"{a}axis": hidden for a in "xyz"}}
    out = styled_figure(
        traces, SKIN_HEIGHT, scene=scene, updatemenus=[menu], showlegend=False, margin={"l": 0, "r": 0, "t": 10, "b": 44}
    )
    return Plot("Point clouds of held-out trials on the predicted skin, coloured by their distance from it", SKIN_HEIGHT, out)


def _view_directions(d: Diagnosis, shown: list[CloudOnSkin]) -> tuple[np.ndarray, np.ndarray]:
    """Return two directions (3,) at right angles: up, and from the body to the cameras."""
    gravity = d.prepared.inputs[shown[0].trial].loads.gravity
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    sight = np.mean([b.points.mean(axis=0) - b.skin.mean(axis=0) for b in shown], axis=0)
    sight -= (sight @ up) * up
    return up, sight / max(float(np.linalg.norm(sight)), 1e-12)


def _camera(up: np.ndarray, sight: np.ndarray) -> dict[str, dict[str, float]]:
    return {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in (("up", up), ("eye", 1.5 * sight + 0.25 * up))}


def _most_different(found: list[CloudOnSkin]) -> list[int]:
    """Return the clouds whose skins differ most: the furthest from the mean, then the furthest from those chosen."""
    shapes = np.stack([b.skin.ravel() for b in found])
    chosen = [int(np.linalg.norm(shapes - shapes.mean(axis=0), axis=1).argmax())]
    while len(chosen) < min(CLOUDS_DRAWN, len(found)):
        distance = np.linalg.norm(shapes[:, None] - shapes[chosen][None], axis=2).min(axis=1)
        chosen.append(int(distance.argmax()))
    return chosen


def _traces(cloud: CloudOnSkin, faces: np.ndarray, aside: np.ndarray, visible: bool, barred: bool) -> list[object]:
    x, y, z = (single_precision(c) for c in (MM_PER_M * cloud.skin + aside).T)
    i, j, k = faces.T
    skin = go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, color="#cfd6da", opacity=0.55, hoverinfo="skip", visible=visible)
    few = thinned_indices(len(cloud.points), POINTS_DRAWN)
    px, py, pz = (single_precision(c) for c in (MM_PER_M * cloud.points[few] + aside).T)
    bar = {"title": {"text": "distance from the skin, mm"}, "thickness": 12, "len": 0.7}
    marker = {
        "size": 2.5,
        "color": single_precision(MM_PER_M * cloud.distance[few]),
        "colorscale": "RdBu",
        "cmin": -COLOUR_LIMIT,
        "cmax": COLOUR_LIMIT,
    }
    marker |= {"showscale": barred, "colorbar": bar}
    shown = "%{marker.color:.2f} mm<extra></extra>"
    points = go.Scatter3d(x=px, y=py, z=pz, mode="markers", marker=marker, visible=visible, hovertemplate=shown)
    return [skin, points]
