"""`twin new` and `twin robots FOLDER`: one's own robot from nothing to a picture, in a folder of one's own."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import twin
from tools.site import reference
from twin.foundation.errors import DataError, UnknownNameError
from twin.measurements import read
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin, robot_reference, twin_table, write_twin
from twin.report.robot_page import draw_robot
from twin.robots import load, robot_names
from twin.robots.family import family_names, load_family
from twin.robots.starter import FIRST_SET, write_starter


@pytest.mark.parametrize("family", family_names())
def test_a_new_robot_loads_at_once(family: str, tmp_path: Path) -> None:
    folder = write_starter("snake", family, tmp_path)
    robot = load("snake", relative_to=tmp_path)
    example = next(r for r in map(load, robot_names()) if r.family == family)
    assert (robot.name, robot.family) == ("snake", family)
    assert {**robot.structure, "model": ""} == {**example.structure, "model": ""}  # the file of an MJCF is its own copy
    own = [p for p in example.parameters if not p.name.startswith("springs.")]
    assert [(p.name, p.std is None) for p in robot.parameters] == [(p.name, p.std is None) for p in own]
    # Written in the file's unit and read again: two roundings.
    assert [p.value for p in robot.parameters] == pytest.approx([p.value for p in own], rel=1e-14)
    assert np.array_equal(robot.gravity, example.gravity)
    robot.build().spec.compile()
    text = (folder / "robot.toml").read_text()
    assert family == "mjcf" or all(p.file_unit in text for p in robot.parameters)  # an MJCF has units of its own
    assert sorted(p.name for p in tmp_path.iterdir()) == ["snake"]  # nothing half-written stays


@pytest.mark.parametrize("family", family_names())
def test_its_measurement_set_lacks_nothing_but_measurements(family: str, tmp_path: Path) -> None:
    folder = write_starter("snake", family, tmp_path) / FIRST_SET
    with pytest.raises(DataError, match="0 usable trials"):
        read(folder)
    for trial in folder.glob("*.csv"):
        columns = trial.read_text().strip().split(",")
        rows = [",".join([str(t), *("0" for _ in columns[1:])]) for t in range(4)]
        trial.write_text("\n".join([",".join(columns), *rows]) + "\n")
    recording = read(folder)
    assert load(recording.robot, recording.folder).name == "snake"
    assert recording.notices == ()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "snake").mkdir()
    with pytest.raises(DataError, match="not overwritten"):
        write_starter("snake", "continuum", tmp_path)
    assert list((tmp_path / "snake").iterdir()) == []


@pytest.mark.parametrize("name", ["continuum", "..", "a/b", "", "[red]", "x" * 100])
def test_a_name_that_cannot_be_one_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="robot's name"):
        write_starter(name, "continuum", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_family_lists_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="available: continuum, hand, mjcf, soft, transmission"):
        write_starter("snake", "continum", tmp_path)


@pytest.mark.parametrize("name", robot_names())
def test_the_picture_has_everything_where_it_is(name: str) -> None:
    """Tendons run through the holes of the file's radius, mm; markers, base frame and gravity are there."""
    robot = load(name)
    traces = {t.name: t for t in draw_robot(robot).data}
    assert {f"tendon {i}" for i in range(1, len(robot.build().tendon_sites) + 1)} <= set(traces)
    assert {"base frame, x", "base frame, y", "base frame, z", "body"} <= set(traces)
    assert any(t.startswith("gravity") for t in traces) == bool(robot.gravity.any())
    values = {p.name: p.value for p in robot.parameters}
    if "tendons.radius" in values:
        start = np.array([traces["tendon 1"].x[0], traces["tendon 1"].y[0], traces["tendon 1"].z[0]])
        angle = values["tendons.angle_1"]
        # mm: a product and a sum of doubles
        expected = 1e3 * values["tendons.radius"] * np.array([np.cos(angle), np.sin(angle), 0.0])
        assert start == pytest.approx(expected, abs=1e-9)
        assert len(traces["markers"].text) == max(1, len(robot.build().marker_sites) - 1)  # the tip is the last of them


def test_own_folders_work_on_the_command_line(tmp_path: Path) -> None:
    assert twin("new", "snake", "--family", "continuum", cwd=tmp_path).returncode == 0
    done = twin("robots", "snake", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "77.59" in done.stdout  # GPa, as in the file
    html = (tmp_path / "snake.html").read_text()
    assert "<script" in html
    assert 'src="http' not in html  # self-contained
    assert twin("robots", ".", "--out", "../other.html", cwd=tmp_path / "snake").returncode == 0
    assert (tmp_path / "other.html").is_file()
    lost = twin("robots", "snaek", cwd=tmp_path)
    assert lost.returncode == 2
    assert "path" in lost.stderr
    unfilled = twin("diagnose", f"snake/{FIRST_SET}", cwd=tmp_path)
    assert (unfilled.returncode, "0 usable trials" in unfilled.stderr) == (2, True)


@pytest.mark.parametrize("place", ["reports", "snake", "deep/er/still"])
def test_a_twin_file_names_its_robot_from_where_it_stands(place: str, tmp_path: Path) -> None:
    write_starter("snake", "continuum", tmp_path)
    robot = load("snake", relative_to=tmp_path)
    folder = tmp_path / place
    folder.mkdir(parents=True, exist_ok=True)
    write_twin(folder / "twin.toml", twin_table(Twin.of(robot), folder, {}, {}), {})
    assert read_twin(folder).robot.folder == robot.folder
    assert not Path(tomllib.loads((folder / "twin.toml").read_text())["robot"]).is_absolute()
    moved = tmp_path / "moved"
    moved.mkdir()
    for each in ("snake", place.split("/")[0]):
        if (tmp_path / each).exists():
            (tmp_path / each).rename(moved / each)
    assert read_twin(moved / place).robot.folder == moved / "snake"


def test_a_robot_of_ones_own_is_not_taken_for_a_shipped_one(tmp_path: Path) -> None:
    folder = tmp_path / "continuum"
    write_starter("snake", "continuum", tmp_path).rename(folder)
    robot = load(str(folder))
    assert load(robot_reference(robot, tmp_path), tmp_path).folder == folder
    assert robot_reference(load("continuum"), tmp_path) == "continuum"


def test_every_number_of_a_robot_file_is_on_a_page_of_its_family() -> None:
    """And on the generated reference."""
    whole = reference.page()
    for family in family_names():
        robots = [name for name in robot_names() if load(name).family == family] + ["finger"] * (family == "hand")
        pages = [page.read_text("utf-8") for name in robots for page in load(name).folder.glob("*.md")]
        for row in load_family(family).SCHEMA.rows:
            assert any(f"`{row.name}" in page for page in pages), (family, row.name)
            assert row.name in whole


def test_names_cannot_steer_the_terminal(tmp_path: Path) -> None:
    """Brackets of the terminal's markup in titles, and its control characters, are shown as they are or not at all."""
    folder = write_starter("snake", "continuum", tmp_path)
    toml = folder / "robot.toml"
    toml.write_text(toml.read_text().replace("snake, described by its builder", "[/] [red]snake"))
    done = twin("robots", "snake", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "[/] [red]snake" in done.stdout
    set_ = folder / FIRST_SET
    text = (set_ / "measurements.toml").read_text().replace("First bench day", "[/]\\u001b[31m")
    (set_ / "measurements.toml").write_text(text)
    for trial in set_.glob("*.csv"):
        columns = trial.read_text().strip().split(",")
        trial.write_text("\n".join([",".join(columns), *(",".join([str(t), *("0" for _ in columns[1:])]) for t in range(4))]))
    done = twin("evaluate", "snake", str(set_), "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["unit"] == "mm"
    assert "\x1b[31m" not in done.stderr
    done = twin("simulate", "snake", str(set_), "--out", "elsewhere/simulated", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    simulated = read(tmp_path / "elsewhere/simulated")
    assert load(simulated.robot, simulated.folder).folder == folder.resolve()


@pytest.mark.parametrize("name", ["continuum", "cable_tool", "hand"])
def test_the_picture_holds_all_of_a_robot_at_one_scale(name: str) -> None:
    picture = draw_robot(load(name))
    scene = picture.layout.scene
    for axis in "xyz":
        low, high = scene[f"{axis}axis"].range
        every = np.concatenate([np.array(t[axis], float) for t in picture.data])
        assert low <= np.nanmin(every)
        assert np.nanmax(every) <= high
        assert (high - low) / scene.aspectratio[axis] == pytest.approx(np.ptp(scene.zaxis.range) / scene.aspectratio.z)
