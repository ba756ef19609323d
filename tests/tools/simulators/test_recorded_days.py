"""The recorded days are what the independent simulator makes today."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from tests import recorded_days
from tests.recorded_days import DAYS, FOLDER, TRUTH, Day, recorded_day
from tools.simulators import rod


def chosen() -> Day:
    """One day, another whenever the simulator changes."""
    sources = sorted(Path(rod.__path__[0]).rglob("*.py"))
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in sources))
    return DAYS[int(digest.hexdigest(), 16) % len(DAYS)]


def test_a_day_made_again_is_the_recorded_one(tmp_path: Path) -> None:
    """Value for value, to one last digit in a thousandth of them: processors round differently."""
    day, new, old = chosen(), tmp_path / "new", tmp_path / "old"
    day.simulate(new)
    day.unpack(old)
    assert sorted(f.name for f in new.iterdir()) == sorted(f.name for f in old.iterdir())
    for file in old.iterdir():
        was, now = file.read_text(), (new / file.name).read_text()
        if file.name == TRUTH:
            assert recorded_days.same_truth(json.loads(was), json.loads(now))
            continue
        if file.suffix != ".csv":
            assert now == was
            continue
        (header, *rows), (same, *again) = ([line.split(",") for line in text.splitlines()] for text in (was, now))
        assert same == header
        digit = np.array([10.0 ** -max(len(cell.partition(".")[2]) for cell in column) for column in zip(*rows, strict=True)])
        before, after = (np.array([[float(cell or "nan") for cell in row] for row in table]) for table in (rows, again))
        np.testing.assert_array_equal(np.isnan(after), np.isnan(before))
        off = np.nan_to_num(np.abs(after - before) / digit)
        assert off.max() < 1.5
        assert np.mean(off > 0.5) < 1e-3


def test_every_recorded_day_is_one_of_the_list() -> None:
    assert {day.file for day in DAYS} == set(FOLDER.iterdir())
    assert len(set(DAYS)) == len(DAYS)


def test_a_day_that_is_not_recorded_or_has_another_truth_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(FileNotFoundError, match="add it to DAYS"):
        recorded_day("tendon_friction", 2.25)
    day = Day("tendon_friction", 2.5)
    monkeypatch.setattr(recorded_days, "FOLDER", tmp_path)
    (tmp_path / Day("tendon_friction", 2.25).file.name).write_bytes((FOLDER / day.file.name).read_bytes())
    with pytest.raises(ValueError, match="record it again"):
        Day("tendon_friction", 2.25).unpack(tmp_path)
    assert TRUTH in {file.name for file in tmp_path.iterdir()}
