"""The check of fetched raw data, on a folder of the test's own: no network."""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path

import pytest

from tools.benchmarks.hardware import fetch as fetch_measured

ROW = {"file": "rig/00.TXT.gz", "url": "https://example.org/00.TXT", "sha256": hashlib.sha256(b"1,2\n").hexdigest()}


@pytest.fixture(autouse=True)
def one_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fetch_measured, "listed", lambda: [ROW])


def test_what_was_placed_is_right_and_a_changed_byte_is_not(tmp_path: Path) -> None:
    assert fetch_measured.wrong(tmp_path) == [f"{tmp_path / ROW['file']}: missing"]
    fetch_measured.place(ROW, b"1,2\n", tmp_path)
    assert fetch_measured.wrong(tmp_path) == []
    for spoilt in (gzip.compress(b"1,3\n"), b"no gzip"):
        (tmp_path / ROW["file"]).write_bytes(spoilt)
        assert "its bytes are not those of" in fetch_measured.wrong(tmp_path)[0]


def test_other_bytes_are_not_placed(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing is written"):
        fetch_measured.place(ROW, b"1,2\r\n", tmp_path)
    assert list(tmp_path.iterdir()) == []
