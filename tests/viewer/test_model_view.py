"""Any MJCF in the viewer: its geoms where MuJoCo has them, its tendons with their tensions, and its joints as measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.mechanics.mjcf.models import robot
from tests.viewer_page import Look, browser, look, served
from twin.body import Drive, Loads, Problem
from twin.foundation.errors import DataError
from twin.measurements import Recording
from twin.mechanics.mjcf import ModelBody
from twin.mechanics.mjcf.drawing import ModelFigure
from twin.prediction.rollout import commands, rollout
from twin.prediction.twin import Twin
from twin.robots import Robot, load
from twin.viewer.drawing.shapes import shape_mesh
from twin.viewer.live import LiveRobot
from twin.viewer.replay import Replay

__all__ = ["browser", "look"]  # fixtures

PARTS = """
<mujoco>
  <compiler angle="degree"/>
  <asset><mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .2"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <geom name="wall" type="plane" size="1 1 1" euler="0 90 0" pos="-1 0 0"/>
    <site name="post" pos="0 0 1"/>
    <geom name="peg" type="cylinder" size=".03 .1" pos=".3 0 .77" euler="90 0 0" group="2"/>
    <body name="arm" pos="0 0 .5">
      <joint name="turn" axis="0 1 0" damping="1"/>
      <geom name="box" type="box" size=".2 .05 .02" pos=".2 0 0" euler="0 0 30" rgba="1 0 0 1"/>
      <geom name="egg" type="ellipsoid" size=".03 .02 .05" pos=".5 0 0" rgba="1 0 0 1"/>
      <geom name="tool" type="mesh" mesh="wedge" pos=".4 0 0" rgba="0 0 1 .5"/>
      <geom name="hull" type="sphere" size=".3" group="3"/>
      <site name="end" pos=".6 0 0"/>
    </body>
  </worldbody>
  <tendon><spatial name="rope"><site site="post"/><geom geom="peg"/><site site="end"/></spatial></tendon>
  <actuator><motor name="pull" tendon="rope" gear="-1" ctrlrange="0 40"/></actuator>
</mujoco>"""


@pytest.fixture
def parts(tmp_path: Path) -> Robot:
    return robot(tmp_path, PARTS)


def figure_of(made: Robot) -> ModelFigure:
    body = made.build()
    assert isinstance(body, ModelBody)
    return ModelFigure(body)


def test_every_geom_that_is_shown_is_where_mujoco_has_it(parts: Robot) -> None:
    """Corners by hand, from the file's own numbers; the wall and the geom of group 3, for collisions, are not shown."""
    figure = figure_of(parts)
    shown = LiveRobot(Twin.of(parts), Drive.CONTROL).shape(np.array([20.0]), Loads(parts.gravity))
    assert len(figure.solids) == 3  # the floor and the peg, the arm's red parts and its blue one
    assert [(s.colour, s.opacity, s.moves) for s in figure.solids[1:]] == [((255, 0, 0), 1.0, True), ((0, 0, 255), 0.5, True)]
    boxed = shape_mesh(figure.solids[1].shapes[0])
    assert boxed.volume == pytest.approx(8 * 0.2 * 0.05 * 0.02)
    # MuJoCo's own box, from its centre and axes in the body's frame: (.2, .05) turned by 30 degrees
    c, s = np.cos(np.pi / 6), 0.5
    corner = np.array([0.2 + 0.2 * c - 0.05 * s, 0.2 * s + 0.05 * c, 0.02])
    assert np.linalg.norm(boxed.vertices - corner, axis=1).min() < 1e-9
    wedge = shape_mesh(figure.solids[2].shapes[0])
    for point in ([0.4, 0, 0], [0.5, 0, 0], [0.4, 0.1, 0], [0.4, 0, 0.2]):  # m, of single precision
        assert np.linalg.norm(wedge.vertices - point, axis=1).min() < 1e-6
    assert shown.link_positions.shape == (1, 3, 3)
    assert np.allclose(shown.link_positions[0, 1], [0.0, 0.0, 0.5])


def test_a_tendon_goes_round_what_it_wraps_and_has_its_tension(parts: Robot) -> None:
    solver, control = parts.solver(parts.build()), (Drive.CONTROL,)
    path = solver.solve(Problem(np.zeros(1), np.array([[30.0]]), Loads(parts.gravity), drives=control))
    shown = figure_of(parts).turned(path, {0: np.zeros(1)})  # the arm level, so that the line from post to end cuts the peg
    long = np.linalg.norm(np.diff(shown.tendon_pieces[0], axis=1)[:, 0], axis=1)
    pieces = shown.tendon_pieces[0][long > 0.0]
    assert shown.tension[0] == pytest.approx(30.0)
    assert np.allclose(pieces[0, 0], [0.0, 0.0, 1.0])
    assert np.allclose(pieces[1:, 0], pieces[:-1, 1])  # one line
    around = np.linalg.norm(pieces[1, :, [0, 2]].T - [0.3, 0.77], axis=1)  # of the peg along y: on its rim, 3 cm
    assert around == pytest.approx(0.03, abs=1e-6)
    assert np.allclose(pieces[-1, 1], [0.6, 0.0, 0.5])  # to the site at the arm's end


def recorded(made: Robot, keep: str) -> Recording:
    """A second of a moving robot with the outputs that begin with `keep`."""
    time = np.arange(51) / 50
    body = made.build()
    columns = {ports[0].channel: 5e-3 * np.sin(3.0 * time) for ports in body.ports}
    whole = rollout(Twin.of(made), commands(Twin.of(made), columns, 50.0)).recording
    channels = tuple(c for c in whole.channels if c.role == "input" or c.name.startswith(keep))
    kept = {c.name for c in channels}
    trials = tuple(replace(t, values={n: v for n, v in t.values.items() if n in kept}) for t in whole.trials)
    return replace(whole, channels=channels, trials=trials)


@pytest.mark.parametrize(
    ("keep", "name", "unit"), [("site.", "marker", "mm"), ("joint.", "joint", "deg"), ("tendon.", "tendon", "mm")]
)
def test_a_replay_compares_what_was_measured(keep: str, name: str, unit: str) -> None:
    leg = load("tendon_leg")
    day = recorded(leg, keep)
    replay, twin = Replay(day, Twin.of(leg)), Twin.of(leg)
    track = replay.predict(twin, 0)
    assert (replay.compared.name, replay.compared.unit) == (name, unit)
    assert track.rms < 1e-9  # SI: it is its own prediction
    assert (track.measured_pose is None) == (keep != "joint.")
    changed = {k: v + 0.01 for k, v in day.trials[0].values.items() if k.startswith(keep)}
    moved = replace(day, trials=(replace(day.trials[0], values={**day.trials[0].values, **changed}),))
    away = Replay(moved, twin).predict(twin, 0)
    # 0.01 rad or m of each reading, of a marker in three directions
    assert away.rms == pytest.approx(0.01 * (np.sqrt(3.0) if keep == "site." else 1.0), rel=1e-6)


def test_the_ghost_stands_at_the_measured_angles() -> None:
    leg = load("tendon_leg")
    day = recorded(leg, "joint.")
    trial, knee = day.trials[0], "joint.knee.position"
    values = {**trial.values, knee: trial.values[knee] + 0.2, "joint.hip.position": np.full(len(trial.time), np.nan)}
    track = Replay(replace(day, trials=(replace(trial, values=values),)), Twin.of(leg)).predict(Twin.of(leg), 0)
    assert track.measured_pose is not None
    ours, seen = track.frames.link_quaternions, track.measured_pose.link_quaternions
    turn = 2.0 * np.arccos(np.clip(np.abs((ours * seen).sum(axis=2)), 0.0, 1.0))  # (n, g) rad between the two
    assert turn.max(axis=1) == pytest.approx(0.2, abs=1e-6)  # the shank's
    assert turn.min(axis=1) == pytest.approx(0.0, abs=1e-6)  # the hip was not measured: as predicted


def test_a_set_with_nothing_to_compare_is_refused() -> None:
    leg = load("tendon_leg")
    with pytest.raises(DataError, match="no joint's or tendon's position"):
        Replay(recorded(leg, "site.foot_tip.x"), Twin.of(leg))


def test_a_browser_shows_it_under_sliders_and_replays_its_joints(look: Look) -> None:
    leg = load("tendon_leg")
    with served([("", Twin.of(leg))]) as here:
        page, app = look(here.address), here.app
        assert page.there()
        before = page.scene()
        page.put("knee_winch, m", "0.01")
        assert page.until(lambda: app.controls.pulls[1].value == 0.01)
        assert page.changed(before)
        assert "N" in app.words.content
    with served([("", Twin.of(leg))], recorded(leg, "joint.")) as here:
        page, app = look(here.address), here.app
        assert page.there()
        assert "joint error **0.00 deg**" in app.words.content
        assert "its joints as measured" in app.words.content
        red = page.scene()
        assert ((red[..., 0] - red[..., 1] > 40) & (red[..., 0] - red[..., 2] > 40)).sum() > 500  # the see-through ghost
