"""`twin import` and `twin export` as a user meets them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command_line import twin
from tests.measurements.measurement_sets import write_set
from twin.measurements import read
from twin.measurements.logs import libraries

LOG = "time,tendon_1_tension [N],tip_x [mm]\n" + "".join(f"{n / 10},{n},{n / 7}\n" for n in range(20))


def test_a_log_is_listed_mapped_and_imported(tmp_path: Path) -> None:
    (tmp_path / "bench.csv").write_text(LOG)
    listed = twin("import", "bench.csv", cwd=tmp_path)
    assert listed.returncode == 0, listed.stderr
    assert "tendon_1_tension" in listed.stdout
    assert 'map: bench-map.toml; fill in its "?"' in listed.stdout
    again = twin("import", "bench.csv", cwd=tmp_path)
    assert "exists and is kept" in again.stdout
    path = tmp_path / "bench-map.toml"

    refused = twin("import", "bench.csv", "--out", "set", cwd=tmp_path)
    assert refused.returncode == 2
    assert re.search(r"^twin: bench-map\.toml: 3 things are wrong: .*line \d+: robot = \"\?\"", refused.stderr)
    assert len(refused.stderr.strip().split("\n")) == 1
    assert not (tmp_path / "set").exists()

    text = path.read_text().replace('robot = "?"', 'robot = "continuum"').replace('source = "?"', 'source = "hardware"')
    path.write_text(text.replace('role = "?"', 'role = "input"'))
    done = twin("import", "bench.csv", "--out", "set", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "bench: stamped by time" in done.stdout
    assert "1 trial, 20 rows, 2 channels: set" in done.stdout
    assert read(tmp_path / "set", least_trials=1).trials[0].values["tendon_1_tension"].tolist() == list(range(20))


def test_the_path_of_a_robot_counts_from_the_map_and_an_unknown_one_is_said(tmp_path: Path) -> None:
    assert twin("new", "worm", "--family", "continuum", cwd=tmp_path).returncode == 0
    (tmp_path / "bench.csv").write_text(LOG)
    twin("import", "bench.csv", cwd=tmp_path)
    path = tmp_path / "bench-map.toml"
    text = path.read_text().replace('source = "?"', 'source = "hardware"').replace('role = "?"', 'role = "input"')
    for robot, found, said in (("worm", "../../worm", ""), ("nobody", "nobody", "the robot is not there yet")):
        path.write_text(text.replace('robot = "?"', f'robot = "{robot if robot == "nobody" else "./worm"}"'))
        done = twin("import", "bench.csv", "--out", f"sets/{robot}", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert said in done.stdout
        assert read(tmp_path / "sets" / robot, least_trials=1).robot == found


def test_a_missing_log_or_map_is_one_line(tmp_path: Path) -> None:
    for words, said in ((["import", "none.mcap"], "no such file"), (["import", "none.mcap", "--out", "x"], "no such map")):
        done = twin(*words, cwd=tmp_path)
        assert done.returncode == 2
        assert said in done.stderr
        assert len(done.stderr.strip().split("\n")) == 1


def test_a_missing_library_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(libraries, "import_module", missing)
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    done = twin("import", "a.mcap", cwd=tmp_path)
    assert done.returncode == 2
    assert 'pip install "tendon-twin[logs]"' in done.stderr


def test_a_set_is_exported(tmp_path: Path) -> None:
    bench = write_set(tmp_path / "bench")
    done = twin("export", bench, "--mcap", "a.mcap", "--parquet", "table", "--lerobot", "frames", "--rate", "20", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.mcap").read_bytes().startswith(b"\x89MCAP")
    assert len(read(tmp_path / "table").trials) == len(read(bench).trials)
    assert (tmp_path / "frames/meta/info.json").exists()
    listed = twin("import", "a.mcap", cwd=tmp_path)
    assert "/input/tendon_1_tension" in listed.stdout
    nothing = twin("export", bench, cwd=tmp_path)
    assert nothing.returncode == 2
    assert "--mcap FILE" in nothing.stderr
