"""A described robot as a picture: straight, in its base frame, so that a wrong unit or sign is seen before any data are."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import plotly.graph_objects as go

from twin.body import Body
from twin.errors import DataError
from twin.report.plots import ACCENT, BEFORE, MEASURED, box, figure, plain
from twin.robots import Robot

MM = 1e3
HEIGHT = 760  # pixels
AXES = {"x": "#c0392b", "y": "#27874b", "z": "#2456a6"}
TENDONS = (ACCENT, "#b8651b", "#6a3d9a", "#8a8d1f", "#a83279", "#3a6ea5")
RIM = 48  # points of a circle
ARROW = 0.25  # of the robot's size: the base frame's axes, and gravity


def draw(robot: Robot) -> go.Figure:
    """The straight robot in 3-D, mm: body, disks or pulleys, tendons through their holes, markers, base frame, gravity."""
    body = robot.build()
    model = body.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    traces = _solids(model, data)
    for i, sites in enumerate(body.tendons, 1):
        path = np.array([data.site(site).xpos for site in sites])
        color = TENDONS[(i - 1) % len(TENDONS)]
        holes = {"size": 2.5, "color": color}
        traces.append(_lines([path], f"tendon {i}", mode="lines+markers", line={"color": color, "width": 4}, marker=holes))
    traces += _markers(body, data)
    size = MM * float(np.abs(data.site_xpos).max())
    for n, (axis, color) in enumerate(AXES.items()):
        end = np.eye(3)[n] * ARROW * size / MM
        traces.append(
            _lines([np.array([np.zeros(3), end])], f"base frame, {axis}", line={"color": color, "width": 6}, text=["", axis])
        )
    pull = float(np.linalg.norm(robot.gravity))
    if pull > 0.0:
        start = np.array([0.0, -0.5, 0.0]) * ARROW * size / MM
        arrow = np.array([start, start + robot.gravity / pull * ARROW * size / MM])
        traces.append(
            _lines([arrow], f"gravity, {pull:.2f} m/s²", line={"color": "#000000", "width": 6, "dash": "dot"}, text=["", "g"])
        )
    drawn = np.concatenate([np.array([t.x, t.y, t.z], float).T for t in traces])
    scene = box(drawn[np.isfinite(drawn).all(axis=1)])
    title = {"text": plain(f"{robot.name}: {robot.title}"), "font": {"size": 15}}
    beside = {"x": 0.0, "y": 1.0}  # above there is no room for twelve tendons
    return figure(traces, HEIGHT, scene=scene, title=title, legend=beside, margin={"l": 0, "r": 0, "t": 50, "b": 0})


def _solids(model: mujoco.MjModel, data: mujoco.MjData) -> list[go.Scatter3d]:
    """Cylinders by both their rims, capsules by their axes."""
    rims, rods = [], []
    turn = np.linspace(0.0, 2.0 * np.pi, RIM + 1)
    for g in range(model.ngeom):
        place, R, size = data.geom_xpos[g], data.geom_xmat[g].reshape(3, 3), model.geom_size[g]
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            circle = np.stack([size[0] * np.cos(turn), size[0] * np.sin(turn), np.zeros_like(turn)], axis=1)
            rims += [place + (circle + side * np.array([0.0, 0.0, size[1]])) @ R.T for side in (-1.0, 1.0)]
        else:
            rods.append(place + np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]]) @ R.T)
    disks = _lines(rims, "disks, plates, pulleys", line={"color": BEFORE, "width": 2})
    return [_lines(rods, "body", line={"color": MEASURED, "width": 7}), disks]


def _markers(body: Body, data: mujoco.MjData) -> list[go.Scatter3d]:
    seen = {c.rpartition("_")[0]: s.index for c, s in body.senses.items() if s.group == "marker"}
    names = [name for name in seen if name != "tip"] or list(seen)  # the tip's own name is one more for what is there already
    if not names:
        return []
    at = np.array([data.site(body.markers[seen[name]]).xpos for name in names])
    style = {"size": 5, "color": "#d62728", "symbol": "diamond"}
    return [_lines([at], "markers", mode="markers+text", marker=style, text=names, textposition="top center")]


def _lines(paths: list[np.ndarray], name: str, mode: str = "lines+text", **style: object) -> go.Scatter3d:
    """Several paths (n, 3) m as one trace in mm, with a gap between."""
    gap = np.full((1, 3), np.nan)
    xyz = MM * np.concatenate([part for path in paths for part in (path, gap)] or [gap])
    x, y, z = xyz.T
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.2f}, %{y:.2f}, %{z:.2f} mm", **style)


def write_drawing(robot: Robot, path: Path) -> None:
    """Writes the picture as one self-contained HTML file, whole or not at all. Raises DataError where it cannot be written."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(str(draw(robot).to_html(include_plotlyjs=True, full_html=True)), "utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise DataError(f"{path}: cannot be written ({error.strerror or error}); give another file with --out") from None
