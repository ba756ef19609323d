"""What a bench takes out of a recording: clocks, bridged gaps, the room's temperature, loads, the order of trials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import ROOM_TEMPERATURE, PreparedRecording, prepare, smoothed_room_temperature
from twin.robots import load

ROBOT = load("continuum")
TIME = np.array([5.0, 6.0, 8.0, 9.0])  # s; a log need not begin at zero
CHANNELS = (*(Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)), Channel("disk_8_x", "output", "mm"))


def trial(name: str, start: float | None = None, **changed: np.ndarray) -> Trial:
    values = {c.name: np.zeros(len(TIME)) for c in CHANNELS} | changed
    return Trial(name, TIME, values, {"tip_payload": 0.01}, start=start)


def prepared(*trials: Trial, gravity: np.ndarray | None = None) -> PreparedRecording:
    return prepare(Recording("continuum", "made", "simulation: none", gravity, CHANNELS, trials), ROBOT)


def clocks(bench: PreparedRecording) -> list[list[float]]:
    return [i.clock.tolist() for i in bench.inputs]


def test_the_clock_runs_from_the_start_that_was_logged_and_orders_the_trials() -> None:
    bench = prepared(trial("late.csv", 100.0), trial("early.csv", 10.0))
    assert [i.name for i in bench.inputs] == ["early.csv", "late.csv"]
    assert clocks(bench) == [[10.0, 11.0, 13.0, 14.0], [100.0, 101.0, 103.0, 104.0]]
    assert not bench.notices


def test_trials_without_start_follow_each_other_without_a_pause_and_that_is_said() -> None:
    bench = prepared(trial("a.csv"), trial("b.csv"), trial("c.csv"))
    assert clocks(bench) == [[0.0, 1.0, 3.0, 4.0], [4.0, 5.0, 7.0, 8.0], [8.0, 9.0, 11.0, 12.0]]
    assert len(bench.notices) == 1
    assert "without a pause" in bench.notices[0]


def test_a_start_among_trials_without_one_sets_the_clock() -> None:
    bench = prepared(trial("a.csv"), trial("b.csv", 20.0), trial("c.csv"))
    assert clocks(bench) == [[0.0, 1.0, 3.0, 4.0], [20.0, 21.0, 23.0, 24.0], [24.0, 25.0, 27.0, 28.0]]


def test_a_gap_in_what_drives_is_bridged_by_a_straight_line_in_time_and_said() -> None:
    holed = trial("holed.csv", 0.0, tendon_2_tension=np.array([1.0, np.nan, np.nan, 3.0]))
    bench = prepared(holed)
    np.testing.assert_allclose(bench.inputs[0].command[:, 1], [1.0, 1.5, 2.5, 3.0], rtol=0, atol=1e-15)  # 0.5 N/s
    assert "the twin is driven by straight lines where tendon_2_tension has no value (holed.csv)" in bench.notices
    with pytest.raises(DataError, match=r"tendon_2_tension is empty in this trial"):
        prepared(trial("empty.csv", 0.0, tendon_2_tension=np.full(4, np.nan)))


def test_the_rooms_temperature_is_logged_else_declared_else_that_of_rooms() -> None:
    channels = (*CHANNELS, Channel("ambient_temperature", "context", "K"))
    warming = np.array([300.0, np.nan, 303.0, 304.0])
    logged = trial("a.csv", 0.0, ambient_temperature=warming)
    nothing = trial("b.csv", 50.0, ambient_temperature=np.full(4, np.nan))
    declared = replace(trial("c.csv", 90.0, ambient_temperature=np.full(4, np.nan)), conditions={"ambient_temperature": 290.0})
    bench = prepare(Recording("continuum", "made", "simulation: none", None, channels, (logged, nothing, declared)), ROBOT)
    np.testing.assert_allclose(bench.inputs[0].temperature, [300.0, 301.0, 303.0, 304.0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(bench.inputs[1].temperature, ROOM_TEMPERATURE)
    np.testing.assert_array_equal(bench.inputs[2].temperature, 290.0)


@pytest.mark.parametrize("room", ["warms", "is let in"])
def test_a_thermometers_noise_is_not_the_rooms(room: str) -> None:
    """0.1 K of white noise: of a room that warms evenly a line of two numbers would keep sqrt(2 / 150) of it, and a curve that goes
    by the data up to four times that; where a door opens nothing is gained, and up to half a step is lost beside it, within the
    means' two rows and a spline's three pieces."""
    time, rng = np.arange(0.0, 60.0, 0.4), np.random.default_rng(4)
    true = 296.0 + (0.01 * time if room == "warms" else -4.0 * (time > 30.0))
    found = smoothed_room_temperature(time, true + rng.normal(0.0, 0.1, time.size))
    off = np.abs(found - true)
    assert np.sqrt(np.mean(off**2)) < (0.045 if room == "warms" else 0.2)
    assert (off > (0.15 if room == "warms" else 0.35)).sum() <= (0 if room == "warms" else 6)
    assert off.max() < 2.0
    still = np.full(150, 296.15)
    assert smoothed_room_temperature(time, still) is still


def test_loads_are_the_trials_else_the_sets_else_the_robots() -> None:
    up, side, force = np.array([0.0, 0.0, -9.81]), np.array([9.81, 0.0, 0.0]), np.array([0.1, 0.2, 0.3])
    turned = replace(trial("a.csv", 0.0), conditions={"gravity": side, "tip_force": force})
    bench = prepared(turned, trial("b.csv", 50.0), gravity=up)
    np.testing.assert_array_equal(bench.inputs[0].loads.gravity, side)
    np.testing.assert_array_equal(bench.inputs[0].loads.force, force)
    assert bench.inputs[0].loads.payload == 0.0
    np.testing.assert_array_equal(bench.inputs[1].loads.gravity, up)
    np.testing.assert_array_equal(bench.inputs[1].loads.force, np.zeros(3))
    assert bench.inputs[1].loads.payload == 0.01
    np.testing.assert_array_equal(prepared(trial("a.csv")).inputs[0].loads.gravity, ROBOT.gravity)
