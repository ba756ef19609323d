"""From log and map to a set: cuts, equal and backward stamps, clocks that do not fit, and lines that only the user can fill in."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.measurements.logs.sample_logs import T0, filled_in, imported, readings, write_mcap
from twin.foundation.errors import DataError
from twin.measurements.logs import assemble, open_log, read_map

HEADER = "time,tendon_1_tension [N],tip_x [mm],trial,name\n"
KNOWN = ('role = "[?]"', 'role = "input"')


def table(path: Path, times: list[float], marks: list[int] | None = None, names: list[str] | None = None) -> Path:
    marks, names = marks or [0] * len(times), names or ["run"] * len(times)
    rows = (f"{t!r},{n},{n / 7!r},{mark},{name}\n" for n, (t, mark, name) in enumerate(zip(times, marks, names, strict=True)))
    path.write_text(HEADER + "".join(rows))
    return path


def cut(text: str) -> tuple[str, str]:
    return r"# cut = \{ gap(?s:.*?)\n", f"cut = {text}\n"


def refusal(log: Path, *changes: tuple[str, str]) -> str:
    map_path = filled_in(log, log.parent / "m.toml", *changes)
    with pytest.raises(DataError) as fault:
        assemble(open_log(log), read_map(map_path))
    assert "\n" not in str(fault.value)
    return str(fault.value)


def test_trials_end_at_pauses(tmp_path: Path) -> None:
    times = [0.0, 0.1, 0.2, 0.3, 5.0, 5.1, 5.2, 5.3, 5.4]
    recording = imported(table(tmp_path / "a.csv", times), tmp_path / "set", KNOWN, cut('{ gap = "1 s" }'))
    assert [trial.label for trial in recording.trials] == ["a_1", "a_2"]
    assert [trial.start for trial in recording.trials] == [0.0, 5.0]
    np.testing.assert_allclose(recording.trials[1].time, [0.0, 0.1, 0.2, 0.3, 0.4], rtol=1e-12)
    np.testing.assert_allclose(recording.trials[1].values["tip_x"], np.arange(4, 9) / 7000, rtol=1e-12)


def test_trials_end_where_a_mark_changes(tmp_path: Path) -> None:
    times = [n / 10 for n in range(12)]
    log = table(tmp_path / "a.csv", times, [0] * 3 + [1] * 4 + [0] + [2] * 4, ["up"] * 6 + ["down"] * 6)
    recording = imported(log, tmp_path / "numbers", KNOWN, cut('{ stream = "a", field = "trial" }'))
    assert [trial.label for trial in recording.trials] == ["a_0", "a_1", "a_2"]  # a piece of one row is left out
    assert [len(trial.time) for trial in recording.trials] == [3, 4, 4]
    recording = imported(log, tmp_path / "texts", KNOWN, cut('{ stream = "a", field = "name" }'))
    assert [trial.label for trial in recording.trials] == ["a_up", "a_down"]
    recording = imported(log, tmp_path / "only", KNOWN, cut('{ stream = "a", field = "trial", only = 1 }'))
    assert [(trial.label, len(trial.time)) for trial in recording.trials] == [("a", 4)]
    assert "has no field" in refusal(log, KNOWN, cut('{ stream = "a", field = "lap" }'))
    assert "never 'sideways'" in refusal(log, KNOWN, cut('{ stream = "a", field = "name", only = "sideways" }'))


def test_equal_stamps_are_refused_unless_the_map_says_what_to_do(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", [0.0, 0.1, 0.1, 0.2, 0.3])
    said = refusal(log, KNOWN)
    assert "1 stamps stand on several rows" in said
    assert 'equal_stamps = "mean"' in said
    for how, value in (("mean", 1.5), ("first", 1.0)):
        as_told = ('time_unit = "s" }', f'time_unit = "s", equal_stamps = "{how}" }}')
        recording = imported(log, tmp_path / how, KNOWN, as_told)
        assert recording.trials[0].values["tendon_1_tension"].tolist() == [0.0, value, 3.0, 4.0]


def test_backward_stamps_are_refused_unless_the_map_says_what_to_do(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", [0.0, 0.1, 0.2, 0.05, 0.15, 0.25])
    said = refusal(log, KNOWN)
    assert "stamps go back 1 times, first by 0.15 s in row 4" in said
    for how, counts in (("sort", [6]), ("cut", [3, 3])):
        as_told = ('time_unit = "s" }', f'time_unit = "s", backward_stamps = "{how}" }}')
        recording = imported(log, tmp_path / how, KNOWN, as_told)
        assert [len(trial.time) for trial in recording.trials] == counts


def test_streams_on_different_clocks_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "a.csv").write_text("time,tendon_1_tension [N]\n" + "".join(f"{1726041600 + n / 10},{n}\n" for n in range(9)))
    (folder / "b.csv").write_text("time,tip_x [mm]\n" + "".join(f"{n / 10},{n}\n" for n in range(9)))
    said = refusal(folder, KNOWN)
    assert "a and b share no time" in said
    assert "offset" in said


def test_a_table_beside_a_bag_is_aligned_by_an_offset(tmp_path: Path) -> None:
    folder = tmp_path / "day"
    folder.mkdir()
    write_mcap(folder / "a.mcap")
    (folder / "cells.csv").write_text("time,tendon_2_tension [N]\n" + "".join(f"{n / 100},{n / 7!r}\n" for n in range(50)))
    newton = ('unit = "[?]"', 'unit = "N"')
    assert "share no time" in refusal(folder, newton, KNOWN)
    moved = ('clock = "time", time_unit = "s"', f'clock = "time", time_unit = "s", offset = "{T0 / 1e9 + 0.25:.2f} s"')
    recording = imported(folder, tmp_path / "set", newton, KNOWN, moved)
    time, values = readings(recording, "tendon_2_tension")
    np.testing.assert_allclose(time, 0.25 + np.arange(50) / 100, atol=3e-7)  # what a float holds of seconds since 1970
    np.testing.assert_allclose(values, np.arange(50) / 7, rtol=1e-12)


def test_close_stamps_of_two_streams_are_one_row(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "a.csv").write_text("time,tendon_1_tension [N]\n" + "".join(f"{n / 10},{n}\n" for n in range(5)))
    (folder / "b.csv").write_text("time,tip_x [mm]\n" + "".join(f"{n / 10 + 4e-7!r},{n}\n" for n in range(5)))
    recording = imported(folder, tmp_path / "set", KNOWN)
    assert len(recording.trials[0].time) == 5


def test_lines_to_fill_in_are_named_by_their_numbers(tmp_path: Path) -> None:
    log = write_mcap(tmp_path / "a.mcap")
    map_path = filled_in(log, tmp_path / "m.toml")
    lines = map_path.read_text().split("\n")
    number = next(n for n, line in enumerate(lines, start=1) if 'unit = "?"' in line and not line.strip().startswith("#"))
    with pytest.raises(DataError, match=rf"m\.toml: line {number}, data of /tendon_1/tension_cmd: unit = \"\?\""):
        read_map(map_path)
    map_path.write_text(map_path.read_text().replace('robot = "continuum"', 'robot = "?"'))
    with pytest.raises(DataError, match=r"2 things are wrong: .*robot = \"\?\"; fill in a robot's name"):
        read_map(map_path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('quantity = "tip_x"', 'quantity = "tip_q"'), r"line \d+, tip_x \[mm\] of a: 'tip_q' is no channel name; allowed"),
        (('unit = "mm"', 'unit = "kg"'), r"line \d+, .*wrong dimension"),
        (('role = "output"', 'role = "sink"'), r"line \d+, .*allowed: input, output, context"),
        (('role = "output"', 'role = "input"'), "no output channel"),
        (('field = "tip_x', 'field = "nose'), "has no field 'nose"),
        (('clock = "time"', 'clock = "wall"'), "a has no clock 'wall'; allowed: row, time"),
        (('stream = "a", field = "tip_x', 'stream = "b", field = "tip_x'), "the log has no stream 'b'"),
        (('format = "twin-import/1"', 'format = "x"'), "a map begins with format"),
        (('time_unit = "s"', 'time_unit = "min"'), "time_unit is 'min'"),
        (('time_unit = "s"', 'rate = "-5 Hz"'), "not positive"),
        (('quantity = "tip_x"', 'quantity = "tip_x", name = "a,b"'), "no column's"),
        (('quantity = "tip_x"', 'quantity = "tip_x", colour = "red"'), "no key 'colour' is known"),
        (("channel = \\[\n", "channel = [[\n"), "not TOML"),
    ],
)  # fmt: skip
def test_a_wrong_map_is_refused_in_one_line(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    log = table(tmp_path / "a.csv", [0.0, 0.1, 0.2])
    found = refusal(log, KNOWN, change)
    assert re.search(said, found), found
    assert "m.toml" in found


def test_scale_offset_and_noise_go_into_the_set(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", [0.0, 0.1, 0.2])
    turned = ('quantity = "tip_x"', 'quantity = "tip_y", name = "up", scale = -1, offset = 2.0, noise = 0.5')
    recording = imported(log, tmp_path / "set", KNOWN, turned)
    channel = recording.channels[1]
    assert (channel.name, channel.means, channel.factor, channel.offset, channel.noise) == ("up", "tip_y", -1.0, 2.0, 5e-4)
    np.testing.assert_allclose(recording.trials[0].values["up"], (2.0 - np.arange(3) / 7) / 1000, rtol=1e-12)
    file = np.genfromtxt(tmp_path / "set/a.csv", delimiter=",", names=True)
    np.testing.assert_allclose(file["up"], np.arange(3) / 7, rtol=1e-12, atol=1e-15)  # the file holds the log's own numbers


def test_infinite_readings_and_wild_names_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "a b+c.csv"
    path.write_text("time,tendon_1_tension [N],tip_x [mm]\n0,1,inf\n0.1,2,5\n0.2,3,-inf\n0.3,3,6\n")
    recording = imported(path, tmp_path / "set", KNOWN)
    assert recording.trials[0].label == "a_b_c"
    np.testing.assert_allclose(recording.trials[0].values["tip_x"], [np.nan, 0.005, np.nan, 0.006])


def test_a_continuous_log_is_cut_into_trials_of_a_length(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", [0.1 * k for k in range(10)])
    recording = imported(log, tmp_path / "set", KNOWN, cut('{ every = "0.4 s" }'))
    assert [len(trial.time) for trial in recording.trials] == [4, 4]  # the last two rows are too few
    assert [trial.start for trial in recording.trials] == pytest.approx([0.0, 0.4])
    said = refusal(log, KNOWN, cut('{ every = "0.4 s", gap = "1 s" }'))
    assert "give one of gap" in said
    assert "no time" in refusal(log, KNOWN, cut('{ every = "-1 s" }'))
