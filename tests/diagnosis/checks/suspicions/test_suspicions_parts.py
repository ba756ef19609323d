"""Suspicions by hand: single looks at a file, against geometry and plain numbers; whole files are in `test_suspicions.py`."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.recorded_days import recorded_day
from tools.simulators.two_link import write_day
from twin.diagnosis import Settings
from twin.diagnosis.checks.preview import preview_data
from twin.diagnosis.checks.suspicions import suspicions
from twin.diagnosis.checks.suspicions.case import Case
from twin.diagnosis.checks.suspicions.clouds import _nearest
from twin.diagnosis.checks.suspicions.frames import _axes
from twin.diagnosis.checks.suspicions.no_readings.repeats import lost_markers
from twin.diagnosis.checks.suspicions.trials import times
from twin.foundation.errors import SolveError
from twin.measurements import Channel, Clouds, Recording, Trial, read
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

FRIDAY = models_folder() / "continuum/samples/friday"


@pytest.mark.parametrize(
    ("turn", "axes"),
    [
        (np.diag([-1.0, 1.0, 1.0]), "x of the file is -x, y of the file is y, z of the file is z"),
        (
            np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            "x of the file is -y, y of the file is x, z of the file is z",
        ),
        (np.roll(np.eye(3), 1, axis=0), "x of the file is z, y of the file is x, z of the file is y"),
    ],
)
def test_a_turned_frame_is_said_axis_by_axis(turn: np.ndarray, axes: str) -> None:
    """What stands along x of the file is `turn` times what stands in the base frame; two degrees more are no other exchange."""
    assert _axes(turn) == axes
    c, s = np.cos(np.radians(2.0)), np.sin(np.radians(2.0))
    assert _axes(turn @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])) == axes


def test_markers_are_held_against_the_cloud_of_the_same_instant() -> None:
    """A row of markers moves along x by 1 mm a row of 0.1 s; clouds of a grid 2 mm apart about it, between rows, a quarter of a
    row early. Distances in metres, by hand: half the diagonal of a cell in y and z, and what it moved in x."""
    time, rest = np.arange(10) * 0.1, np.stack(np.meshgrid([0.0], [0.0, 10.0], [0.0, 10.0]), axis=-1).reshape(-1, 3) * 1e-3
    markers = rest + np.arange(10)[:, None, None] * [1e-3, 0.0, 0.0]
    markers[:, 0] = np.nan  # one that is not seen
    grid = np.stack(np.meshgrid([0.0], np.arange(-5.0, 15.0, 2.0), np.arange(-5.0, 15.0, 2.0)), axis=-1).reshape(-1, 3) * 1e-3
    when = np.array([0.275, 0.475])
    points = np.concatenate([grid + 10e-3 * t * np.eye(3)[0] for t in when])
    off, spacing = _nearest(markers, time, Clouds(points, np.array([0, len(grid), 2 * len(grid)]), when))
    np.testing.assert_allclose(off, 1e-3 * np.sqrt(2.0 + 0.25**2), rtol=1e-9)  # three markers in two frames
    assert len(off) == 6
    np.testing.assert_allclose(spacing, 2e-3, rtol=1e-9)


@pytest.mark.parametrize(("pause", "mistake"), [(1.2e5, True), (1.2e4, False)])
def test_a_clock_in_ms_is_a_mistake_where_the_trials_clock_is_in_ms_too(pause: float, mistake: bool) -> None:
    """Ten trials of three hours each with a reading every ten minutes: begun every 33 hours, the session lasts twelve days and
    must be one of 20 minutes in ms; begun every 3.3 hours it may be one of slow creep, over within a day and a half."""
    time = np.arange(0.0, 10801.0, 600.0)
    trials = [SimpleNamespace(name=f"{k}", start=k * pause, time=time) for k in range(10)]
    bench: Any = SimpleNamespace(inputs=trials, recording=SimpleNamespace(trials=trials))
    said = [s.kind for s in times(SimpleNamespace(prepared=bench))]  # type: ignore[arg-type]
    assert said == ["time unit"] * mistake


def test_of_two_mistakes_the_one_that_leaves_the_smaller_share_of_the_error_is_said() -> None:
    """An error of 4 mm that a change brings to 0.2 mm is left to a twentieth, however far the robot moves; one that leaves a half
    is none, nor one that leaves as much as the motion."""
    case: Any = SimpleNamespace(motion=lambda columns: 0.05)
    assert Case.better(case, 4e-3, 2e-4, [0]) == pytest.approx(0.05)
    assert Case.better(case, 0.4, 2e-3, [0]) == pytest.approx(0.005)
    assert Case.better(case, 4e-3, 2e-3, [0]) is None
    assert Case.better(case, 4.0, 0.05, [0]) is None


def test_an_encoder_that_counts_the_other_way_is_said(tmp_path: Path) -> None:
    """A joint's angle negated: that joint and no other. Both as they are raise nothing (test_suspicions_silent.py)."""
    write_day(tmp_path / "day", None, 41002)
    day, twin = read(tmp_path / "day"), Twin.of("two_link")
    turned = tuple(replace(t, values={**t.values, "joint_2_angle": -t.values["joint_2_angle"]}) for t in day.trials)
    found = preview_data(prepare(replace(day, trials=turned), twin.robot), twin, Settings(jobs=1)).suspicions
    assert [s.kind for s in found if "joint_2_angle: falls where" in s.words] == ["sign"]
    assert not any("joint_1_angle" in s.words for s in found)


@pytest.mark.parametrize("by", [1, 2])
def test_tendons_counted_from_another_one_are_a_mistake_in_their_order(by: int) -> None:
    """All three columns each under the name of the next, or of the one before."""
    day, names = read(FRIDAY), [f"tendon_{i}_tension" for i in (1, 2, 3)]
    trials = []
    for t in day.trials:
        trials.append(replace(t, values={**t.values, **{names[(i + by) % 3]: t.values[names[i]] for i in range(3)}}))
    found = preview_data(
        prepare(replace(day, trials=tuple(trials)), load("continuum")), Twin.of("continuum"), Settings(jobs=1)
    ).suspicions
    (said,) = (s for s in found if s.kind == "tendon order")
    for i in range(3):
        assert f"{names[(i + by) % 3]} as {names[i]}" in said.change


@pytest.mark.parametrize(("rows", "told"), [((), False), ((3, 4, 5, 6), True), (range(200), False)])
def test_a_marker_at_exactly_zero_in_some_rows_is_lost(rows: Any, told: bool) -> None:
    """One at the base is there in all rows; a tracker that lost one writes zeros in some."""
    recording = read(FRIDAY)
    first, *others = recording.trials
    values = dict(first.values)
    for axis in "xyz":
        column = np.array(values[f"disk_3_{axis}"])
        column[[k for k in rows if k < len(column)]] = 0.0
        values[f"disk_3_{axis}"] = column
    changed = [values, *(t.values for t in others)]
    if len(rows) >= 100:  # all of them, in every trial
        zeros = {f"disk_3_{axis}" for axis in "xyz"}
        changed = [{n: np.zeros_like(v) if n in zeros else v for n, v in t.values.items()} for t in recording.trials]
    prepared = prepare(recording.with_values(changed, recording.source), load("continuum"))
    found = list(lost_markers(Case(prepared, Twin.of("continuum"), None)))
    assert [s.words.partition(",")[0] for s in found] == (["disk_3 in 4 rows"] if told else [])


def ramps(robot: str, stop: float, seed: int = 2) -> Recording:
    """A finger of two links under slow pulls of its first tendon, its second held; its second joint ends at `stop` rad."""
    rng, time, noise = np.random.default_rng(seed), np.arange(0.0, 60.0, 1.0), np.deg2rad(0.1)
    channels = (
        Channel("tendon_1_tension", "input", "N"), Channel("tendon_2_tension", "input", "N"),
        *(Channel(f"joint_{j}_angle", "output", "rad", float(noise)) for j in (1, 2)),
    )  # fmt: skip
    trials = []
    for k, most in enumerate((3.0, 5.0, 8.0, 10.0, 6.0, 9.0)):
        pull = most * np.sin(np.pi * time / 60.0) ** 2
        values = {
            "tendon_1_tension": pull,
            "tendon_2_tension": 0.2 + 0.0 * time,
            "joint_1_angle": 0.0 * time,
            "joint_2_angle": 0.0 * time,
        }
        trials.append(Trial(f"{k}.csv", time, values, start=100.0 * k))
    day = Twin.of(robot).predict(Recording(robot, "made", "simulation", None, channels, tuple(trials)))
    seen = [{**t.values, "joint_2_angle": np.minimum(t.values["joint_2_angle"], stop)} for t in day.trials]
    return day.with_values(
        [{n: v + noise * rng.standard_normal(v.shape) * n.startswith("joint") for n, v in s.items()} for s in seen], "hardware"
    )


@pytest.mark.parametrize(("share", "told"), [(0.3, True), (0.97, False), (2.0, False)])
def test_a_joint_that_stays_at_its_end_while_its_drive_goes_on_has_a_stop(share: float, told: bool) -> None:
    """A third of the travel; where it only just meets the stop, or never does, nothing is said."""
    free = ramps("two_link", 10.0)
    most = max(float(t.values["joint_2_angle"].max()) for t in free.trials)
    day = ramps("two_link", share * most)
    twin = Twin.of("two_link")
    ready = prepare(day, twin.robot)
    predicted = [np.stack([t.values[o.channel.name] for o in ready.outputs], axis=1) for t in twin.predict(day).trials]
    found = [s.words for s in suspicions(ready, twin, (), predicted)]
    stops = [re.fullmatch(r"(\w+) ends at ([\d.]+) deg while the drives go on: a stop", w) for w in found]
    named = [(s[1], float(s[2])) for s in stops if s]
    # deg: of some twenty readings with a noise of 0.1 the median is known to some hundredths, and is given in three digits
    assert named == ([("joint_2_angle", pytest.approx(np.rad2deg(share * most), abs=0.15))] if told else [])
    assert not any("never changes" in w for w in found)


def lengths(change: dict[str, tuple[float, float]]) -> list[str]:
    """What is suspected of three trials of the independent simulator by length, drive I read as factor * u + offset (m)."""
    day = recorded_day("tendon_elasticity", design="by_length")[0].select(["slow_1", "slow_2", "circle_1"])
    values = [{**t.values, **{n: factor * t.values[n] + offset for n, (factor, offset) in change.items()}} for t in day.trials]
    twin = Twin.of("continuum")
    ready = prepare(day.with_values(values, day.source), twin.robot)
    try:
        predicted = [trace.outputs(twin, ready) for trace in simulate(twin, ready)]
    except SolveError:
        predicted = None
    return [s.words for s in suspicions(ready, twin, (), predicted)]


def test_a_drive_that_turns_the_other_way_and_a_zero_that_is_off_are_named() -> None:
    assert not any("turns the other way" in w or "beyond what the body allows" in w for w in lengths({}))
    assert "one drive turns the other way than the others" in lengths({"tendon_2_displacement": (-1.0, 0.0)})
    off = [w for w in lengths({"tendon_1_displacement": (1.0, 3e-3)}) if "beyond what the body allows" in w]
    assert len(off) == 1
    assert off[0].startswith("tendon_1_displacement is beyond what the body allows, by ")
    assert 0.0 < float(off[0].split("by ")[1].split(" mm")[0]) <= 3.1  # at least, and to 0.4 % of its travel
