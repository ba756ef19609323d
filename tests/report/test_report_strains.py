"""Strain loops in the report: what is drawn is what was measured, and what the twins say of the same trial."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.measurements import read
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.report.plots import strain_loops as strains
from twin.robots.robot import models_folder


@pytest.fixture(scope="module")
def story() -> Any:
    """A day whose twin reads every cord's change 10 % too large; nothing is simulated."""
    robot = Twin.of("finger").robot
    bench = prepare(read(models_folder() / "finger/samples/drift"), robot)
    held_out = tuple(k for k, i in enumerate(bench.inputs) if i.name.startswith("sweep_1"))
    cords = [j for j, o in enumerate(bench.outputs) if o.group == "sensor"]
    off = [y.copy() for y in bench.measured]
    for y in off:
        y[:, cords] = y[:1, cords] * (np.sqrt(y[:, cords] / y[:1, cords]) * 1.1 - 0.1) ** 2
    predictions = {"calibrated": off, "after": list(bench.measured)}
    return SimpleNamespace(prepared=bench, held_out_trials=held_out, claims=("one",), predictions=predictions)


def test_loops_are_of_the_tendon_that_moves_the_cords_most(story: Any) -> None:
    drawn = strains.plot(story)
    assert drawn is not None
    traces: Any = drawn.figure.data
    before, after, dots = traces[:4], traces[4:8], traces[8:]
    assert [t.name for t in dots] == [f"sensor_{i}_resistance" for i in range(1, 5)]
    layout: Any = drawn.figure.layout
    assert "tendon_1_displacement (mm)" in layout.xaxis.title.text  # sweep 1 is of tendon 1
    off, same, felt = (np.concatenate([t.y for t in group]) for group in (before, after, dots))
    assert np.allclose(same, felt, equal_nan=True)  # this twin predicts what was measured
    moved = np.abs(felt) > 1.0  # %
    assert moved.sum() > 20
    assert np.allclose(off[moved] / felt[moved], 1.1, rtol=1e-4)


def test_apparent_strain_is_kappa_times_strain_since_the_first_reading() -> None:
    R = np.array([[np.nan, 1000.0], [900.0, 1000.0], [900.0 * 1.1**2, 810.0]])
    assert np.allclose(strains.apparent_strain(R)[1:], [[0.0, 0.0], [0.1, -0.1]])


def test_a_robot_without_cords_and_a_trial_at_rest_have_no_loops(story: Any) -> None:
    none: Any = SimpleNamespace(**{**vars(story), "held_out_trials": ()})
    assert strains.plot(none) is None
    still = SimpleNamespace(
        **{**vars(story.prepared), "inputs": [SimpleNamespace(command=np.zeros((5, 4))) for _ in story.prepared.inputs]}
    )
    resting: Any = SimpleNamespace(**{**vars(story), "prepared": still})
    assert strains.plot(resting) is None
