"""The three files appear together or not at all."""

import json
from importlib import import_module

import pytest
from small_diagnosis import SETTINGS, diagnosis

from twin.foundation.errors import DataError
from twin.prediction.twin_file.storage import read_twin
from twin.report import provenance, write

FILES = {"report.json", "report.html", "twin.toml"}


@pytest.fixture(scope="module")
def found():
    d = diagnosis()
    return d, provenance(d.prepared.recording, SETTINGS, "twin diagnose here")


def test_all_three_are_written_and_the_twin_reads_back(tmp_path, found):
    d, made = found
    write(d, tmp_path / "a" / "report", made)
    folder = tmp_path / "a" / "report"
    assert {p.name for p in folder.iterdir()} == FILES
    assert json.loads((folder / "report.json").read_text())["provenance"] == made
    twin = read_twin(folder)
    assert twin.values == d.twin.values
    assert twin.effects == d.twin.effects
    assert f'data_hash = "{made["data_hash"]}"' in (folder / "twin.toml").read_text()


def test_an_earlier_report_is_replaced_and_other_files_stay(tmp_path, found):
    d, made = found
    (tmp_path / "report.json").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    write(d, tmp_path, made)
    assert json.loads((tmp_path / "report.json").read_text())["format"] == "twin-report/1"
    assert {p.name for p in tmp_path.iterdir()} == FILES | {"notes.txt"}


@pytest.mark.parametrize("where", ["page", "twin_text"])
def test_a_failure_leaves_the_folder_as_it_was(tmp_path, found, monkeypatch, where):
    d, made = found
    (tmp_path / "report.json").write_text("old")

    def fail(*arguments):
        raise RuntimeError("a template broke")

    monkeypatch.setattr(import_module("twin.report.write"), where, fail)
    with pytest.raises(RuntimeError):
        write(d, tmp_path, made)
    assert (tmp_path / "report.json").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]


def test_a_full_disk_leaves_the_folder_as_it_was(tmp_path, found):
    d, made = found
    (tmp_path / "report.json").write_text("old")
    (tmp_path / "twin.toml.part").mkdir()  # the last of the three cannot be written
    with pytest.raises(DataError, match=r"twin\.toml: cannot be written"):
        write(d, tmp_path, made)
    assert (tmp_path / "report.json").read_text() == "old"
    assert {p.name for p in tmp_path.iterdir()} == {"report.json", "twin.toml.part"}


def test_a_file_in_the_way_is_refused(tmp_path, found):
    d, made = found
    (tmp_path / "report").write_text("a file")
    for folder in (tmp_path / "report", tmp_path / "report" / "inside"):
        with pytest.raises(DataError, match="is a file"):
            write(d, folder, made)
    assert (tmp_path / "report").read_text() == "a file"
