"""A set in order: SI units, read-only arrays, gaps kept, and a notice for everything a reader should know."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest
from measurement_sets import CSV, edit, write_set

from twin.foundation import files as bounds
from twin.foundation.errors import DataError, UnknownNameError
from twin.measurements import Channel, Clouds, Recording, Trial, read

GRAM_FORCE = 9.80665e-3  # N, by definition


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_set(tmp_path / "set")


def test_units_become_si(folder: Path) -> None:
    recording = read(folder)
    first = recording.trials[0]
    tension = [0, 100 * GRAM_FORCE, 200 * GRAM_FORCE, 300 * GRAM_FORCE]
    assert first.values["tendon_1_tension"].tolist() == pytest.approx(tension, rel=1e-15)
    assert first.values["tip_x"][:2].tolist() == [0.0001, 0.0012]
    assert first.values["ambient_temperature"].tolist() == [296.15, 296.15, 296.15, 296.65]
    assert first.values["sma_1_current"].tolist() == [0.0, 0.003, 0.25, 0.5]
    assert first.conditions["tip_payload"] == 0.01
    noise = {channel.name: channel.noise for channel in recording.channels}
    assert noise["tendon_1_tension"] == pytest.approx(2 * GRAM_FORCE, rel=1e-15)
    assert noise["tip_x"] == 0.00025
    assert noise["ambient_temperature"] == 0.5  # a difference: no 273.15
    assert noise["sma_1_current"] is None


def test_what_the_toml_says_is_kept(folder: Path) -> None:
    recording = read(folder)
    assert (recording.robot, recording.title, recording.source) == ("continuum", "Bench test", "hardware")
    assert recording.gravity is not None
    assert recording.gravity.tolist() == [-9.81, 0.0, 0.0]
    assert [trial.start for trial in recording.trials] == [0.0, 60.0]
    assert [trial.label for trial in recording.trials] == ["a", "b"]
    assert recording.folder == folder
    assert recording.n_samples == 8
    assert [channel.name for channel in recording.inputs()] == ["tendon_1_tension"]
    assert [channel.name for channel in recording.outputs()] == ["tip_x"]
    assert [channel.name for channel in recording.contexts()] == ["ambient_temperature", "sma_1_current"]
    assert recording.notices == ()


def test_missing_values_stay_missing(folder: Path) -> None:
    assert np.isnan(read(folder).trials[0].values["tip_x"]).tolist() == [False, False, True, True]


def test_everything_is_read_only(folder: Path) -> None:
    for recording in (read(folder), pickle.loads(pickle.dumps(read(folder))), copy.deepcopy(read(folder))):
        trial = recording.trials[0]
        clouds = trial.clouds
        assert clouds is not None
        for array in (recording.gravity, trial.time, *trial.values.values(), clouds.points, clouds.offsets, clouds.time):
            assert array is not None
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        with pytest.raises(TypeError):
            trial.values["tip_x"] = trial.time  # type: ignore[index]


def test_a_recording_does_not_follow_the_callers_array() -> None:
    mine = np.array([1.0, 2.0, 3.0])
    trial = Trial("a.csv", np.arange(3.0), {"tip_x": mine})
    mine[0] = 99.0
    assert trial.values["tip_x"][0] == 1.0


def test_byte_order_mark_and_other_line_ends(folder: Path) -> None:
    plain = read(folder).data_hash()
    (folder / "a.csv").write_bytes(b"\xef\xbb\xbf" + CSV.replace("\n", "\r\n").encode())
    (folder / "b.csv").write_bytes(CSV.replace("\n", "\r").encode())
    toml = folder / "measurements.toml"
    toml.write_bytes(b"\xef\xbb\xbf" + toml.read_bytes().replace(b"\n", b"\r\n"))
    assert read(folder).data_hash() == plain


def test_quoted_and_spaced_cells_are_the_same_numbers(folder: Path) -> None:
    plain = read(folder).data_hash()
    quoted = "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in CSV.splitlines())
    (folder / "a.csv").write_text(quoted)
    (folder / "b.csv").write_text(CSV.replace(",", " , ").replace("NaN", "nan"))
    assert read(folder).data_hash() == plain


def test_the_toml_itself_and_a_trial_without_ending_are_found(folder: Path) -> None:
    plain = read(folder).data_hash()
    edit(folder / "measurements.toml", '"b.csv"', '"b"')
    assert read(folder / "measurements.toml").data_hash() == plain


CONDITIONS = {
    'tip_force = "[0, 0, 100] mN"': ("tip_force", [0.0, 0.0, 0.1]),
    'tip_force = ["0 N", "10 gf", 0.5]': ("tip_force", [0.0, 10 * GRAM_FORCE, 0.5]),
    "gravity = [0, 0, -9.81]": ("gravity", [0.0, 0.0, -9.81]),
    'ambient_temperature = "25 degC"': ("ambient_temperature", 298.15),
    'ambient_temperature = "298 K"': ("ambient_temperature", 298.0),
    'tip_payload = "0.5oz"': ("tip_payload", 0.5 * 0.028349523125),
}


@pytest.mark.parametrize("line", CONDITIONS)
def test_conditions_become_si(folder: Path, line: str) -> None:
    name, expected = CONDITIONS[line]
    edit(folder / "measurements.toml", "start = 60", line)
    trial = read(folder).trials[1]
    np.testing.assert_allclose(trial.conditions[name], expected, rtol=1e-15, atol=0)
    assert trial.start is None


NOTICES = {
    "unknown condition": ("measurements.toml", "start = 60", 'wind = "3 m/s"', ["'wind'", "b.csv", "not understood"]),
    "other source": ("measurements.toml", '"hardware"', '"bench"', ["'bench'", "hardware", "simulation"]),
    "input gap": ("a.csv", "0.2,200,", "0.2,,", ["tendon_1_tension", "1 values", "a.csv"]),
    "short trial": ("b.csv", CSV, "\n".join(CSV.splitlines()[:3]), ["b.csv", "left out", "2 samples"]),
}


@pytest.mark.parametrize("name", NOTICES)
def test_notices_name_what_was_found(folder: Path, name: str) -> None:
    file, old, new, expected = NOTICES[name]
    edit(folder / file, old, new)
    (notice,) = read(folder, least_trials=1).notices
    assert all(part in notice for part in expected), notice


def test_undeclared_columns_are_named(folder: Path) -> None:
    rows = CSV.splitlines()
    (folder / "b.csv").write_text("\n".join([rows[0] + ",remark", *(row + ",fine" for row in rows[1:])]))
    (notice,) = read(folder).notices
    assert "'remark'" in notice
    assert "b.csv" in notice


def test_a_channel_empty_in_one_trial_is_named(folder: Path) -> None:
    (folder / "b.csv").write_text(CSV.replace(",23,", ",,").replace(",23.5,", ",,"))
    recording = read(folder)
    assert recording.notices == ("context ambient_temperature has no value in b.csv",)
    assert np.all(np.isnan(recording.trials[1].values["ambient_temperature"]))


def test_a_tension_below_zero_is_read_since_rods_push(folder: Path) -> None:
    edit(folder / "a.csv", "0.0,0,", "0.0,-900,")
    assert read(folder).trials[0].values["tendon_1_tension"][0] == pytest.approx(-900 * GRAM_FORCE)
    assert read(folder).notices == ()


def test_a_file_over_the_limit_is_not_read(folder: Path) -> None:
    with (folder / "a.csv").open("wb") as sparse:
        sparse.truncate(bounds.MAX_TRIAL_BYTES + 1)
    with pytest.raises(DataError, match=r"a\.csv: 100663297 bytes; at most"):
        read(folder)


def test_select_and_with_values(folder: Path) -> None:
    recording = read(folder)
    assert [trial.name for trial in recording.select(["b", 0, "a.csv", -1]).trials] == ["b.csv", "a.csv", "a.csv", "b.csv"]
    for absent in ("c", 2, -3):
        with pytest.raises(UnknownNameError, match="a, b"):
            recording.select([absent])
    predicted = recording.with_values([{"tip_x": np.full(4, 0.5)}] * 2, "simulation: twin")
    assert predicted.source == "simulation: twin"
    assert predicted.channels == recording.channels
    assert predicted.trials[1].values["tip_x"].tolist() == [0.5] * 4
    assert predicted.trials[1].values["tendon_1_tension"] is recording.trials[1].values["tendon_1_tension"]
    assert recording.trials[1].values["tip_x"][0] == 0.0001
    with pytest.raises(UnknownNameError, match="tip_y"):
        recording.with_values([{"tip_y": np.zeros(4)}] * 2, "simulation")
    with pytest.raises(DataError, match="1 trials"):
        recording.with_values([{}], "simulation")


def test_the_hash_follows_the_data_and_nothing_else(folder: Path) -> None:
    plain = read(folder).data_hash()
    edit(folder / "measurements.toml", "Bench test", "Another title")
    assert read(folder).data_hash() == plain
    for file, old, new in [
        ("a.csv", "0.1,100,1.2", "0.1,100,1.3"),
        ("b.csv", "0.3,300,NaN", "0.3,300,0"),
        ("measurements.toml", '"10 g"', '"11 g"'),
        ("measurements.toml", "start = 60", "start = 61"),
        ("measurements.toml", "noise = 0.25", "noise = 0.26"),
        ("measurements.toml", "-9.81", "9.81"),
    ]:
        edit(folder / file, old, new)
        assert read(folder).data_hash() != plain
        edit(folder / file, new, old)
    (folder / "b.csv").rename(folder / "c.csv")
    edit(folder / "measurements.toml", '"b.csv"', '"c.csv"')
    assert read(folder).data_hash() != plain
    edit(folder / "measurements.toml", '"c.csv"', '"b.csv"')
    (folder / "c.csv").rename(folder / "b.csv")
    assert read(folder).data_hash() == plain


CHANNEL = Channel("tip_x", "output", "m")
GOOD = Trial("a.csv", np.arange(3.0), {"tip_x": np.zeros(3)})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Trial("a.csv", np.array([0.0, 0.0]), {}), "strictly increasing"),
        (lambda: Trial("a.csv", np.arange(3.0), {"tip_x": np.zeros(2)}), r"shape \(2,\)"),
        (lambda: Clouds(np.zeros((2, 3)), np.array([0, 1]), np.array([0.0])), "offsets"),
        (lambda: Recording("r", "", "", None, (CHANNEL, CHANNEL), (GOOD,)), "tip_x is declared twice"),
        (lambda: Recording("r", "", "", None, (), (GOOD,)), "differ in tip_x"),
        (lambda: Recording("r", "", "", np.array([1.0, 2.0]), (CHANNEL,), (GOOD,)), "three-vector"),
    ],
)
def test_types_refuse_what_does_not_fit(make: object, message: str) -> None:
    with pytest.raises(DataError, match=message):
        make()  # type: ignore[operator]
