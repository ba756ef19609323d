"""The skin in the report: distances of clouds made from a known one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from twin.measurements import Clouds, read
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.report.plots import skin
from twin.report.plots.predictions import compared_stages
from twin.robots.robot import models_folder

OFF = 8e-4  # m, of every point outside the true skin


@pytest.fixture(scope="module")
def story() -> Any:
    """A held-out trial of five rows whose clouds stand 0.8 mm outside the skin of a twin with a turned mount."""
    whole, true = read(models_folder() / "finger/samples/drift"), replace(Twin.of("finger"), values={"mounting.angle": 0.1})
    trial = next(t for t in whole.trials if t.label == "sweep_1")
    rows = slice(20, 60, 8)
    short = replace(trial, time=trial.time[rows], values={n: v[rows] for n, v in trial.values.items()})
    bench, drawn = prepare(replace(whole, trials=(short,)), true.robot), true.figure()
    trace, loads = simulate(true, bench)[0], bench.inputs[0].loads
    assert trace.solution is not None
    frames = drawn.frames(trace.solution, loads, true.effect_chain.route)
    points = []
    for at in frames.skin:
        surface = trimesh.Trimesh(at, drawn.faces, process=False)
        side = np.flatnonzero((surface.vertex_normals[:, 1] < -0.3) & (at[:, 2] > 0.02))  # the camera's
        points.append(at[side] + OFF * surface.vertex_normals[side])
    clouds = Clouds(np.concatenate(points), np.cumsum([0, *map(len, points)]), short.time)
    seen = replace(bench, recording=replace(bench.recording, trials=(replace(bench.recording.trials[0], clouds=clouds),)))
    return SimpleNamespace(prepared=seen, folds=(), held_out_trials=(0,), claims=("one",), calibrated=Twin(true.robot), twin=true)


def test_points_stand_off_the_true_skin_as_they_were_put(story: Any) -> None:
    """To a twentieth of the distance: the skin is drawn in facets."""
    before, after = (np.concatenate([b.distance for b in skin.clouds_on_skin(story, stage)]) for stage in compared_stages(story))
    assert np.allclose(after, OFF, atol=0.05 * OFF)
    assert np.std(before) > np.std(after)  # 0.1 rad of mount, felt where the finger is bent
    assert "0.80 mm with the effects" in skin.describe_distances(story, skin.clouds_before_after(story))


def test_the_picture_has_both_stages_and_the_worst_apart(story: Any) -> None:
    drawn = skin.plot(story, skin.clouds_before_after(story))
    traces: Any = drawn.figure.data
    assert [t.visible for t in traces] == [False] * 2 * skin.CLOUDS_DRAWN + [True] * 2 * skin.CLOUDS_DRAWN


def test_a_robot_without_skin_or_clouds_has_no_picture(story: Any) -> None:
    bare: Any = SimpleNamespace(**{**vars(story), "folds": ("each its own twin",)})
    assert skin.clouds_before_after(bare) == []


def test_distances_are_to_the_surface_and_not_to_its_corners() -> None:
    """A can of 10 mm across: a point on the middle of its lid, 2 mm from the rim, is on it, whatever the normals at the rim."""
    can = trimesh.creation.cylinder(5e-3, 30e-3, sections=64)
    points = np.array([[3e-3, 0.0, 15e-3], [3e-3, 0.0, 16e-3], [3e-3, 0.0, 14.5e-3], [5.5e-3, 0.0, 0.0], [0.0, 4.6e-3, 14e-3]])
    assert np.allclose(
        skin.distances_to_skin(points, can), [0.0, 1e-3, -5e-4, 5e-4, -4e-4], atol=1e-5
    )  # m: 64 sections are 6e-6 inside the circle
