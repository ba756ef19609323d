"""Text tables of many layouts, Parquet, JSON, Motive and LeRobot come out as the same numbers, or are refused in one line."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from tests.measurements.logs.sample_logs import imported, readings, write_lerobot
from twin.foundation.errors import DataError
from twin.measurements.logs import map_text, open_log
from twin.measurements.logs.clocks import choose_clock
from twin.measurements.logs.guess import guess_fields
from twin.measurements.logs.streams import Stream

WRITTEN_BY_LEROBOT = Path(__file__).parents[2] / "data/lerobot-0.4.4"
NEWTON = ('unit = "[?]"', 'unit = "N"')


def the_stream(path: Path, text: str | bytes) -> Stream:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    (stream,) = open_log(path).takes[0].streams.values()
    return stream


LAYOUTS = {
    "commas": "time,a,b\n0,1.5,2\n1,2.5,4\n2,,8\n",
    "semicolons": "time;a;b\n0;1.5;2\n1;2.5;4\n2;;8\n",
    "decimal commas": "time;a;b\n0;1,5;2\n1;2,5;4\n2;;8\n",
    "tabs": "time\ta\tb\n0\t1.5\t2\n1\t2.5\t4\n2\t\t8\n",
    "spaces": "time   a    b\n0  1.5   2\n1  2.5   4\n2  nan   8\n",
    "comma at the end": "time,a,b,\n0,1.5,2,\n1,2.5,4,\n2,,8,\n",
    "comma at the end of rows": "time,a,b\n0,1.5,2,\n1,2.5,4,\n2,,8,\n",
    "comments": "# a robot\n% more\n\ntime,a,b\n0,1.5,2\n# pause\n1,2.5,4\n2,,8\n",
    "commented header": "%time,a,b\n0,1.5,2\n1,2.5,4\n2,NA,8\n",
    "quotes": '"time","a","b"\n"0","1.5","2"\n"1","2.5","4"\n"2","","8"\n',
    "byte order mark and CRLF": "\ufefftime,a,b\r\n0,1.5,2\r\n1,2.5,4\r\n2,,8\r\n",
    "facts above": "Test,7\nOperator,Ann\nNote\ntime,a,b\n0,1.5,2\n1,2.5,4\n2,,8\n",
    "spaces after commas": "time, a, b\n0, 1.5, 2\n1, 2.5, 4\n2, , 8\n",
    "words for missing": "time,a,b\n0,1.5,2\n1,2.5,4\n2,lost,8\n",
}


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
def test_a_text_table_of_any_layout_is_the_same_numbers(tmp_path: Path, text: str) -> None:
    stream = the_stream(tmp_path / "log.txt", text)
    names = {name.lstrip("%"): field.values for name, field in stream.fields.items() if not np.all(np.isnan(field.values))}
    assert list(names) == ["time", "a", "b"]
    np.testing.assert_array_equal(names["time"], [0, 1, 2])
    np.testing.assert_array_equal(names["a"], [1.5, 2.5, np.nan])
    np.testing.assert_array_equal(names["b"], [2, 4, 8])
    assert list(stream.clocks) == [next(iter(stream.fields))]


def test_units_stand_in_headers_or_in_a_row_of_their_own(tmp_path: Path) -> None:
    stream = the_stream(tmp_path / "a.csv", "Time (Seconds),x [mm],pos (deg),tau_Nm,F\n0,1,2,3,4\n1,2,3,4,5\n2,1,1,1,1\n")
    assert {name: field.unit for name, field in stream.fields.items()} == {
        "Time (Seconds)": "s", "x [mm]": "mm", "pos (deg)": "deg", "tau_Nm": "N*m", "F": "",
    }  # fmt: skip
    stream = the_stream(tmp_path / "b.csv", "t;x;T\nms;mm;°C\n0;1;2\n1;2;3\n2;1;1\n")
    assert [field.unit for field in stream.fields.values()] == ["ms", "mm", "degC"]


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_encodings_of_loggers_are_read(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.csv"
    stream = the_stream(path, "time,angle [°]\n0,1\n1,2\n2,3\n".encode(encoding))
    assert stream.fields["angle [°]"].unit == "deg"
    assert ("Windows-1252" in " ".join(open_log(path).notes)) == (encoding == "cp1252")


@pytest.mark.parametrize(
    ("cells", "unit", "first"),
    [
        (["1726041600.0", "1726041600.5", "1726041601.0"], "s", 1726041600.0),
        (["1726041600000", "1726041600500", "1726041601000"], "ms", 1726041600000),
        (["1726041600000000123", "1726041600500000123", "1726041601000000123"], "ns", 1726041600000000123),
        (["2024-09-11T08:00:00", "2024-09-11T08:00:00.5", "2024-09-11T08:00:01"], "ns", 1726041600000000000),
        (["2024/09/11 08:00:00.5", "2024/09/11 08:00:01.0", "2024/09/11 08:00:01.5"], "ns", 1726041600500000000),
        (["08:00:00.25", "08:00:00.50", "08:00:00.75"], "ns", 28800250000000),
        (["0.1", "0.2", "0.3"], "s", 0.1),
        (["10", "20", "30"], "?", 10),
    ],
)
def test_the_unit_of_a_clock_is_told_by_its_size_or_asked(tmp_path: Path, cells: list[str], unit: str, first: float) -> None:
    stream = the_stream(tmp_path / "a.csv", "time,a\n" + "".join(f"{cell},1\n" for cell in cells))
    assert stream.clocks["time"].ticks[0] == first
    assert choose_clock(stream, one_clock=False).unit == unit


def test_nanoseconds_since_1970_keep_every_nanosecond(tmp_path: Path) -> None:
    stamps = 1726041600000000000 + np.array([0, 7, 1_000_000_007, 2_000_000_001]) * 1000
    rows = "".join(f"{t},{n},{2 * n}\n" for n, t in enumerate(stamps))
    (tmp_path / "a.csv").write_text("timestamp,tendon_1_tension [N],tip_x [mm]\n" + rows)
    recording = imported(tmp_path / "a.csv", tmp_path / "set", ('role = "[?]"', 'role = "input"'))
    np.testing.assert_allclose(recording.trials[0].time, (stamps - stamps[0]) / 1e9, rtol=1e-15)
    np.testing.assert_allclose(recording.trials[0].values["tip_x"], 2e-3 * np.arange(4), rtol=1e-12)


def test_seconds_and_nanoseconds_in_two_columns_are_one_clock(tmp_path: Path) -> None:
    stream = the_stream(tmp_path / "a.csv", "stamp.sec,stamp.nanosec,x\n1726041600,5,1\n1726041601,7,2\n1726041602,9,3\n")
    clock = stream.clocks["stamp.sec + stamp.nanosec"]
    assert (clock.unit, clock.ticks.tolist()) == ("ns", [1726041600000000005, 1726041601000000007, 1726041602000000009])


def test_columns_of_one_name_are_told_apart_and_a_cut_off_line_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    stream = the_stream(path, "time,x,x\n0,1,2\n1,3,4\n2,5,6\n3,7")
    assert list(stream.fields) == ["time", "x", "x (2)"]
    assert stream.count == 3
    notes = " ".join(open_log(path).notes)
    assert "same name" in notes
    assert "1 of 4 rows have not 3 cells" in notes


def test_files_of_other_programs_are_read(tmp_path: Path) -> None:
    plotjuggler = "__time,/joint_states/elbow/position,/cmd\n1726041600.1,0.5,\n1726041600.2,,1\n1726041600.3,0.7,\n"
    stream = the_stream(tmp_path / "plotjuggler.csv", plotjuggler)
    assert list(stream.clocks) == ["__time"]
    assert guess_fields(stream)["/joint_states/elbow/position"].quantity == "joint.elbow.position"
    rostopic = "%time,field.header.seq,field.pose.position.x\n175447000000,5,1.5\n175467000000,6,2.5\n175487000000,7,2.5\n"
    assert the_stream(tmp_path / "rostopic.csv", rostopic).clocks["time"].unit == "ns"
    qualisys = "NO_OF_FRAMES\t3\nFREQUENCY\t100\nMARKER_NAMES\ta\tb\nFrame\tTime\tm1 X\tm1 Y\n"
    qualisys += "1\t0.00\t5\t6\n2\t0.01\t7\t8\n3\t0.02\t9\t9\n"
    stream = the_stream(tmp_path / "qualisys.tsv", qualisys)
    assert list(stream.fields) == ["Frame", "Time", "m1 X", "m1 Y"]
    assert guess_fields(stream)["m1 X"].quantity == "marker_1_x"
    assert the_stream(tmp_path / "excel.csv", "sep=;\nt;a\n0,5;1\n0,6;2\n0,7;4\n").fields["t"].values.tolist() == [0.5, 0.6, 0.7]


def test_a_table_without_header_or_time_is_numbered(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    stream = the_stream(path, "1.5,2\n2.5,4\n3.5,8\n")
    assert list(stream.fields) == ["column_1", "column_2"]
    assert 'clock = "row", rate = "?"' in map_text(open_log(path), "m.toml")


REFUSED = {
    "empty": (b"", "empty"),
    "text": (b"hello world\nthis is no table\n", "no row of numbers"),
    "header only": (b"time,a,b\n", "no row of numbers"),
    "binary": (bytes(range(256)) * 20, "binary file"),
    "hdf5": (b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5"),
    "xlsx": (b"PK\x03\x04" + bytes(100), "zip"),
    "ragged": (b"time,a\n" + b"0,1\n1,2,3\n" * 20, "rows have not"),
    "parquet": (b"PAR1" + bytes(100), "cannot be read as Parquet"),
    "mcap": (b"\x89MCAP0\r\n" + bytes(20), "no message that can be read"),
    "json": (b'{"a": 1', "begins like JSON"),
    "motive": (b"Format Version,1.23\n\n1,2,3\n", "no row Frame"),
    "gzip": (gzip.compress(b"time,a\n0,1\n")[:-12], "cannot be read"),
}


@pytest.mark.parametrize(("data", "said"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(data)
    with pytest.raises(DataError, match=said) as fault:
        open_log(path)
    assert "\n" not in str(fault.value)
    assert str(path) in str(fault.value)


def test_paths_without_a_log_are_refused(tmp_path: Path) -> None:
    for path, said in ((tmp_path / "none", "no such file"), (tmp_path, "folder without a log"), (Path("a\0b"), "no such file")):
        with pytest.raises(DataError, match=said):
            open_log(path)


def test_parquet_of_any_layout_is_the_same_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    state, force = rng.normal(size=(5, 2)), rng.normal(size=5)
    table = pa.table(
        {
            "timestamp": pa.array([0, 10, 20, 30, 40], pa.timestamp("ms")), "state": pa.array(state.tolist()),
            "wrench": pa.array([{"force": {"x": x}} for x in force]), "label": ["a", "a", "b", "b", "b"], "raw": [b"x"] * 5,
            "on": [True, False, True, None, True],
        }
    )  # fmt: skip
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    (stream,) = open_log(tmp_path / "a.parquet").takes[0].streams.values()
    assert list(stream.fields) == ["timestamp", "state[0]", "state[1]", "wrench.force.x", "label", "on"]
    np.testing.assert_array_equal(stream.fields["state[1]"].values, state[:, 1])
    np.testing.assert_array_equal(stream.fields["wrench.force.x"].values, force)
    assert stream.fields["label"].labels == ("a", "b")
    assert stream.clocks["timestamp"].ticks.tolist() == [n * 10**7 for n in range(5)]


@pytest.mark.parametrize("shape", ["records", "inside", "lines", "columns"])
def test_json_records_are_rows(tmp_path: Path, shape: str) -> None:
    records = [{"t": n / 10, "q": {"elbow": n / 3}, "n": n} for n in range(4)]
    content = {
        "records": json.dumps(records), "inside": json.dumps({"mass": 0.5, "entries": records}),
        "lines": "\n".join(map(json.dumps, records)), "columns": json.dumps({"t": [0.0, 0.1, 0.2, 0.3], "n": [0, 1, 2, 3]}),
    }  # fmt: skip
    (tmp_path / "a.json").write_text(content[shape])
    log = open_log(tmp_path / "a.json")
    (stream,) = log.takes[0].streams.values()
    assert stream.fields["t"].values.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert stream.fields["n"].values.tolist() == [0, 1, 2, 3]
    if shape != "columns":
        assert stream.fields["q.elbow"].values.tolist() == [n / 3 for n in range(4)]
    assert ("mass = 0.5" in " ".join(log.notes)) == (shape == "inside")


MOTIVE = """\
Format Version,1.23,Take Name,Take 1,Capture Frame Rate,100.000000,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global

,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker
,Name,Tip,Tip,Tip,Tip,Tip,Tip,Tip,Tip,Disk:Marker2,Disk:Marker2,Disk:Marker2
,ID,"1","1","1","1","1","1","1","1","2","2","2"
{parent},,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position
Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z
"""  # noqa: E501


@pytest.mark.parametrize("parent", ["", ",Parent,,,,,,,,,,,\n"])
def test_a_motive_csv_comes_out_as_the_same_numbers(tmp_path: Path, parent: str) -> None:
    rng = np.random.default_rng(5)
    numbers = rng.normal(size=(20, 11)).round(6)
    numbers[5:8, :8] = np.nan  # the body was occluded
    cells = [["" if np.isnan(value) else f"{value:.6f}" for value in row] for row in numbers]
    rows = [",".join([str(n), f"{n / 100:.6f}", *row]) + ",,," * (n % 2) for n, row in enumerate(cells)]  # Motive is not strict
    (tmp_path / "take.csv").write_text(MOTIVE.replace("{parent}", parent) + "\n".join(rows) + "\n")
    log = open_log(tmp_path / "take.csv")
    assert log.format == "Motive CSV"
    assert "Length Units: Millimeters" in log.notes[0]
    (stream,) = log.takes[0].streams.values()
    assert [name for name in stream.fields if name.startswith("Tip")] == [
        *(f"Tip.rotation.{axis}" for axis in "xyzw"), *(f"Tip.position.{axis}" for axis in "xyz"), "Tip.mean_marker_error",
    ]  # fmt: skip
    np.testing.assert_array_equal(stream.fields["Tip.rotation.w"].values, numbers[:, 3])
    changes = ('(quantity = "tip_x", role = )"output"', r'\1"input"')
    recording = imported(tmp_path / "take.csv", tmp_path / "set", changes)
    for n, axis in enumerate("xyz"):
        np.testing.assert_allclose(recording.trials[0].values[f"tip_{axis}"], numbers[:, 4 + n] / 1000, rtol=1e-12)
        np.testing.assert_allclose(recording.trials[0].values[f"marker_2_{axis}"], numbers[:, 8 + n] / 1000, rtol=1e-12)
    np.testing.assert_allclose(recording.trials[0].time, np.arange(20) / 100, rtol=1e-12)


def test_a_lerobot_dataset_comes_out_as_the_same_numbers_with_a_trial_an_episode(tmp_path: Path) -> None:
    true = write_lerobot(tmp_path / "dataset")
    recording = imported(tmp_path / "dataset", tmp_path / "set", ('unit = "[?]"', 'unit = "rad"'))
    assert [trial.label for trial in recording.trials] == ["episode_0", "episode_1"]
    assert [trial.start for trial in recording.trials] == [None, None]
    for trial, rows in zip(recording.trials, (slice(0, 40), slice(40, 70)), strict=True):
        np.testing.assert_allclose(trial.time, np.arange(len(trial.time)) / 50, rtol=1e-12)
        for n, joint in enumerate(("shoulder_pan", "elbow_flex")):
            np.testing.assert_allclose(trial.values[f"joint.{joint}.position"], true["state"][rows, n], rtol=1e-12)
            np.testing.assert_allclose(trial.values[f"actuator.{joint}.ctrl"], true["action"][rows, n], rtol=1e-12)
    assert "observation.images.top" in " ".join(open_log(tmp_path / "dataset").notes)


def test_a_dataset_that_lerobot_wrote_comes_out_as_the_same_numbers(tmp_path: Path) -> None:
    """Written once by lerobot 0.4.4 (create, add_frame, save_episode), 3 episodes of 20 frames; its numbers are these draws."""
    rng = np.random.default_rng(0)
    true = np.array([[rng.normal(size=2), rng.normal(size=2)] for _ in range(60)]).astype(np.float32).reshape(60, 4)
    recording = imported(WRITTEN_BY_LEROBOT, tmp_path / "set", ('unit = "[?]"', 'unit = "rad"'))
    assert [len(trial.time) for trial in recording.trials] == [20, 20, 20]
    np.testing.assert_allclose(recording.trials[2].time, np.arange(20) / 30, atol=1e-12)
    names = ("joint.shoulder_pan.position", "joint.elbow_flex.position", "actuator.shoulder_pan.ctrl", "actuator.elbow_flex.ctrl")
    for n, name in enumerate(names):
        np.testing.assert_array_equal(np.concatenate([trial.values[name] for trial in recording.trials]), true[:, n])


def test_broken_lerobot_datasets_are_refused(tmp_path: Path) -> None:
    write_lerobot(tmp_path / "dataset")
    next((tmp_path / "dataset/data").rglob("*.parquet")).unlink()
    with pytest.raises(DataError, match="download the data"):
        open_log(tmp_path / "dataset")
    (tmp_path / "dataset/meta/info.json").write_text("{")
    with pytest.raises(DataError, match="no LeRobot info"):
        open_log(tmp_path / "dataset")


def test_tables_in_a_folder_are_paired_by_their_names_and_joined_by_a_counter(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    for run, lost in (("1", 3), ("2", 5)):
        kept = [n for n in range(10) if n != lost]
        (folder / f"commands_{run}.csv").write_text("ID,u1\n" + "".join(f"{n},{n}.5\n" for n in range(10)))
        (folder / f"seen_{run}.csv").write_text("ID,x1\n" + "".join(f"{n},{run}{n}\n" for n in kept))
    (folder / "README.md").write_text("about\n")
    changes = (
        (r'# (\{ stream = "commands", field = "u1", quantity = )"\?"(.*)"\?"', r'\1"tendon_1_tension"\2"N"'),
        ('rate = "[?]"', 'rate = "100 Hz"'), (NEWTON[0], 'unit = "m"'),
    )  # fmt: skip
    recording = imported(folder, tmp_path / "set", *changes)
    assert [trial.label for trial in recording.trials] == ["1", "2"]
    time, values = readings(recording, "marker_1_x", trial=1)
    np.testing.assert_allclose(time, [n / 100 for n in range(10) if n != 5], rtol=1e-12)
    np.testing.assert_allclose(values, [20 + n for n in range(10) if n != 5])
    assert recording.trials[0].values["tendon_1_tension"].tolist() == [n + 0.5 for n in range(10)]
