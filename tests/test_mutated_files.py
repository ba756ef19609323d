"""A sample of the mutated files (tools/mutated_files): each is refused in one line, or read as exactly what it says."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tools.mutated_files.literal import Differs, check_robot, check_set, check_twin
from tools.mutated_files.sources import KINDS, SET, TWIN, robot_texts, write_set
from tools.mutated_files.worker import tried
from twin.errors import TwinError
from twin.measurements import read
from twin.robots import load
from twin.robots.robot import models_folder
from twin.storage import read_twin

EACH = 30  # of a kind
FIRST = 100_000  # beyond the seeds the generator is run with


@pytest.mark.parametrize("kind", KINDS)
def test_mutants_are_refused_or_read_to_the_letter(kind: str) -> None:
    found = {seed: tried(kind, seed) for seed in range(FIRST, FIRST + EACH)}
    wrong = {seed: (outcome, words) for seed, (outcome, _, words) in found.items() if outcome not in ("refused", "accepted")}
    assert not wrong
    assert "refused" in {outcome for outcome, _, _ in found.values()}


@given(kind=st.sampled_from(KINDS), seed=st.integers(2**40, 2**60))
@settings(max_examples=60, deadline=None)
def test_so_is_any_other(kind: str, seed: int) -> None:
    outcome, _, words = tried(kind, seed)
    if outcome not in ("refused", "accepted"):
        pytest.fail(f"{outcome}: {words}")


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_damaged_bytes_are_refused_or_read(data: st.DataObject) -> None:
    """Bytes replaced, cut out or put in at random, in a robot's and in a twin's file."""
    whole = data.draw(st.sampled_from([*robot_texts(), TWIN])).encode()
    at, end = sorted(data.draw(st.tuples(st.integers(0, len(whole)), st.integers(0, len(whole)))))
    damaged = whole[:at] + data.draw(st.binary(max_size=12)) + whole[min(end, at + data.draw(st.integers(0, 40))) :]
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / ("twin.toml" if whole == TWIN.encode() else "robot.toml")
        path.write_bytes(damaged)
        try:
            read_twin(path.parent)
        except TwinError as refused:
            if not str(refused).isprintable():
                pytest.fail(f"not one line: {refused!r}")


def test_the_second_reader_sees_a_robot_that_is_not_the_file() -> None:
    robot = load("continuum")
    path = robot.folder / "robot.toml"
    check_robot(path, robot)
    first, *rest = robot.parameters
    for other in (
        replace(robot, parameters=(replace(first, value=first.value * (1 + 1e-9)), *rest)),
        replace(robot, parameters=tuple(rest)),
        replace(robot, parameters=(replace(first, std=1e-5), *rest)),
        replace(robot, structure={**robot.structure, "disks": 7}),
        replace(robot, gravity=-robot.gravity),
        replace(robot, title="another"),
    ):
        with pytest.raises(Differs):
            check_robot(path, other)


def test_the_second_reader_sees_a_key_that_nobody_read(tmp_path: Path) -> None:
    text = (models_folder() / "continuum/robot.toml").read_text()
    path = tmp_path / "robot.toml"
    path.write_text(text.replace("std = 4.66", "Std = 4.66"))
    with pytest.raises(Differs):
        check_robot(path, load("continuum"))


def test_the_second_reader_sees_a_twin_and_a_set_that_are_not_the_file(tmp_path: Path) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(TWIN)
    twin = read_twin(path)
    check_twin(path, twin)
    for other in (replace(twin, values={**twin.values, "disks.mass": 0.0051}), replace(twin, effects=twin.effects[:2])):
        with pytest.raises(Differs):
            check_twin(path, other)
    write_set(tmp_path / "set", "csv")
    recording = read(tmp_path / "set")
    check_set(tmp_path / "set", recording)
    (tmp_path / "set/measurements.toml").write_text(SET.replace("{suffix}", "csv").replace('"mm"', '"cm"'))
    with pytest.raises(Differs):
        check_set(tmp_path / "set", recording)


def test_a_damaged_column_that_nobody_reads_hides_none_of_the_others(tmp_path: Path) -> None:
    """It is named as left out, its page is never opened; the same damage to a column that is read is refused."""
    for damaged in ("more", "tip_x"):
        folder = tmp_path / damaged
        write_set(folder, "parquet")
        path = folder / "a.parquet"
        table = pyarrow.parquet.read_table(path)
        pyarrow.parquet.write_table(table.append_column("more", table.column("tip_x")), path)
        group = pyarrow.parquet.read_metadata(path).row_group(0)
        column = next(group.column(k) for k in range(group.num_columns) if group.column(k).path_in_schema == damaged)
        data = bytearray(path.read_bytes())
        at = column.dictionary_page_offset or column.data_page_offset
        data[at : at + 8] = b"\xff" * 8
        path.write_bytes(data)
        if damaged == "tip_x":
            with pytest.raises(TwinError, match="cannot be read as Parquet"):
                read(folder)
            continue
        recording = read(folder)
        assert any("'more'" in notice for notice in recording.notices)
        check_set(folder, recording)
