"""Input tensions below zero, where recording and robot meet: an offset, a push that is refused, and rods that may push."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.other_continua import robot
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.robots import Robot, load

ROBOT, OTHER = load("continuum"), load("two_link")


def recording(first: list[float], name: str = "a.csv", folder: Path | None = None, of: Robot = ROBOT) -> Recording:
    """Tendon 1 reads `first` gf, whose noise is 2 gf; the others rest."""
    output = sorted(c for c, s in of.build().senses.items() if s.group == "marker")[0]
    inputs = (Channel(f"tendon_{i}_tension", "input", "gf", 0.002 * 9.80665) for i in range(1, of.n_tendon + 1))
    channels = (*inputs, Channel(output, "output", "mm"))
    values = {c.name: np.zeros(len(first)) for c in channels}
    values["tendon_1_tension"] = channels[0].scale.to_si(np.array(first))
    return Recording(
        of.name, "made", "simulation", None, channels, (Trial(name, np.arange(float(len(first))), values, start=0.0),), folder
    )


def notices(*first: float) -> tuple[str, ...]:
    return prepare(recording(list(first)), ROBOT).notices


def test_an_offset_of_the_cell_passes_with_a_notice_and_a_push_does_not() -> None:
    assert notices(-9.0, 100.0, 100.0) == ()  # noise 2 gf: 5 sigma are 10 gf, nothing to say
    (notice,) = notices(-30.0, 100.0, 100.0)  # 0.294 N: an offset of the cell's zero, up to 0.3 N
    assert "tendon_1_tension falls to -0.294 N" in notice
    with pytest.raises(DataError, match=r"a\.csv, row 2, column tendon_1_tension: -31\.0 gf, a tendon cannot push"):
        notices(-31.0, 100.0, 100.0)  # 0.304 N


def test_a_strong_robots_cell_may_be_off_by_a_twentieth_of_its_largest_reading() -> None:
    assert len(notices(-299.0, 6000.0, 0.0)) == 1  # 59 N, so that its zero may be off by 300 gf
    with pytest.raises(DataError, match="row 3"):
        notices(6000.0, -301.0, np.nan)


def test_the_refusal_names_file_row_and_the_key_for_rods_where_the_robot_could_have_it(tmp_path: Path) -> None:
    """Rows of Parquet count from 1. A robot of a family without rods is told to correct the sign only."""
    with pytest.raises(DataError) as refused:
        prepare(recording([0.0, -100.0, 0.0], "a.parquet", tmp_path), ROBOT)
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'a.parquet'}, row 2, column tendon_1_tension: -100.0 gf")
    assert "correct the sign" in said
    assert "`missing`" in said
    assert f"rods = true in [structure] of {ROBOT.folder / 'robot.toml'}" in said
    with pytest.raises(DataError, match=r"correct the sign, or declare it `missing`$"):
        prepare(recording([0.0, -100.0, 0.0], of=OTHER), OTHER)


def test_rods_may_push_and_nothing_is_said(tmp_path: Path) -> None:
    rods = robot(tmp_path, {"rods": True})
    pushed = prepare(recording([0.0, -100.0, 100.0]), rods)
    assert pushed.notices == ()
    assert pushed.pushes
    assert not pushed.silenced_below_zero.any()
    assert prepare(recording([0.0, 0.0, 0.0]), ROBOT).silenced_below_zero.all()


def test_springs_are_refused_beside_rods(tmp_path: Path) -> None:
    """The nominal robot's springs, as its file has them."""
    own = (ROBOT.folder / "robot.toml").read_text("utf-8")
    (tmp_path / "robot.toml").write_text(own.replace("[structure]", "[structure]\nrods = true", 1), "utf-8")
    with pytest.raises(DataError, match="rods is true and there are SMA springs"):
        load(str(tmp_path))
