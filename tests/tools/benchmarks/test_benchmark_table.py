"""Rows that a benchmark keeps: a run that was cut off goes on where it stopped."""

from __future__ import annotations

from pathlib import Path

import pytest
from joblib import delayed

from tools.benchmarks.table import Row, kept_rows, read_rows


def row(key: str, value: object) -> Row:
    return {key: value, "made": "anew"}


def test_only_what_has_no_row_is_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "results" / "days.jsonl"
    work = {1: delayed(row)("seed", 1), "day_01": delayed(row)("day", "day_01")}
    assert kept_rows(log, {1: work[1]}, 1, str) == [{"seed": 1, "made": "anew"}]
    log.write_text('{"seed": 1, "made": "before"}\n{"day": "day_0')  # killed in the writing of a row
    assert read_rows(log) == [{"seed": 1, "made": "before"}]
    log.write_text('{"seed": 1, "made": "before"}\n')
    capsys.readouterr()
    rows = kept_rows(log, work, 1, lambda r: f"{r['day']} is done")
    assert rows == [{"seed": 1, "made": "before"}, {"day": "day_01", "made": "anew"}]
    assert capsys.readouterr().out == "day_01 is done\n"
    assert kept_rows(log, work, 1, str) == rows
