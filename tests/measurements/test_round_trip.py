"""What is written is read back the same: values, gaps, conditions, clouds; and writing is whole or not at all."""

from __future__ import annotations

import tempfile
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measurement_sets import write_set

from twin.foundation.errors import DataError
from twin.measurements import Channel, Clouds, Recording, Trial, read, write
from twin.measurements.parsing.toml_text import toml_lines

FEW = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
UNITS = {
    "tendon_1_displacement": ["m", "mm", "inch", "µm"],
    "tip_x": ["m", "mm", "cm"],
    "ambient_temperature": ["K", "degC", "degF"],
    "sensor_1_resistance": ["ohm", "kohm", "mohm"],
}
NUMBERS = st.floats(-1e6, 1e6) | st.just(float("nan"))
TEXT = st.text(st.characters(codec="utf-8"), max_size=20)
WHEN = (st.datetimes() | st.times()).map(lambda moment: moment.replace(fold=0)) | st.dates()
PLAIN = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXT | WHEN,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=6,
)


@st.composite
def declared_values(draw: st.DrawFn) -> tuple[dict[str, str], list[dict[str, np.ndarray]]]:
    """Units of the channels, and two trials of readings in those units."""
    units = {name: draw(st.sampled_from(choice)) for name, choice in UNITS.items()}
    trials = []
    for _ in range(2):
        count = draw(st.integers(3, 6))
        steps = draw(st.lists(st.floats(1e-4, 1e3), min_size=count, max_size=count))
        columns = {name: np.array(draw(st.lists(NUMBERS, min_size=count, max_size=count))) for name in units}
        columns["ambient_temperature"] = np.abs(columns["ambient_temperature"])
        for column in columns.values():
            column[0] = 1.0
        trials.append({"time": np.cumsum(steps), **columns})
    return units, trials


def recorded(units: dict[str, str], trials: list[dict[str, np.ndarray]]) -> Recording:
    roles = ("input", "output", "context", "output")
    channels = tuple(Channel(name, role, unit, None) for (name, unit), role in zip(units.items(), roles, strict=True))
    made = tuple(
        Trial(f"{at}.csv", trial["time"], {channel.name: channel.scale.to_si(trial[channel.name]) for channel in channels})
        for at, trial in enumerate(trials)
    )
    return Recording("continuum", "t", "simulation", None, channels, made)


@FEW
@given(declared_values(), st.sampled_from(["csv", "parquet"]))
def test_readings_come_back_bit_for_bit(drawn: tuple, file_format: str) -> None:
    recording = recorded(*drawn)
    with tempfile.TemporaryDirectory() as place:
        write(recording, Path(place) / "set", file_format=file_format)  # type: ignore[arg-type]
        back = read(Path(place) / "set")
    assert back.channels == recording.channels
    for old, new in zip(recording.trials, back.trials, strict=True):
        np.testing.assert_array_equal(new.time, old.time)
        for name, column in old.values.items():
            np.testing.assert_array_equal(new.values[name], column)
    assert back.data_hash() == recording.data_hash()


@pytest.mark.parametrize(("name", "unit"), [(name, unit) for name, units in UNITS.items() for unit in units])
def test_every_reading_has_its_way_back(name: str, unit: str) -> None:
    scale = Channel(name, "output", unit).scale
    drawn = np.random.default_rng(0).uniform(-1e3, 1e3, 20_000)
    si = scale.to_si(drawn)
    np.testing.assert_array_equal(scale.to_si(scale.from_si(si)), si)
    short = np.round(drawn, 3)  # as a logger prints them: these come back digit for digit
    np.testing.assert_array_equal(scale.from_si(scale.to_si(short)), short)


@FEW
@given(
    st.fixed_dictionaries({"robot": TEXT.filter(str.strip), "title": TEXT, "source": TEXT}),
    st.dictionaries(TEXT.filter(lambda name: name not in ("file", "start", "cloud")), PLAIN, max_size=3),
    st.floats(0, 10),
    st.lists(st.floats(-10, 10), min_size=3, max_size=3),
)
def test_conditions_and_words_come_back(words: dict[str, str], other: dict[str, object], mass: float, force: list[float]) -> None:
    known = {
        "tip_payload": mass,
        "tip_force": np.array(force),
        "gravity": np.array([0.0, 0.0, 9.81]),
        "ambient_temperature": 296.15,
    }
    other = {name: value for name, value in other.items() if name not in known}
    channels = (Channel("tendon_1_tension", "input", "gf", 0.02), Channel("tip_x", "output", "mm", 2.5e-4))
    time = np.arange(3.0)
    clouds = Clouds(np.ones((2, 3)) / 3, np.array([0, 2]), np.array([0.1]))
    values = {"tendon_1_tension": time, "tip_x": time}
    trials = tuple(Trial(f"run/{at}.csv", time, values, known, other, 0.1 * at, clouds) for at in (1, 2))
    recording = Recording(**words, gravity=np.array(force), channels=channels, trials=trials)
    with tempfile.TemporaryDirectory() as place:
        write(recording, Path(place) / "set")
        back = read(Path(place) / "set")
    assert (back.robot, back.title, back.source) == (words["robot"], words["title"], words["source"])
    assert back.data_hash() == recording.data_hash()
    trial = back.trials[1]
    assert (trial.name, trial.start, dict(trial.other)) == ("run/2.csv", 0.2, other)
    assert trial.clouds is not None
    np.testing.assert_array_equal(trial.clouds.points, clouds.points)
    assert back.channels == channels
    assert all(any(repr(name) in notice for notice in back.notices) for name in other)


@given(st.dictionaries(TEXT, PLAIN, max_size=4))
def test_toml_text_is_toml(values: dict[str, object]) -> None:
    assert tomllib.loads("\n".join(toml_lines(values))) == values


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_a_set_read_and_written_is_the_same_set(tmp_path: Path, file_format: str) -> None:
    first = read(write_set(tmp_path / "set"))
    write(first, tmp_path / "again", file_format=file_format)  # type: ignore[arg-type]
    second = read(tmp_path / "again")
    assert second.data_hash() == first.data_hash()
    assert second.notices == first.notices
    assert [channel.unit for channel in second.channels] == ["gf", "mm", "degC", "mA"]


def test_written_numbers_are_in_the_declared_unit_and_short(tmp_path: Path) -> None:
    write(read(write_set(tmp_path / "set")), tmp_path / "again")
    rows = (tmp_path / "again" / "a.csv").read_text().splitlines()
    assert rows[1:] == ["0.0,0.0,0.1,23.0,0.0", "0.1,100.0,1.2,23.0,3.0", "0.2,200.0,,23.0,250.0", "0.3,300.0,,23.5,500.0"]


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    recording, before = read(folder), (folder / "a.csv").read_bytes()
    for taken in (folder, folder / "a.csv"):
        with pytest.raises(DataError, match="not overwritten"):
            write(recording, taken)
    assert (folder / "a.csv").read_bytes() == before
    (tmp_path / "empty").mkdir()
    write(recording, tmp_path / "empty")
    assert read(tmp_path / "empty").data_hash() == recording.data_hash()


def test_a_failed_write_leaves_nothing_behind(tmp_path: Path) -> None:
    recording = read(write_set(tmp_path / "set"))
    odd = Trial("odd.csv", recording.trials[0].time, recording.trials[0].values, other={"thing": object()})
    away = Trial("../away.csv", recording.trials[0].time, recording.trials[0].values)
    for bad, message in ((odd, "cannot be written as TOML"), (away, "leads out"), (recording.trials[0], "same name")):
        broken = Recording("r", "", "", None, recording.channels, (*recording.trials, bad))
        with pytest.raises(DataError, match=message):
            write(broken, tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set"]


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = read(write_set(tmp_path / "set"))

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)  # the last file of a trial
    with pytest.raises(DataError, match="No space left"):
        write(recording, tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set"]
