"""Sets as MCAP, LeRobot and Parquet, read by the libraries of their makers, and back as the same numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from tests.measurements.logs.sample_logs import imported, readings
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial, read
from twin.measurements.logs.export import write_lerobot, write_mcap, write_parquet

CHANNELS = (
    Channel("tendon_1_tension", "input", "N"),
    Channel("joint.elbow.position", "output", "deg"),
    Channel("joint.elbow.velocity", "output", "rad/s"),
    *(Channel(f"disk_2_{axis}", "output", "mm") for axis in "xyz"),
    Channel("ambient_temperature", "context", "degC"),
)


def recording(empty: bool = False, starts: tuple[float | None, ...] = (None, None)) -> Recording:
    rng = np.random.default_rng(6)
    trials = []
    for number, start in enumerate(starts, start=1):
        values = {channel.name: 300.0 + rng.normal(size=25) for channel in CHANNELS}
        if empty:
            values["disk_2_x"][3] = values["disk_2_y"][3] = values["disk_2_z"][3] = np.nan
        trials.append(Trial(f"run_{number}.csv", np.arange(25) / 50, values, start=start))
    return Recording("continuum", "Bench", "simulation: rollout", None, CHANNELS, tuple(trials))


def test_mcap_is_read_by_the_makers_library(tmp_path: Path) -> None:
    write_mcap(recording(empty=True), tmp_path / "a.mcap")
    true = recording(empty=True).trials[0]
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [(channel.topic, message.log_time, decoded) for _, channel, message, decoded in reader.iter_decoded_messages()]
        metadata = {each.name: each.metadata for each in reader.iter_metadata()}
    points = [decoded.point for topic, _, decoded in messages if topic == "/output/disk_2"]
    assert len(points) == 2 * 24  # the empty rows are no messages
    assert (points[0].x, points[0].y) == (true.values["disk_2_x"][0], true.values["disk_2_y"][0])
    joints = [decoded for topic, _, decoded in messages if topic == "/output/joint_states"]
    assert joints[0].name == ["elbow"]
    assert list(joints[7].position) == [true.values["joint.elbow.position"][7]]
    assert list(joints[7].velocity) == [true.values["joint.elbow.velocity"][7]]
    assert [decoded.data for topic, _, decoded in messages if topic == "/trial"] == ["run_1", "run_2"]
    stamps = [(stamp, decoded.header.stamp) for topic, stamp, decoded in messages if topic == "/output/joint_states"]
    assert all(stamp == at.sec * 10**9 + at.nanosec for stamp, at in stamps)
    assert metadata["twin-measurements"]["robot"] == "continuum"
    assert json.loads(metadata["twin-measurements"]["channels"])["disk_2_x"] == ["/output/disk_2", "disk_2_x", "m"]


def test_mcap_is_read_by_rosbags_too(tmp_path: Path) -> None:
    write_mcap(recording(), tmp_path / "a.mcap")
    with AnyReader([tmp_path / "a.mcap"]) as bag:
        values = [bag.deserialize(data, link.msgtype).data for link, _, data in bag.messages() if link.topic.endswith("tension")]
    true = np.concatenate([trial.values["tendon_1_tension"] for trial in recording().trials])
    np.testing.assert_array_equal(values, true)


@pytest.mark.parametrize("starts", [(None, None), (0.0, 10.0), (0.0, 0.1)])
def test_mcap_comes_back_as_the_same_numbers(tmp_path: Path, starts: tuple[float | None, ...]) -> None:
    true = recording(empty=True, starts=starts)
    write_mcap(true, tmp_path / "a.mcap")
    cut = (r"# cut = \{ gap(?s:.*?)\n", 'cut = { stream = "/trial" }\n')
    velocity = (r'# (\{[^}]*field = "velocity)', r"\1")
    again = imported(tmp_path / "a.mcap", tmp_path / "set", cut, velocity)
    assert [trial.label.removeprefix("a_") for trial in again.trials] == ["run_1", "run_2"]
    for number, trial in enumerate(true.trials):
        for channel in CHANNELS:
            has = np.isfinite(trial.values[channel.name])
            time, values = readings(again, channel.name, number)
            np.testing.assert_allclose(time, trial.time[has], rtol=1e-12)
            np.testing.assert_allclose(values, trial.values[channel.name][has], rtol=1e-12)


def test_lerobot_follows_the_documented_layout_and_comes_back(tmp_path: Path) -> None:
    true = recording()
    write_lerobot(true, tmp_path / "dataset")
    info = json.loads((tmp_path / "dataset/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"], info["total_frames"]) == ("v3.0", 50, 2, 50)
    assert info["features"]["observation.state"]["shape"] == [5]
    assert info["features"]["action"] == {"dtype": "float64", "shape": [1], "names": ["tendon_1_tension"]}
    frames = pyarrow.parquet.read_table(tmp_path / "dataset" / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(frames.column_names) == set(info["features"])
    assert frames["frame_index"].to_pylist() == [*range(25), *range(25)]
    assert str(frames.schema.field("timestamp").type) == "float"
    assert str(frames.schema.field("action").type) == "double"  # a feature of one entry is a plain number there
    state = np.array(frames["observation.state"].to_pylist())
    np.testing.assert_array_equal(state[25:, 0], true.trials[1].values["joint.elbow.position"])
    episodes = pyarrow.parquet.read_table(tmp_path / "dataset/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(e["dataset_from_index"], e["dataset_to_index"], e["length"]) for e in episodes] == [(0, 25, 25), (25, 50, 25)]
    tasks = pyarrow.parquet.read_table(tmp_path / "dataset/meta/tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "task": "Bench"}]
    stats = json.loads((tmp_path / "dataset/meta/stats.json").read_text())
    np.testing.assert_allclose(stats["observation.state"]["mean"], state.mean(axis=0), rtol=1e-12)

    units = [(rf'(quantity = "{c.means}", role = "[^"]*", unit = )"[?]"', rf'\1"{c.si_unit}"') for c in CHANNELS]
    again = imported(tmp_path / "dataset", tmp_path / "set", *units)
    for number, trial in enumerate(true.trials):
        np.testing.assert_allclose(again.trials[number].time, trial.time, rtol=1e-12)
        for channel in CHANNELS:
            np.testing.assert_allclose(again.trials[number].values[channel.name], trial.values[channel.name], rtol=1e-12)
    assert [c.role for c in sorted(again.channels, key=lambda c: c.name)] == [
        c.role for c in sorted(CHANNELS, key=lambda c: c.name)
    ]


def test_lerobot_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="1 empty cells in disk_2_x; LeRobot has none"):
        write_lerobot(recording(empty=True), tmp_path / "dataset")
    one = recording().trials[0]
    uneven = replace(recording(), trials=(replace(one, time=np.cumsum(np.linspace(0.01, 0.02, 25))),))
    with pytest.raises(DataError, match="off an even rate of"):
        write_lerobot(uneven, tmp_path / "dataset")
    assert not list(tmp_path.iterdir())


def test_lerobot_is_resampled_where_a_rate_is_given(tmp_path: Path) -> None:
    time = np.array([0.0, 0.1, 0.25, 0.3, 0.55, 0.6])
    channels = (Channel("tendon_1_tension", "input", "N"), Channel("tip_x", "output", "m"))
    values = {"tendon_1_tension": np.array([1.0, np.nan, 2.0, 3.0, np.nan, np.nan]), "tip_x": np.array([np.nan, 1, 2.5, 3, 5.5, 6])}
    uneven = Recording("continuum", "", "hardware", None, channels, (Trial("a.csv", time, values),))
    write_lerobot(uneven, tmp_path / "dataset", rate=10.0)
    frames = pyarrow.parquet.read_table(tmp_path / "dataset/data/chunk-000/file-000.parquet")
    np.testing.assert_allclose(frames["action"].to_pylist(), [1, 1, 3, 3, 3, 3])  # from 0.1 s, where both have readings
    np.testing.assert_allclose(frames["observation.state"].to_pylist(), [1, 2, 3, 4, 5, 6], rtol=1e-12)  # x = 10 t
    for rate, said in ((0.0, "a positive rate"), (1e9, "fewer than")):
        with pytest.raises(DataError, match=said):
            write_lerobot(uneven, tmp_path / "other", rate=rate)


def test_parquet_is_a_set_that_pyarrow_reads(tmp_path: Path) -> None:
    write_parquet(recording(empty=True), tmp_path / "set")
    table = pyarrow.parquet.read_table(tmp_path / "set/run_1.parquet")
    assert table.column_names == ["time", *(channel.name for channel in CHANNELS)]
    for true, found in zip(recording(empty=True).trials, read(tmp_path / "set").trials, strict=True):
        for channel in CHANNELS:
            np.testing.assert_allclose(found.values[channel.name], true.values[channel.name], rtol=1e-15)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    for write, target in ((write_mcap, tmp_path / "a.mcap"), (write_lerobot, tmp_path / "a"), (write_parquet, tmp_path / "b")):
        write(recording(), target)
        with pytest.raises(DataError, match="not overwritten"):
            write(recording(), target)
    assert not list(tmp_path.glob(".*"))
