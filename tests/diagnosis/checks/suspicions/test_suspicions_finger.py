"""What a finger's files may mean otherwise, on free trials of the independent finite element bench, filmed without markers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin.diagnosis import Settings
from twin.diagnosis.checks.preview import preview_data
from twin.diagnosis.checks.suspicions import Suspicion
from twin.foundation.errors import SolveError
from twin.measurements import Recording, read
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

SENSOR = "sensor_2_resistance"
Values = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def day() -> Recording:
    """Two free trials, one of them with clouds."""
    return read(Path(__file__).parents[3] / "data/finger_shape").select(["align_1", "test_1"])


def told(recording: Recording) -> list[Suspicion]:
    twin = Twin.of(load("finger"))
    return list(preview_data(prepare(recording, twin.robot), twin, Settings(jobs=1)).suspicions)


def rewritten(recording: Recording, change: Callable[[Values], None]) -> Recording:
    trials = []
    for t in recording.trials:
        values = dict(t.values)
        change(values)
        trials.append(replace(t, values=values))
    return replace(recording, trials=tuple(trials))


def larger(recording: Recording, factor: float) -> Recording:
    """The clouds of a robot so many times as large."""
    trials = [
        t if t.clouds is None else replace(t, clouds=replace(t.clouds, points=factor * t.clouds.points)) for t in recording.trials
    ]
    return replace(recording, trials=tuple(trials))


def test_an_honest_day_without_markers_raises_none(day: Recording) -> None:
    assert told(day) == []


@pytest.mark.parametrize("factor", [0.6, 1.6])
def test_clouds_of_another_robot(day: Recording, factor: float) -> None:
    kinds = {s.kind: s.words for s in told(larger(day, factor))}
    assert "near the base" in kinds["point clouds"]


def test_a_cloud_in_millimetres(day: Recording) -> None:
    assert "point clouds" in {s.kind for s in told(larger(day, 1e3))}


def test_a_sensor_that_stands_still_but_for_noise(day: Recording) -> None:
    rng = np.random.default_rng(0)

    def dead(values: Values) -> None:
        values[SENSOR] = 1050.0 + 0.3 * rng.normal(size=len(values[SENSOR]))

    found = {s.kind: s.words for s in told(rewritten(day, dead))}
    assert SENSOR in found["dead channel"]
    assert "sensor_1_resistance" not in found["dead channel"]


def test_a_weak_sensor_is_not_dead(day: Recording) -> None:
    """A tenth of its gauge factor is a gain, which an effect describes."""

    def weak(values: Values) -> None:
        rest = values[SENSOR][0]
        values[SENSOR] = rest * (1.0 + 0.1 * (np.sqrt(values[SENSOR] / rest) - 1.0)) ** 2

    assert "dead channel" not in {s.kind for s in told(rewritten(day, weak))}


def test_tendons_that_all_lie_on_one_side_have_no_equilibrium_and_that_is_said(day: Recording) -> None:
    """Azimuths in a unit a thousand times as large: tendons that are one and the same leave a tangent without an inverse."""
    robot = load("finger")
    azimuths = {p.name: 1e-3 * p.value for p in robot.parameters if p.name.startswith("tendons.azimuth")}
    assert len(azimuths) == 4

    def pulled_alike(values: Values) -> None:
        for i in (1, 2, 3, 4):
            values[f"tendon_{i}_displacement"] = np.linspace(0.0, 8e-3, len(values[SENSOR]))

    bench: PreparedRecording = prepare(rewritten(day, pulled_alike), robot)
    with pytest.raises(SolveError, match="no static equilibrium"):
        simulate(replace(Twin.of(robot), values=azimuths), bench)
