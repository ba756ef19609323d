"""A picture of a described robot, straight in its base frame, so that a wrong unit or sign is seen before any data."""

from pathlib import Path

import mujoco
import numpy as np
import plotly.graph_objects as go

from twin.body import Body
from twin.foundation.atomic_write import write_atomically
from twin.report.numbers import MM_PER_M
from twin.report.plots.figures import ACCENT_COLOUR, BEFORE_COLOUR, MEASURED_COLOUR, equal_axes, escape_markup, styled_figure
from twin.robots import Robot

ROBOT_PAGE_HEIGHT = 760  # pixels
AXIS_COLOURS = {"x": "#c0392b", "y": "#27874b", "z": "#2456a6"}
TENDON_COLOURS = (ACCENT_COLOUR, "#b8651b", "#6a3d9a", "#8a8d1f", "#a83279", "#3a6ea5")
RIM_POINTS = 48  # of a circle
ARROW_SHARE = 0.25  # of the robot's size: length of the base frame's axes, and of gravity


def draw_robot(robot: Robot) -> go.Figure:
    """Draw the straight robot in 3-D, mm: body, disks or pulleys, tendons, markers, base frame, gravity."""
    body = robot.build()
    model = body.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    traces = _solid_traces(model, data)
    for i, sites in enumerate(body.tendon_sites, 1):
        path = np.array([data.site(site).xpos for site in sites])
        color = TENDON_COLOURS[(i - 1) % len(TENDON_COLOURS)]
        holes = {"size": 2.5, "color": color}
        traces.append(_line_trace([path], f"tendon {i}", mode="lines+markers", line={"color": color, "width": 4}, marker=holes))
    traces += _marker_traces(body, data)
    size = MM_PER_M * float(np.abs(data.site_xpos).max())
    for n, (axis, color) in enumerate(AXIS_COLOURS.items()):
        end = np.eye(3)[n] * ARROW_SHARE * size / MM_PER_M
        traces.append(
            _line_trace([np.array([np.zeros(3), end])], f"base frame, {axis}", line={"color": color, "width": 6}, text=["", axis])
        )
    gravity = float(np.linalg.norm(robot.gravity))
    if gravity > 0.0:
        start = np.array([0.0, -0.5, 0.0]) * ARROW_SHARE * size / MM_PER_M
        arrow = np.array([start, start + robot.gravity / gravity * ARROW_SHARE * size / MM_PER_M])
        traces.append(
            _line_trace(
                [arrow], f"gravity, {gravity:.2f} m/s²", line={"color": "#000000", "width": 6, "dash": "dot"}, text=["", "g"]
            )
        )
    drawn = np.concatenate([np.array([t.x, t.y, t.z], float).T for t in traces])
    scene = equal_axes(drawn[np.isfinite(drawn).all(axis=1)])
    title = {"text": escape_markup(f"{robot.name}: {robot.title}"), "font": {"size": 15}}
    inside = {"x": 0.0, "y": 1.0}  # there is no room above for twelve tendons
    return styled_figure(
        traces, ROBOT_PAGE_HEIGHT, scene=scene, title=title, legend=inside, margin={"l": 0, "r": 0, "t": 50, "b": 0}
    )


def _solid_traces(model: mujoco.MjModel, data: mujoco.MjData) -> list[go.Scatter3d]:
    """Draw cylinders by both their rims, capsules by their axes, balls by circles, other shapes by the edges of a box."""
    rims, rods = [], []
    for g in range(model.ngeom):
        place, R, size = data.geom_xpos[g], data.geom_xmat[g].reshape(3, 3), model.geom_size[g]
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            rods.append(place + np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]]) @ R.T)
        else:
            rims += [place + line @ R.T for line in _outline(model, g)]
    disks = _line_trace(rims, "disks, plates, pulleys", line={"color": BEFORE_COLOUR, "width": 2})
    return [_line_trace(rods, "body", line={"color": MEASURED_COLOUR, "width": 7}), disks]


def _outline(model: mujoco.MjModel, g: int) -> list[np.ndarray]:
    """Return lines (n, 3) m of a geom in its own frame; none of a floor."""
    kind, size, G = mujoco.mjtGeom(int(model.geom_type[g])), model.geom_size[g], mujoco.mjtGeom
    turn = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS + 1)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    if kind == G.mjGEOM_CYLINDER:
        return [size[0] * circle + side * np.array([0.0, 0.0, size[1]]) for side in (-1.0, 1.0)]
    if kind in (G.mjGEOM_SPHERE, G.mjGEOM_ELLIPSOID):
        return [np.roll(circle, k, axis=1) * (size if kind == G.mjGEOM_ELLIPSOID else size[0]) for k in range(3)]
    if kind in (G.mjGEOM_PLANE, G.mjGEOM_HFIELD):
        return []
    middle, half = model.geom_aabb[g, :3], model.geom_aabb[g, 3:]
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], float)
    ends = [np.column_stack([square, np.full(5, side)]) for side in (-1.0, 1.0)]
    sides = [np.array([[x, y, -1.0], [x, y, 1.0]]) for x, y in square[:4]]
    return [middle + half * line for line in (*ends, *sides)]


def _marker_traces(body: Body, data: mujoco.MjData) -> list[go.Scatter3d]:
    seen = {c[: -len("_x")]: s.index for c, s in body.senses.items() if s.group == "marker"}
    guides = {f"site.{site}" for sites in body.tendon_sites for site in sites}  # of an MJCF, on its tendons
    names = [name for name in seen if name != "tip" and name not in guides] or list(seen)  # the tip is also the last marker
    if not names:
        return []
    at = np.array([data.site(body.marker_sites[seen[name]]).xpos for name in names])
    style = {"size": 5, "color": "#d62728", "symbol": "diamond"}
    return [_line_trace([at], "markers", mode="markers+text", marker=style, text=names, textposition="top center")]


def _line_trace(paths: list[np.ndarray], name: str, mode: str = "lines+text", **style: object) -> go.Scatter3d:
    """Draw several paths (n, 3) m as one trace in mm, with gaps between."""
    gap = np.full((1, 3), np.nan)
    xyz = MM_PER_M * np.concatenate([part for path in paths for part in (path, gap)] or [gap])
    x, y, z = xyz.T
    return go.Scatter3d(x=x, y=y, z=z, name=name, mode=mode, hovertemplate="%{x:.2f}, %{y:.2f}, %{z:.2f} mm", **style)


def write_drawing(robot: Robot, path: Path) -> None:
    """Write the picture as one self-contained HTML file, whole or not at all. Raises DataError where it cannot be written."""
    html = str(draw_robot(robot).to_html(include_plotlyjs=True, full_html=True))
    write_atomically(path, html.encode(), "give another file with --out")
