"""The motors of the independent rod: their closed form on a straight robot, and the days that they log."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from tools.simulators.motor_rod.day import MotorRecipe, make_motor_day, possible_effects, truth_of
from tools.simulators.motor_rod.drives import ALONE, PAIRS, PRETENSION, SPOOL, SPRING, DriveTrain, Winding
from tools.simulators.motor_rod.motions import motor_day
from tools.simulators.rod.mechanics.rod import Rod, follow
from twin.measurements import read
from twin.robots import load


@pytest.mark.parametrize("winding", [PAIRS, ALONE])
def test_at_their_zeros_the_springs_hold_their_pretension(winding: Winding) -> None:
    """On the straight rod, which does not stretch, a spring drawn out by c T0 pulls with T0; a zero off by a0 draws w r a0 less."""
    n = len(winding.motor)
    train = DriveTrain(1.0, winding, (1.0,) * winding.motors, (0.0,) * winding.motors, SPRING, (PRETENSION,) * n)
    angles = 2.0 * np.pi * np.arange(n) / n
    rod = Rod(hole_radius=np.full((9, n), 8e-3), hole_angle=np.tile(angles, (9, 1)))
    held = follow(rod, -train.pull(np.zeros((1, n))), gravity=(0.0, 0.0, 0.0), driven_by_length=True, stretch=SPRING)
    np.testing.assert_allclose(held.tension[0, 0], PRETENSION, rtol=1e-6)
    off = DriveTrain(1.0, winding, (1.02,) * winding.motors, (0.1,) * winding.motors, SPRING, (PRETENSION,) * n)
    drawn = off.pull(np.full((1, n), 1e-3))[0] - SPRING * PRETENSION
    np.testing.assert_allclose(drawn, 1.02 * (1e-3 - np.array(winding.way) * SPOOL * 0.1), rtol=1e-12)


def test_planned_antagonists_move_against_each_other() -> None:
    angles = 0.5 * np.pi * np.arange(4)
    for trial in motor_day(angles, np.random.default_rng(0)).trials:
        np.testing.assert_allclose(trial.command[:, 2:], -trial.command[:, :2], atol=1e-15)


def test_no_effect_is_one_that_angles_cannot_have() -> None:
    found = set(possible_effects())
    assert {"tendon_friction", "time_delay", "base_tilt", "magnet"} <= found
    assert not found & {"load_cell_bias", "sma_cooling", "drive_zero", "tendon_elasticity", "drive_train"}


def test_a_day_is_a_set_with_its_robot_and_the_same_again(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make_motor_day(tmp_path / name, MotorRecipe(seed=3, torque=True))
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)
    day = read(tmp_path / "a")
    assert [c.name for c in day.inputs()] == ["motor_1_angle", "motor_2_angle"]
    assert load(day.robot, day.folder).structure["motors"] == [[1, -3], [2, -4]]
    with (tmp_path / "a" / "circle_1.csv").open() as file:
        rows = np.array([[float(r[f"motor_{m}_angle"]) for m in (1, 2)] for r in csv.DictReader(file)])
    turning = np.hypot(*np.radians(rows[len(rows) // 3 :]).T) * SPOOL / 8e-3
    assert turning == pytest.approx(0.8 * 1.2, abs=0.02)  # rad of bend all around the circle
    assert truth_of(tmp_path / "a") == []
