"""The endurance run: some seconds of it, what stops it, and that what breaks is seen."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tools.benchmarks.control.endurance import rig as rig_module
from tools.benchmarks.control.endurance.__main__ import endure, main, minute
from tools.benchmarks.control.endurance.course import EVERY, PUSHED, TEN_HOURS
from tools.benchmarks.control.endurance.log import MINUTES, STATE, begun, grown, save
from tools.benchmarks.control.endurance.rig import Rig
from tools.benchmarks.table import read_rows
from twin.control import TensionLimits
from twin.foundation.errors import DataError
from twin.tasks import CONTROL_STEP

SECONDS = 1.0 / 3600.0


@pytest.fixture(scope="module")
def started() -> Rig:
    """After a second, in which nothing broke."""
    rig = Rig(1)
    looks, ended = minute(rig, 50)
    assert not ended
    assert not any(rig.faults.values())
    assert max(look.error for look in looks) < 2e-3  # m: the shape moves by 10 mm in that second
    return rig


@pytest.fixture
def rig(started: Rig) -> Rig:
    return Rig.of(started.state())


def test_it_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    """One second and one more are two: the plant to the last bit, the twins to what Newton leaves (10 um)."""
    ends = {}
    for name, stops in (("parts", (1.0, 2.0)), ("whole", (2.0,))):
        for seconds in stops:
            assert not endure(tmp_path / name, seconds * SECONDS, 1, lambda words: None)
        ends[name] = begun(tmp_path / name, 1)[0]
        assert ends[name].steps == round(2.0 / CONTROL_STEP)
    lines = read_rows(tmp_path / "parts" / MINUTES)
    assert [round(m["hours"] / SECONDS) for m in lines] == [1, 2]
    assert lines[1]["wall"] > lines[0]["wall"]
    np.testing.assert_allclose(ends["parts"].plant.shortening, ends["whole"].plant.shortening, atol=1e-5)
    assert ends["parts"].plant.arrays["qpos"] == pytest.approx(ends["whole"].plant.arrays["qpos"], abs=2e-5)
    with pytest.raises(DataError, match="holds a run of seed 1"):
        begun(tmp_path / "parts", 2)


def test_its_state_is_the_plant_s_to_the_last_bit(started: Rig, tmp_path: Path) -> None:
    save(tmp_path, started)
    (tmp_path / MINUTES).write_text(json.dumps({"hours": 1.0}) + "\n" + '{"hours": 0.0', "utf-8")
    again, minutes = begun(tmp_path, 1)
    assert minutes == []  # one is later than the state, the other was cut off
    assert again.steps == started.steps
    assert {"qpos", "qvel", "slip", "beyond", "tension", "shortening"} == set(started.plant.arrays)
    for name, array in started.plant.arrays.items():
        np.testing.assert_array_equal(again.plant.arrays[name], array)
    assert not (tmp_path / (STATE + ".part")).exists()


def test_a_node_that_is_not_finite_ends_it(rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig.plant.moving.data.qvel[7] = np.nan
    save(tmp_path, rig)
    (tmp_path / MINUTES).write_text("", "utf-8")
    with pytest.raises(SystemExit, match="ended: the finger is lost"):
        main(tmp_path, 1.0)
    assert "| not finite, motion lost | 0, 1 |" in capsys.readouterr().out


def test_a_reading_that_is_not_finite_ends_it(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rig.course, "read", lambda true, time: np.full(4, np.nan))
    assert "is not finite at t = 1.02 s" in minute(rig, 50)[1]
    assert rig.faults["nan"] == 1


def test_a_limit_that_is_broken_is_counted(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tendon that jumps by 1 mm where 0.6 are allowed, then all pulls above a limit that is lowered behind the controller."""
    law, jump = rig.law.step, np.array([1e-3, 0.0, 0.0, 0.0])
    monkeypatch.setattr(rig.law, "step", lambda *asked: SimpleNamespace(shortening=rig.plant.shortening + jump))
    rig.step()
    assert (rig.faults["rate"], rig.faults["most"]) == (1, 0)
    monkeypatch.setattr(rig.law, "step", law)
    monkeypatch.setattr(rig_module, "GRIP_LIMITS", TensionLimits(most=0.01))
    monkeypatch.setattr(rig.plant, "shortening", rig.law.finger.shortening.copy())
    minute(rig, 3)
    assert (rig.faults["rate"], rig.faults["most"]) == (1, 3)


def test_what_is_wanted_pushed_and_read_is_by_the_time_alone() -> None:
    """Two courses at the same times; a push now and then; cords that drift by their share of a hundredth in ten hours."""
    one, other = Rig(1).course, Rig(1).course
    for time in (0.0, 61.0):
        np.testing.assert_allclose(one.wanted(time), other.wanted(time), atol=1e-9)
    pushed = [t for t in np.arange(0.0, 10 * EVERY, 0.5) if one.push(t) is not None]
    assert 0.1 * PUSHED / EVERY < len(pushed) / (20 * EVERY) < 2.0 * PUSHED / EVERY
    np.testing.assert_array_equal(one.push(pushed[0]), other.push(pushed[0]))
    true, late = np.full(4, 1000.0), np.mean([one.read(np.full(4, 1000.0), TEN_HOURS) for _ in range(200)], axis=0)
    assert 1.0 < np.abs(late - true).max() < 10.5


def test_growth_of_memory_is_seen() -> None:
    """2 MB an hour of the longer of two processes, whatever its first tenth did."""
    minutes: list[dict[str, Any]] = [{"hours": k / 60.0, "rss": 300.0, "process": 1} for k in range(20)]
    minutes += [{"hours": k / 60.0, "rss": 400.0 + k / 30.0 + 50.0 * (k < 25), "process": 2} for k in range(20, 120)]
    assert grown(minutes).startswith("+2.00 over 1.48 h of one process")
