"""Importers of public data, where the data are there, and the learned remainder."""

from __future__ import annotations

import csv
import os
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tools.benchmarks.hardware.comparisons import cable_runs
from tools.benchmarks.hardware.comparisons import cable_tool as comparison
from tools.benchmarks.hardware.comparisons import three_cable as sweeps
from tools.benchmarks.hardware.importers import cable_tool, tentacle, three_cable
from tools.benchmarks.hardware.residual_gp import Remainder
from twin.diagnosis import Diagnosis, diagnose
from twin.measurements import Trial, read, write
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

RAW = Path(os.environ.get("TWIN_MEASURED", Path(__file__).resolve().parents[3] / "measured"))


@pytest.fixture(scope="module")
def raw() -> Path:
    if not RAW.is_dir():
        warnings.warn(
            f"NOT TESTED: the public rigs' raw data are not in {RAW} (python -m tools.benchmarks.hardware.fetch)",
            stacklevel=1,
        )
        pytest.skip(f"raw data not in {RAW}")
    return RAW


def test_holds_of_the_tentacle_are_where_the_derived_table_has_them(raw: Path, tmp_path: Path) -> None:
    """The table was made from the raw files by another hand; frames, marker order and units must agree."""
    recording, dropped = tentacle.read(raw / "tentacle")
    with (raw / "tentacle/static_points_derived.csv").open(encoding="utf-8") as file:
        table = {row["file"]: row for row in csv.DictReader(file)}
    assert len(recording.trials) == 22
    for trial in recording.trials:
        row = table[trial.name]
        anew = 4 if float(row["dt_s"]) < 0.0045 else 0  # the second session, 240 Hz, has markers of its own
        for m in range(1, 5):
            assert np.isnan(trial.values[f"marker_{m + 4 - anew}_x"]).all()
            seen = [trial.values[f"marker_{m + anew}_{a}"].mean() for a in "xyz"]
            robot = [float(row[f"p{m}_{a}_m"]) for a in "xyz"]
            # m: an eighth of one hold's samples are spikes of half a millimetre and left out here, not in the table
            np.testing.assert_allclose(seen, [robot[0], -robot[1], -robot[2]], rtol=0, atol=1e-4)
        assert trial.values["tendon_1_tension"][0] == pytest.approx(float(row["tension1_N"]), rel=1e-5)  # written with 6 digits
    assert sum(n for _, _, n, _ in dropped.rows) > 0
    assert "dropped in all" in str(dropped)
    write(recording, tmp_path / "set")
    prepare(read(tmp_path / "set"), load("tentacle"))


def test_sweeps_of_the_three_cable_robot_rise_with_one_cable_and_stay_in_their_block(raw: Path) -> None:
    recording, dropped = three_cable.read(raw / "three-cable")
    kept = sum(len(t.time) for t in recording.trials)
    assert kept + sum(n for _, _, n, _ in dropped.rows) == sum(of for _, _, _, of in dropped.rows), "every sample is accounted for"
    assert {t.name[:6] for t in recording.trials} == {"block1", "block2"}
    for trial in recording.trials:
        pulls = np.stack([trial.values[f"tendon_{i}_displacement"] for i in (1, 2, 3)])
        moving = np.ptp(pulls, axis=1) > 0
        assert moving.sum() == 1
        assert (np.diff(pulls[moving][0]) > 0).all()
        assert 0.0 <= pulls.min() <= pulls.max() <= 0.0101  # m: 10 mm of cable
        assert (pulls[0] == 0).all() == trial.name.startswith("block1")
    prepare(recording, load("three_cable"))


def test_a_camera_that_moved_is_registered_by_four_sweeps_and_judged_by_the_others() -> None:
    """Turned and shifted tips leave nothing; one sweep 3 mm off leaves that over the root of the sweeps judged; where it is one
    of the four it shifts the camera by a quarter of that on all others, and turns it a little."""
    rng = np.random.default_rng(11)
    tips = [rng.normal(size=(30, 3)) for _ in range(7)]
    turn = Rotation.from_rotvec([0.4, -1.0, 2.0])
    seen = [turn.apply(t) + np.array([0.1, 0.2, -0.3]) for t in tips]
    assert sweeps._off(tips, seen, (0, 2, 3, 6)) == pytest.approx(0.0, abs=1e-9)
    seen[5] = seen[5] + np.array([0.0, 0.0, 3e-3])
    assert sweeps._off(tips, seen, (0, 2, 3, 6)) == pytest.approx(3.0 / np.sqrt(3.0))
    assert sweeps._off(tips, seen, (0, 2, 3, 5)) == pytest.approx(3.0 / 4.0, rel=0.1)
    every = sweeps.ways(7)
    assert every[0] == (0, 1, 2, 3)
    assert len(set(every)) == len(every) == 35
    drawn = sweeps.ways(20)
    assert (drawn[0], len(drawn), drawn) == ((0, 1, 2, 3), sweeps.MOST_CHOICES + 1, sweeps.ways(20))
    assert all(len(set(way)) == sweeps.REGISTERED for way in drawn)


def test_a_sweep_ends_before_the_camera_flickers() -> None:
    tip = np.linspace(0.0, 0.08, 60)[:, None] * np.ones(3) / np.sqrt(3.0)  # m, 1.4 mm a row
    assert three_cable._steady(tip) == 60
    late = tip.copy()
    late[1:] -= 2e-3  # the first step goes back, as the last release dies away
    assert three_cable._steady(late) == 60
    for row in (30, 59):
        other = tip.copy()
        other[row:] += 1e-3 * np.array([1.5, -2.1, 0.6])
        assert three_cable._steady(other) == row


@pytest.fixture(scope="module")
def half_a_block(raw: Path) -> Diagnosis:
    """The three-cable robot diagnosed on half of its first block."""
    recording, _ = three_cable.read(raw / "three-cable")
    fitted, _, _ = sweeps.halves(recording, 1)
    return diagnose(recording.select(fitted), Twin.of(load("three_cable")), sweeps.SETTINGS)


def test_the_three_cable_robots_drives_are_named_and_the_block_they_were_not_found_in_is_predicted(
    raw: Path, half_a_block: Diagnosis
) -> None:
    """The bar of the project: at most 70 % of the calibrated error on sweeps that the diagnosis has not been given."""
    recording, _ = three_cable.read(raw / "three-cable")
    bench, found = prepare(recording, load("three_cable")), half_a_block
    assert found.verdict == "partly_explained"
    assert found.claims[0].effect == "transmission_error"
    for rows in sweeps.halves(recording, 1)[1:]:
        assert sweeps.tip_error(found.twin, bench, rows) < 0.7 * sweeps.tip_error(found.calibrated, bench, rows)


@pytest.mark.xfail(
    strict=False,
    reason="missed: beside the ropes it takes 2 % of the squared error left out, a quarter is asked for",
)
def test_the_three_cable_robots_dead_band_is_named(half_a_block: Diagnosis) -> None:
    claims = {c.effect: c.parameters for c in half_a_block.claims}
    # m of cable: half the gap is what the raw sweeps wait for, 0.08 to 0.1 mm; a factor of two, for the drives' law shares in it
    assert 0.05e-3 < 0.5 * (claims["tendon_backlash"]["gap"].value or 0.0) < 0.2e-3


def test_runs_of_the_cable_tool_have_the_measured_loads_and_loops(raw: Path) -> None:
    """Loads and loop widths are those that the data's README gives, found there by another program."""
    recording, dropped = cable_tool.read(raw / "cable-tool")
    assert len(recording.trials) == 20
    load = {10: 0.010, 20: 0.022, 30: 0.034, 40: 0.046}  # N m
    loop = {10: (5.9, 6.2), 20: (3.9, 4.2), 30: (3.0, 3.3), 40: (3.1, 3.4)}  # deg, over all rates
    for trial in recording.trials:
        percent = int(trial.name[4:6])
        assert trial.values["joint_2_torque"].mean() == pytest.approx(load[percent], abs=1.5e-3)  # given to a thousandth
        low, high = loop[percent]
        # deg: its middle is ours, a fifth of the stroke; theirs is not said
        assert low - 0.8 < comparison.width(trial) < high + 0.8
    assert all(n > 0 for _, reason, n, _ in dropped.rows if reason == "start-up transient")


def test_the_diagnosed_cable_tool_meets_its_bars(raw: Path) -> None:
    """Fitted at two loads and two rates: friction and cables that bed in named, and the other loads and rates predicted."""
    rows, recording, found = comparison.compare(raw / "cable-tool")
    assert len(recording.trials) == 4
    claimed = {c.effect for c in found.claims}
    assert "tendon_elasticity" in claimed
    assert claimed & comparison.FRICTION_EFFECTS
    assert all(row.met is not False for row in rows if "time" not in row.what)


def test_any_runs_of_the_cable_tool_are_told_by_what_was_measured_and_loads_not_fitted_are_predicted(raw: Path) -> None:
    """Names and headers aside, runs of development go by the loads that its importer has from their names; and the bar on a tool
    fitted at two loads holds for all but the pair that never comes near no load."""
    every = {r.title.split()[1]: r for r in cable_tool.read_all(raw / "cable-tool")}
    assert {t.name for t in every[cable_tool.TOOL].trials} == {t.name for t in cable_tool.read(raw / "cable-tool")[0].trials}
    for tool in cable_tool.MIRRORED_TOOLS:
        assert [t.name for t in every[tool].trials] == ["load20_0.3Hz.csv", "load80_0.3Hz.csv"]
    steady = tuple(t for t in every[cable_tool.TOOL].trials if "0.3Hz" in t.name)
    for chosen in ({20, 40}, {10, 40}):
        _, other, _, loop = cable_runs.judged(replace(every[cable_tool.TOOL], trials=steady), chosen)
        assert other.aimed
        assert loop.met
        assert "not told" not in loop.measured
    *_, loop = cable_runs.judged(every[cable_tool.TOOL], {30, 40})
    assert "not told, 20 %" in loop.measured, "of what is soft near no load loops from 30 % on say little"
    assert loop.met is None, "what is not told is not met"


def test_a_loop_is_as_wide_as_it_was_made() -> None:
    q = np.sin(np.linspace(0, 20, 501))
    for half in (0.0, 0.05):
        jaw = 0.9 * q + half * np.sign(np.gradient(q))
        run = Trial("made", np.linspace(0, 20, 501), {"joint_1_angle": q, "joint_2_angle": jaw})
        # deg: the line taken off is tilted a little where the two ways have not quite the same samples
        assert comparison.width(run) == pytest.approx(np.rad2deg(2 * half), rel=0.02, abs=1e-9)


def test_the_remainder_learns_what_is_smooth_and_leaves_noise_alone() -> None:
    rng = np.random.default_rng(1)
    pull = rng.uniform(0, 8, (40, 2))
    smooth = np.stack([np.sin(pull[:, 0] / 3), pull[:, 0] * pull[:, 1] / 40], axis=1)
    learned = Remainder.fit(pull[:30], smooth[:30], np.ones(2))
    left = smooth[30:] - learned.predict(pull[30:])
    # the smallest noise share, a tenth, shrinks what is learned by as much, and by more at the rim: a quarter is left
    assert np.sqrt((left**2).mean()) < 0.25 * smooth.std()
    noise = rng.normal(size=(40, 2))
    guessed = Remainder.fit(pull[:30], noise[:30], np.ones(2)).predict(pull[30:])
    assert np.sqrt((guessed**2).mean()) < 0.5  # sigma: nothing to learn, little is claimed
    far = learned.predict(np.array([[500.0, 500.0]]))
    np.testing.assert_allclose(far, 0.0, atol=1e-12)  # far from all data the twin stands alone


def test_a_channels_unit_does_not_decide_what_the_remainder_learns() -> None:
    """The same two channels, the second in thousandths: the same numbers, and its own a thousandfold."""
    rng = np.random.default_rng(2)
    pull = rng.uniform(0, 8, (30, 2))
    residual = np.stack([np.sin(pull[:, 0]), 0.3 * rng.normal(size=30)], axis=1)
    noise, thousand = np.array([0.1, 0.3]), np.array([1.0, 1000.0])
    one = Remainder.fit(pull, residual, noise)
    other = Remainder.fit(pull, residual * thousand, noise * thousand)
    assert (other.length, other.error) == pytest.approx((one.length, one.error))
    np.testing.assert_allclose(other.predict(pull), one.predict(pull) * thousand, rtol=1e-9)
