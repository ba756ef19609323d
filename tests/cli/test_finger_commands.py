"""`twin shape`, `align` and `train`: on the bundled day as their page says; given what they cannot use, one line, exit code 2."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from twin import cli
from twin.prediction.twin_file.storage import read_twin
from twin.robots import sample
from twin.robots.robot import models_folder

DATA = Path(__file__).parents[1] / "data"
SET, PAGE = DATA / "finger_shape", Path(__file__).parents[2] / "twin/shape/README.md"
SENSOR = "sensor_3_resistance"


def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The line that a command ends with, which must be one."""
    monkeypatch.setattr(cli, "_leave", sys.exit)  # which ends the interpreter at once, and the tests with it
    monkeypatch.setattr(sys, "argv", ["twin", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("twin: ")
    return lines[0]


def test_the_pages_lines_run_on_the_bundled_day(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Against what the finite elements that made the day know. The day is at most 3 MB."""
    day = sample("monday")
    assert sum(file.stat().st_size for file in day.rglob("*")) < 3e6
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "_leave", sys.exit)  # which a refusal would end in
    for line in re.findall(r"^twin ((?:align|shape) .*?)\s+#", PAGE.read_text("utf-8"), flags=re.MULTILINE):
        monkeypatch.setattr(sys, "argv", ["twin", *line.split()])
        cli.main()
        assert "using the bundled day" in " ".join(capsys.readouterr().out.split())
    built, found = json.loads(day.with_name("monday_truth.json").read_text())["finger"], read_twin("aligned").values
    assert np.rad2deg(found["mounting.angle"]) == pytest.approx(built["phi_deg"], abs=0.12)  # deg, as the page says
    for k, ohm in enumerate(built["R0_ohm"], start=1):
        assert found[f"sensors.resistance_{k}"] == pytest.approx(ohm, rel=1e-3)
    with np.load(DATA / "monday_truth.npz") as true, np.load("shape.npz") as told:
        for trial, most in (("test_1", 0.3), ("test_2", 1.0), ("test_3", 1.0)):  # mm; 0.11, 0.54 and 0.47 were seen
            rows = np.searchsorted(told[f"{trial}_time"], true[f"{trial}_time"] - 1e-6)
            places = float(true["unit_mm"]) * true[f"{trial}_vertices"]
            assert np.linalg.norm(1e3 * told[f"{trial}_vertices"][rows] - places, axis=2).mean() < most


def broken_set(folder: Path, what: str) -> Path:
    """A copy of the day without clouds, of one short trial, with one thing wrong."""
    folder.mkdir()
    text = (SET / "measurements.toml").read_text()
    head, _, _ = text.partition("[[trial]]")
    rows = [line.split(",") for line in (SET / "test_1.csv").read_text().splitlines()[:12]]
    column = rows[0].index(SENSOR)
    if what == "column of the file":
        rows = [row[:column] + row[column + 1 :] for row in rows]
    elif what == "channel":
        head = re.sub(rf'\[\[channel\]\]\nname  = "{SENSOR}"\n(?:\w.*\n)*', "", head)
        rows = [row[:column] + row[column + 1 :] for row in rows]
    elif what in ("zero", "negative"):
        rows[4][column] = {"zero": "0.0", "negative": "-950.0"}[what]
    (folder / "measurements.toml").write_text(head + '[[trial]]\nfile = "test_1.csv"\n')
    (folder / "test_1.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")
    return folder


@pytest.mark.parametrize("command", ["shape", "align"])
@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("column of the file", [SENSOR, "test_1.csv"]),
        ("channel", [SENSOR, "finger"]),
        ("zero", ["row 4", SENSOR, "0 ohm", "above zero"]),
        ("negative", ["row 4", SENSOR, "-950 ohm", "above zero"]),
    ],
)
def test_bad_sensors(
    command: str, what: str, said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = broken_set(tmp_path / "set", what)
    if command == "align":  # which looks for clouds first
        shutil.copy(SET / "align_1.clouds.npz", broken / "test_1.clouds.npz")
        toml = broken / "measurements.toml"
        toml.write_text(toml.read_text() + 'cloud = "test_1.clouds.npz"\n')
    twin = ["--twin", "finger"] if command == "shape" else []
    line = refused(monkeypatch, capsys, command, broken, *twin, "--out", tmp_path / "out")
    assert all(word in line for word in said), line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["set"]


def test_a_set_of_another_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    other = models_folder() / "continuum/samples/friday"
    line = refused(monkeypatch, capsys, "shape", other, "--twin", "finger", "--out", tmp_path / "out.npz")
    assert "'continuum'" in line
    assert "'finger'" in line
    line = refused(monkeypatch, capsys, "shape", other, "--twin", "continuum", "--out", tmp_path / "out.npz")
    assert "has no strain sensors" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("what", ["missing", "truncated", "format", "pickled"])
def test_bad_weights(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    name = "modal"
    robot = tmp_path / "finger"
    shutil.copytree(models_folder() / "finger", robot, ignore=shutil.ignore_patterns("samples"))
    path = robot / f"{name}.npz"
    whole = path.read_bytes()
    path.unlink()
    if what == "truncated":
        path.write_bytes(whole[: len(whole) // 2])
    elif what == "format":
        np.savez(path, format=np.array("twin-modal/1"))
    elif what == "pickled":
        np.savez(path, format=np.array([{"not": "an array"}], dtype=object))
    out = tmp_path / "out.npz"
    line = refused(monkeypatch, capsys, "shape", SET, "--twin", robot, "--estimator", name, "--out", out)
    assert f"{name}.npz" in line
    assert "twin train" in line
    assert ("twin-modal/1" in line) == (what == "format")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["finger"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["modul"], ["modul", "modal"]),
        (["physics"], ["no weights to train", "modal"]),
        (["modal"], ["twin generate"]),
    ],
)
def test_bad_trainings(
    words: list[str], said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    line = refused(monkeypatch, capsys, "train", *words, "--data", data, "--out", tmp_path / "w.npz")
    assert all(word in line for word in said), line
    assert not (tmp_path / "w.npz").exists()
