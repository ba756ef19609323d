"""Rollouts: the same whatever the number of workers, ended where they are lost, and worth diagnosing again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin import cli
from twin.body import Drive
from twin.effects import effect_class
from twin.foundation.errors import DataError, SolveError
from twin.measurements import Recording, read
from twin.prediction.rollout import can_step_controls, controls_from_set, controls_from_table, draw_controls, full_pull, rollout
from twin.prediction.rollout.controls import Drawing
from twin.prediction.twin import Twin

RUBBING = Twin.of("continuum"), effect_class("tendon_friction")({"mu": 0.25})
SHORT = Drawing(seconds=2.0, rate=25.0)


def rubbing() -> Twin:
    twin, friction = RUBBING
    return replace(twin, effects=(friction,))


def columns(recording: Recording) -> np.ndarray:
    """(n_sample, n_channel) of all trials."""
    return np.vstack([np.column_stack(list(t.values.values())) for t in recording.trials])


@pytest.mark.parametrize("noise", [0.0, 2.5e-4])
def test_ten_seconds_are_the_same_bit_for_bit_from_one_worker_and_from_two(noise: float) -> None:
    controls = draw_controls(rubbing(), 3, seed=4, drawing=Drawing(seconds=10.0))
    one, two = (rollout(rubbing(), controls, noise=noise, seed=4, jobs=jobs).recording for jobs in (1, 2))
    assert columns(one).tobytes() == columns(two).tobytes()
    assert one.data_hash() == two.data_hash()
    assert [len(t.time) for t in one.trials] == [501] * 3
    assert np.isfinite(columns(one)).all()


def test_a_drawn_rollout_depends_on_its_seed_and_number_only() -> None:
    few, many = (draw_controls(Twin.of("continuum"), n, 7, SHORT) for n in (1, 3))
    other = draw_controls(Twin.of("continuum"), 1, 8, SHORT)
    first = few.trials[0].values["tendon_1_tension"]
    assert np.array_equal(first, many.trials[0].values["tendon_1_tension"])
    assert not np.array_equal(first, other.trials[0].values["tendon_1_tension"])


def test_the_full_pull_is_that_of_a_bend_of_one_radian() -> None:
    # Of Peng's rod: EI theta / (L r) with one tendon at r = 8 mm; straight tendons between disks cost the chain some 1 %.
    EI = 77.59e9 * np.pi * (0.4e-3) ** 4 / 4
    pull = full_pull(Twin.of("continuum"))
    assert pull.tension == pytest.approx(EI / (0.12 * 8e-3), rel=0.02)
    assert pull.displacement == pytest.approx(8e-3, rel=0.02)  # r theta
    assert np.allclose(np.rad2deg(np.arctan2(pull.towards[:, 1], pull.towards[:, 0])) % 360.0, [0.0, 120.0, 240.0], atol=0.01)


def test_a_lost_motion_ends_its_rollout_and_no_other() -> None:
    twin = Twin.of("continuum")
    controls = draw_controls(twin, 2, 0, SHORT)
    first, second = controls.trials
    wild = {n: np.where((first.time > 1.0) & n.endswith("_tension"), 1e4, v) for n, v in first.values.items()}
    made = rollout(twin, replace(controls, trials=(replace(first, values=wild), second)))
    cut, whole = made.recording.trials
    (ended,) = made.lost
    assert ended.trial == "rollout_1"
    for word in ("step 10", "joint bend_", "rad/s", "under tensions"):  # a step soon after 1.0 s of 1 ms steps
        assert word in ended.why
    assert 20 < len(cut.time) <= 28  # 25 samples a second up to the jump; some of the way after it
    assert len(whole.time) == 51
    alone = rollout(twin, replace(controls, trials=(second,))).recording.trials[0]
    assert np.array_equal(alone.values["disk_8_x"], whole.values["disk_8_x"])
    kept = rollout(twin, controls).recording.trials[0]
    before = cut.time <= 1.0 - 1.0 / 25.0
    assert np.array_equal(cut.values["disk_8_x"][before], kept.values["disk_8_x"][: int(before.sum())])


def test_nothing_is_returned_where_no_rollout_got_anywhere() -> None:
    twin = Twin.of("continuum")
    (trial,) = draw_controls(twin, 1, 0, SHORT).trials
    wild = {n: np.where((trial.time > 0.0) & (n == "tendon_1_tension"), 1e6, 0.0) for n in trial.values}
    with pytest.raises(SolveError, match="all rollouts are lost"):
        rollout(twin, replace(draw_controls(twin, 1, 0, SHORT), trials=(replace(trial, values=wild),)))


@pytest.mark.parametrize(
    ("robot", "drive", "steps"),
    [
        ("continuum", Drive.TENSION, True),
        ("continuum", Drive.DISPLACEMENT, True),
        ("finger", Drive.DISPLACEMENT, True),
        ("two_link", Drive.TENSION, False),
    ],
)
def test_who_is_stepped_and_who_is_not(robot: str, drive: Drive, steps: bool) -> None:
    twin = Twin.of(robot)
    controls = draw_controls(twin, 1, 3, Drawing(seconds=0.6, rate=10.0, drive=drive))
    assert can_step_controls(twin, controls) is steps
    made = rollout(twin, controls)
    assert ("MuJoCo steps" in made.recording.source) is steps
    assert not made.lost
    assert np.isfinite(columns(made.recording)).all()
    if not steps:
        with pytest.raises(DataError, match="no dynamics"):
            rollout(twin, controls, dynamic=True)


def test_a_set_drives_its_rollouts_under_its_conditions() -> None:
    sample = read(Path(cli.__file__).parents[2] / "models/continuum/samples/friday")
    sample = replace(sample, trials=sample.select(["circle_payload20"]).trials)
    twin = Twin.of("continuum")
    made = rollout(twin, controls_from_set(twin, sample), dynamic=False).recording
    own = twin.predict(sample, dynamic=False).trials[0]
    assert made.trials[0].conditions["tip_payload"] == pytest.approx(0.02)
    assert np.array_equal(made.trials[0].values["disk_8_z"], own.values["disk_8_z"])


def test_a_table_drives_a_rollout_and_is_refused_with_a_gap(tmp_path: Path) -> None:
    table = tmp_path / "ramp.csv"
    table.write_text("time,tendon_1_tension,tendon_2_tension,tendon_3_tension\n0,0,0,0\n0.5,1,0,0\n1,1,0,0\n")
    made = rollout(Twin.of("continuum"), controls_from_table(Twin.of("continuum"), table)).recording
    assert made.trials[0].values["disk_8_x"][-1] > 0.02  # m: towards tendon 1
    table.write_text(table.read_text().replace("0.5,1", "0.5,"))
    with pytest.raises(DataError, match="row 3, column tendon_1_tension"):
        controls_from_table(Twin.of("continuum"), table)


def test_currents_drive_a_rollout(tmp_path: Path) -> None:
    table = tmp_path / "heat.csv"
    rows = [f"{t},{2.0 if t < 8 else 0.0},0,0" for t in range(11)]
    table.write_text("\n".join(["time,sma_1_current,sma_2_current,sma_3_current", *rows, ""]))
    made = rollout(Twin.of("continuum"), controls_from_table(Twin.of("continuum"), table)).recording
    assert "MuJoCo steps" in made.source
    assert made.trials[0].values["sma_1_temperature"].max() > 340.0  # K, from 296
    assert made.trials[0].values["disk_8_x"].max() > 5e-3  # m: towards the spring that pulls


def test_the_command_writes_a_set_that_reads_again(tmp_path: Path) -> None:
    made = tmp_path / "set"
    cli.Rollout("continuum", made, random=2, seconds=0.5, noise=1e-4, jobs=1).run()
    recording = read(made)
    assert recording.robot == "continuum"
    assert recording.source.startswith("simulation: twin of continuum, MuJoCo steps")
    assert {c.name for c in recording.outputs()} >= {"disk_8_z", "tendon_1_displacement"}
    with pytest.raises(DataError, match="below zero"):
        cli.Rollout("continuum", tmp_path / "other", random=1, seconds=0.5, noise=-1.0).run()
    assert not (tmp_path / "other").exists()
    with pytest.raises(DataError, match="either --controls FILE or --random N"):
        cli.Rollout("continuum", tmp_path / "other").run()
