"""Zeros that jump: a camera moved in a bench day's own files, a joint's encoder that counts from elsewhere, and what is neither."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tools.simulators.two_link import write_day
from twin.diagnosis import Settings, diagnose
from twin.diagnosis.calibration.calibrate import calibrate
from twin.diagnosis.checks.preview import preview_data
from twin.diagnosis.checks.zero_jumps import Zeros, jumps_of, words
from twin.measurements import Recording, Trial, read
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots.robot import models_folder

FRIDAY = models_folder() / "continuum/samples/friday"
TURN, SHIFT = np.deg2rad([0.4, 0.3, -0.2]), np.array([1.5e-3, -1.0e-3, 0.8e-3])  # rad, m


def changed(recording: Recording, change: Callable[[float, np.ndarray], np.ndarray]) -> Recording:
    """Every marker (m) as `change` makes it of the clock (s) and of what was logged."""

    def of(trial: Trial) -> Trial:
        values = dict(trial.values)
        for name in [n.removesuffix("_x") for n in values if n.endswith("_x")]:
            rows = zip((trial.start or 0.0) + trial.time, zip(*(values[f"{name}_{a}"] for a in "xyz"), strict=True), strict=True)
            moved = np.array([change(t, np.array(x)) for t, x in rows])
            values |= {f"{name}_{a}": moved[:, i] for i, a in enumerate("xyz")}
        return replace(trial, values=values)

    return replace(recording, trials=tuple(of(t) for t in recording.trials))


def calibrated(recording: Recording) -> tuple[list[str], dict[str, float]]:
    """What is said of zeros once the robot is calibrated, and by how much they jumped; no effect is sought."""
    twin = Twin.of("continuum")
    looked = preview_data(prepare(recording, twin.robot), twin, Settings(jobs=1))
    stages: list[str] = []
    study, base, _ = calibrate(looked.prepared, twin, looked.held_out, looked.nominal, Settings(jobs=1), stages.append)
    jumped = [f"zeros that jump, {n}" for n, _ in enumerate(jumps_of(base.fit.model.twin), 1)]
    assert stages[: 2 + len(jumped)] == ["noise", "calibration", *jumped]
    # Derivatives are those at the solution: of them standard errors are made, and effects sought.
    np.testing.assert_array_equal(study.objective.jacobian(base.fit.evaluation, [0])[:, 0], base.fit.J[:, 0])
    return words(study.prepared, base.fit), {n: f.value or 0.0 for n, f in base.fit.fitted(Zeros.id).items()}


@pytest.fixture(scope="module")
def friday() -> Recording:
    return read(FRIDAY)


def test_a_camera_that_moved_within_a_trial_is_found_there_beside_friction_of_three_sigma(friday: Recording) -> None:
    trial = sorted(friday.trials, key=lambda t: t.start or 0.0)[11]
    since = (trial.start or 0.0) + float(trial.time[len(trial.time) // 2])
    turn = Rotation.from_rotvec(TURN).as_matrix()
    said, by = calibrated(changed(friday, lambda t, x: turn @ x + SHIFT if t >= since else x))
    assert len(by) == 6, "one jump"
    np.testing.assert_allclose([by[f"shift_{a}_1"] for a in "xyz"], SHIFT, atol=3e-4)  # m: the friction not yet fitted is 1.7 mm
    assert "the camera, not the robot" in said[0]
    assert f"{(since - min(t.start or 0.0 for t in friday.trials)) / 60:.0f} min" in said[0]


def test_a_camera_that_drifts_and_one_that_only_turns_about_the_base_are_no_jumps(friday: Recording) -> None:
    last, turn = max(t.start or 0.0 for t in friday.trials), Rotation.from_rotvec(10 * TURN).as_matrix()
    assert not calibrated(changed(friday, lambda t, x: x + 4.0 * SHIFT * t / last))[1]
    assert not calibrated(changed(friday, lambda t, x: turn @ x if t > 0.5 * last else x))[1]  # the clamp may have slipped


def test_a_joints_zero_that_jumps_is_named_and_kept_out_of_effects_and_of_the_twin(tmp_path: Path) -> None:
    write_day(tmp_path / "day", None, 41002)
    recording = read(tmp_path / "day")
    since = sorted(t.start or 0.0 for t in recording.trials)[9]
    moved = [
        replace(t, values={**t.values, "joint_1_angle": t.values["joint_1_angle"] + np.deg2rad(2.0) * ((t.start or 0.0) >= since)})
        for t in recording.trials
    ]
    found = diagnose(replace(recording, trials=tuple(moved)), Twin.of("two_link"), Settings(jobs=1))
    assert found.verdict == "noise"
    assert any("the zero jumped: joint_1_angle by 2.0" in n for n in found.notices)
    assert not jumps_of(found.twin)
    assert found.errors.after["angle"] < 1.2 * found.errors.floor["angle"], "sealed trials are predicted with the zero they have"
