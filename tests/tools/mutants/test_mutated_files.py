"""Files with mistakes in them: each is refused in one line, or read as exactly what it says; soon, and in bounded memory.

DAMAGED_FILES=1000 pytest -n 0 tests/tools/mutants/test_mutated_files.py      more files of each kind than the 40 of a usual run
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import damaged_files as damaged
import pyarrow.parquet
import pytest
from damaged_files import SET, TWIN, robot_texts, write_set
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from literal_reader import Differs, check_robot, check_set, check_twin

from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.prepared import prepare
from twin.prediction.twin_file.storage import read_twin
from twin.report.robot_page import draw_robot
from twin.robots import load
from twin.robots.robot import models_folder

EACH = settings(max_examples=int(os.environ.get("DAMAGED_FILES", "40")), deadline=None, suppress_health_check=list(HealthCheck))
SLOW = 5.0  # s to read one file
LARGE = 1024.0  # MB more than before
LONGEST_MESSAGE = 4000  # characters: twenty things that are wrong, each in a line


def one_line(error: TwinError) -> None:
    said = str(error)
    assert said.isprintable(), f"not one line to print: {said[:200]!r}"
    assert len(said) <= LONGEST_MESSAGE


def resident(which: str) -> float:
    """MB of this process in memory: VmRSS now, or VmHWM, the most since the last reset (Linux)."""
    line = next(each for each in Path("/proc/self/status").read_text().splitlines() if each.startswith(which))
    return int(line.split()[1]) / 1024


def refused_or_literal(reading: Callable[[], Callable[[], None]]) -> None:
    """Read; what was accepted must be what a second, literal reader finds."""
    Path("/proc/self/clear_refs").write_text("5")
    before, began = resident("VmRSS"), time.monotonic()
    try:
        check = reading()
    except TwinError as refused:
        one_line(refused)
        check = None
    assert time.monotonic() - began < SLOW, "hangs"
    assert resident("VmHWM") - before < LARGE, "takes too much memory"
    if check is not None:
        check()


def refused_or_literal_set(folder: Path) -> None:
    def reading() -> Callable[[], None]:
        recording = read(folder)
        try:
            prepare(recording, load(recording.robot, folder))
        except TwinError as error:
            one_line(error)
        return lambda: check_set(folder, recording)

    refused_or_literal(reading)


@EACH
@given(st.sampled_from(robot_texts()).flatmap(damaged.damaged_toml))
def test_a_damaged_robot_is_refused_or_read_to_the_letter(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "robot.toml"
        path.write_bytes(data)

        def reading() -> Callable[[], None]:
            robot = load(str(path.parent))
            draw_robot(robot)
            return lambda: check_robot(path, robot)

        refused_or_literal(reading)


@EACH
@given(damaged.damaged_toml(TWIN) | damaged.damaged_bytes(TWIN.encode()))
def test_a_damaged_twin_is_refused_or_read_to_the_letter(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "twin.toml"
        path.write_bytes(data)

        def reading() -> Callable[[], None]:
            twin = read_twin(path)
            body = twin.robot.build(twin.values)
            for effect in twin.effects:
                effect.edit(body)
            body.spec.compile()
            return lambda: check_twin(path, twin)

        refused_or_literal(reading)


PARTS = {
    "measurements.toml": damaged.damaged_toml(SET.replace("{suffix}", "csv")), "a.csv": damaged.damaged_csv(),
    "a.parquet": damaged.damaged_parquet(), "a.clouds.npz": damaged.damaged_clouds(),
}  # fmt: skip


@pytest.mark.parametrize("part", PARTS)
@EACH
@given(data=st.data())
def test_a_set_with_a_damaged_part_is_refused_or_read_to_the_letter(part: str, data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "set"
        write_set(folder, "parquet" if part == "a.parquet" else "csv")
        (folder / part).write_bytes(data.draw(PARTS[part]))
        refused_or_literal_set(folder)


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
    for name in ("more", "tip_x"):
        folder = tmp_path / name
        write_set(folder, "parquet")
        path = folder / "a.parquet"
        table = pyarrow.parquet.read_table(path)
        pyarrow.parquet.write_table(table.append_column("more", table.column("tip_x")), path)
        group = pyarrow.parquet.read_metadata(path).row_group(0)
        column = next(group.column(k) for k in range(group.num_columns) if group.column(k).path_in_schema == name)
        data = bytearray(path.read_bytes())
        at = column.dictionary_page_offset or column.data_page_offset
        data[at : at + 8] = b"\xff" * 8
        path.write_bytes(data)
        if name == "tip_x":
            with pytest.raises(TwinError, match="cannot be read as Parquet"):
                read(folder)
            continue
        recording = read(folder)
        assert any("'more'" in notice for notice in recording.notices)
        check_set(folder, recording)
