"""Mistakes of meaning planted in a good day are refused or said before any fit; good days raise no suspicion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tools.bench.two_link import write_day
from tools.mistakes import MISTAKES, answer, planted
from twin.bench import prepare
from twin.diagnose import Settings
from twin.diagnose.look import looked_at
from twin.diagnose.suspicions.case import Case
from twin.diagnose.suspicions.clouds import _nearest
from twin.diagnose.suspicions.trials import times
from twin.measurements import Clouds, Trial, read
from twin.measurements.write import write
from twin.robots import load
from twin.robots.robot import models_folder
from twin.twin import Twin

FRIDAY = models_folder() / "continuum/samples/friday"
# What the sample has no column of: python -m tools.mistakes on a set that logs it.
FINGERS = [m for m in MISTAKES if "sensor" in m or "cloud" in m or "resistance" in m]
ELSEWHERE = [m for m in MISTAKES if m.startswith(("displacement", "room", "markers turned by 16")) or m in FINGERS]
SAID = {
    "positions in m under mm": "length unit", "positions in mm under m": "length unit", "time in ms": "time unit",
    "payload in mg for g": "payload unit", "gravity of the wrong sign": "gravity direction", "gravity in g": "gravity size",
    "mirrored marker frame": "mirrored frame", "marker frame turned by 90 degrees": "turned frame",
    "tendons 1 and 2 exchanged": "tendon order", "disks 6 and 7 exchanged": "marker order", "a trial twice": "duplicate trial",
    "a trial of another robot": "trial of another robot", "a marker that is not tracked": "dead channel",
    "origin of the markers shifted": "shifted frame", "start in minutes": "overlapping trials", "a start missing": "missing start",
    "marker noise in m under mm": "declared noise", "marker noise in um under mm": "declared noise",
}  # fmt: skip
AXES = {  # by geometry: QUARTER takes x to y, the roll x to y, y to z and z to x
    "mirrored marker frame": "x of the file is -x, y of the file is y, z of the file is z",
    "marker frame turned by 90 degrees": "x of the file is -y, y of the file is x, z of the file is z",
    "marker axes permuted": "x of the file is z, y of the file is x, z of the file is y",
}


def test_the_sample_raises_no_suspicion() -> None:
    assert answer(FRIDAY) == ("missed", [])


@pytest.mark.parametrize("mistake", [m for m in MISTAKES if m not in ELSEWHERE])
def test_a_mistake_is_refused_or_said(mistake: str, tmp_path: Path) -> None:
    found, words = answer(planted(FRIDAY, tmp_path / "set", mistake))
    assert found in ("refused", "said")
    if mistake in SAID:
        assert any(w.startswith(f"{SAID[mistake]}: ") for w in words)
    if mistake in AXES:
        assert any(AXES[mistake] in w for w in words)


@pytest.fixture(scope="module")
def finger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five short trials of the finger bench, with clouds of points about the markers that were seen."""
    whole, folder, noise = (
        read(models_folder() / "finger/samples/drift"),
        tmp_path_factory.mktemp("finger") / "set",
        np.random.default_rng(3),
    )

    def short(trial: Trial) -> Trial:
        every = slice(None, None, 8)
        time, values = trial.time[every], {n: v[every] for n, v in trial.values.items()}
        points = np.stack([np.stack([values[f"marker_{m}_{a}"] for a in "xyz"], axis=1) for m in range(1, 11)], axis=1)
        seen = [p[np.isfinite(p).all(axis=1)] for p in points]
        clouds = [(p[:, None] + 1e-3 * noise.standard_normal((len(p), 40, 3))).reshape(-1, 3) for p in seen]
        offsets = np.cumsum([0, *(len(c) for c in clouds)])
        return replace(trial, time=time, values=values, clouds=Clouds(np.concatenate(clouds), offsets, time))

    write(replace(whole, trials=tuple(short(t) for t in whole.trials if t.label.startswith(("sweep", "circle")))), folder)
    return folder


def test_a_good_finger_raises_no_suspicion(finger: Path) -> None:
    assert answer(finger) == ("missed", [])


@pytest.mark.parametrize("mistake", FINGERS)
def test_a_mistake_on_a_finger_is_refused_or_said(mistake: str, finger: Path, tmp_path: Path) -> None:
    found, words = answer(planted(finger, tmp_path / "set", mistake))
    assert found in ("refused", "said")
    kind = "point clouds" if "cloud" in mistake else "channel order" if "exchanged" in mistake else ""
    assert any(w.startswith(kind) for w in words)


def test_an_encoder_that_counts_the_other_way_is_said(tmp_path: Path) -> None:
    """A joint's angle negated: that joint and no other. Both as they are raise nothing (test_suspicions_silent.py)."""
    write_day(tmp_path / "day", None, 41002)
    day, twin = read(tmp_path / "day"), Twin.of("two_link")
    turned = tuple(replace(t, values={**t.values, "joint_2_angle": -t.values["joint_2_angle"]}) for t in day.trials)
    found = looked_at(prepare(replace(day, trials=turned), twin.robot), twin, Settings(jobs=1)).suspicions
    assert [s.kind for s in found if "joint_2_angle: falls where" in s.words] == ["sign"]
    assert not any("joint_1_angle" in s.words for s in found)


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


@pytest.mark.parametrize("by", [1, 2])
def test_tendons_counted_from_another_one_are_a_mistake_in_their_order(by: int) -> None:
    """All three columns each under the name of the next, or of the one before."""
    day, names = read(FRIDAY), [f"tendon_{i}_tension" for i in (1, 2, 3)]
    trials = []
    for t in day.trials:
        trials.append(replace(t, values={**t.values, **{names[(i + by) % 3]: t.values[names[i]] for i in range(3)}}))
    found = looked_at(
        prepare(replace(day, trials=tuple(trials)), load("continuum")), Twin.of("continuum"), Settings(jobs=1)
    ).suspicions
    (said,) = (s for s in found if s.kind == "tendon order")
    for i in range(3):
        assert f"{names[(i + by) % 3]} as {names[i]}" in said.change


@pytest.mark.parametrize(("pause", "mistake"), [(1.2e5, True), (1.2e4, False)])
def test_a_clock_in_ms_is_a_mistake_where_the_trials_clock_is_in_ms_too(pause: float, mistake: bool) -> None:
    """Ten trials of three hours each with a reading every ten minutes: begun every 33 hours, the session lasts twelve days and
    must be one of 20 minutes in ms; begun every 3.3 hours it may be one of slow creep, over within a day and a half."""
    time = np.arange(0.0, 10801.0, 600.0)
    trials = [SimpleNamespace(name=f"{k}", start=k * pause, time=time) for k in range(10)]
    bench: Any = SimpleNamespace(inputs=trials, recording=SimpleNamespace(trials=trials))
    said = [s.kind for s in times(SimpleNamespace(bench=bench))]  # type: ignore[arg-type]
    assert said == ["time unit"] * mistake


def test_of_two_mistakes_the_one_that_leaves_the_smaller_share_of_the_error_is_said() -> None:
    """An error of 4 mm that a change brings to 0.2 mm is left to a twentieth, however far the robot moves; one that leaves a half
    is none, nor one that leaves as much as the motion."""
    case: Any = SimpleNamespace(motion=lambda columns: 0.05)
    assert Case.better(case, 4e-3, 2e-4, [0]) == pytest.approx(0.05)
    assert Case.better(case, 0.4, 2e-3, [0]) == pytest.approx(0.005)
    assert Case.better(case, 4e-3, 2e-3, [0]) is None
    assert Case.better(case, 4.0, 0.05, [0]) is None
