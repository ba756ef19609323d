"""MCAP, ROS 1 and ROS 2 bags, written by the libraries of their makers, come out as the same numbers."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer as PlainMcapWriter
from mcap_ros2.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.measurements.logs.sample_logs import (
    DELAY,
    JOINT_STATE,
    POINT,
    RULE,
    T0,
    command_numbers,
    imported,
    joint_numbers,
    point_numbers,
    readings,
    stamped,
    write_mcap,
    write_ros1_bag,
    write_ros2_bag,
)
from twin.foundation.errors import DataError
from twin.measurements.logs import map_text, open_log
from twin.measurements.logs.bags.messages import flatten

NEWTON = ('unit = "[?]"', 'unit = "N"')


def assert_same(found: np.ndarray, true: np.ndarray) -> None:
    np.testing.assert_allclose(found, true, rtol=1e-12, atol=1e-12)


def test_an_mcap_of_three_rates_comes_out_as_the_same_numbers(tmp_path: Path) -> None:
    recording = imported(write_mcap(tmp_path / "a.mcap"), tmp_path / "set", NEWTON)
    stamps, angles = joint_numbers()
    for n, joint in enumerate(("shoulder", "elbow")):
        time, values = readings(recording, f"joint.{joint}.position")
        assert_same(time, (stamps - T0) / 1e9)
        assert_same(values, angles[:, n])
    stamps, positions = point_numbers()
    for n, axis in enumerate("xyz"):
        time, values = readings(recording, f"tip_{axis}")
        assert_same(time, (stamps - T0) / 1e9)
        assert_same(values, positions[:, n])
    stamps, tensions = command_numbers()
    time, values = readings(recording, "tendon_1_tension")
    assert_same(time, (stamps + DELAY - T0) / 1e9)  # no header: when it was recorded
    assert_same(values, tensions)
    assert [channel.role for channel in recording.channels] == ["output"] * 5 + ["input"]


def test_clocks_that_differ_are_said(tmp_path: Path) -> None:
    text = map_text(open_log(write_mcap(tmp_path / "a.mcap")), "m.toml")
    assert 'name = "/joint_states", clock = "header.stamp"' in text
    assert "log time is later by 3 ms" in text
    assert 'name = "/tendon_1/tension_cmd", clock = "log time"' in text
    assert "the messages carry no header.stamp" in text


def test_headers_that_were_never_stamped_are_not_taken(tmp_path: Path) -> None:
    recording = imported(write_mcap(tmp_path / "a.mcap", header=False), tmp_path / "set", NEWTON)
    time, _ = readings(recording, "tip_x")
    assert_same(time, (point_numbers()[0] - T0) / 1e9)  # all by the recorder, equally late


def test_one_message_on_another_clock_does_not_cost_the_others_theirs(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file, McapWriter(file) as out:
        kind = out.register_msgdef("geometry_msgs/msg/PointStamped", POINT)
        for topic, shift, count in (
            ("/tip", 0, 20),
            ("/latched", -(10**13), 1),
            ("/other_machine", 10**12, 20),
            ("/unset", None, 20),
        ):
            for n in range(count):
                stamp = T0 + n * 10**7
                own = 0 if shift is None and n == 0 else stamp + (shift or 0)
                out.write_message(topic, kind, {"header": stamped(own), "point": {"x": 1.0, "y": 2.0, "z": 3.0}}, stamp, stamp)
    text = map_text(open_log(tmp_path / "a.mcap"), "m.toml")
    for topic, clock in (
        ("/tip", "header.stamp"),
        ("/latched", "log time"),
        ("/other_machine", "log time"),
        ("/unset", "log time"),
    ):
        assert f'name = "{topic}", clock = "{clock}"' in text
    assert "log time is later by -1000 s (90 % within -1000 s .. -1000 s): another clock" in text
    assert "header.stamp is not set in 1 of 20 messages" in text


def test_an_offset_moves_a_stream(tmp_path: Path) -> None:
    moved = ('clock = "log time", time_unit = "ns" }', 'clock = "log time", time_unit = "ns", offset = "-3 ms" }')
    recording = imported(write_mcap(tmp_path / "a.mcap"), tmp_path / "set", NEWTON, moved)
    time, _ = readings(recording, "tendon_1_tension")
    np.testing.assert_allclose(time, (command_numbers()[0] - T0) / 1e9, atol=2e-9)  # stamps are whole nanoseconds


def test_a_ros1_bag_comes_out_as_the_same_numbers(tmp_path: Path) -> None:
    recording = imported(write_ros1_bag(tmp_path / "a.bag"), tmp_path / "set", NEWTON)
    stamps, angles = joint_numbers()
    for n, joint in enumerate(("shoulder", "elbow")):
        time, values = readings(recording, f"joint.{joint}.position")
        assert_same(time, (stamps - T0) / 1e9)
        assert_same(values, angles[:, n])
    assert_same(readings(recording, "tendon_1_tension")[1], command_numbers()[1])


@pytest.mark.parametrize("version", [8, 9])
def test_a_ros2_bag_comes_out_as_the_same_numbers_with_a_stream_a_frame(tmp_path: Path, version: int) -> None:
    as_input = ('field = "position.elbow."(.*)role = "output"', r'field = "position[elbow]"\1role = "input"')
    recording = imported(write_ros2_bag(tmp_path / "bag", version), tmp_path / "set", as_input)
    stamps, angles = joint_numbers()
    for name, column in (("joint.shoulder.position", 0), ("tip_x", 0), ("joint.elbow.position", 1), ("disk_2_x", 1)):
        time, values = readings(recording, name)
        assert_same(time, (stamps - T0) / 1e9)
        assert_same(values, angles[:, column])


def test_a_truncated_mcap_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = write_mcap(tmp_path / "a.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    chunks = tmp_path / "chunks.mcap"
    with chunks.open("wb") as file, McapWriter(file, chunk_size=1000) as out:
        float64 = out.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for n in range(500):
            out.write_message("/x", float64, {"data": float(n)}, T0 + n * 10**7, T0 + n * 10**7)
    path.write_bytes(chunks.read_bytes()[: chunks.stat().st_size // 2])
    log = open_log(path)
    stream = log.takes[0].streams["/x"]
    assert 0 < stream.count < 500
    assert stream.fields["data"].values.tolist() == list(range(stream.count))
    assert "breaks off" in log.notes[0]
    path.write_bytes(whole[:2000])
    with pytest.raises(DataError, match=r"no message that can be read .*breaks off"):
        open_log(path)


def test_broken_bags_are_refused_in_one_line(tmp_path: Path) -> None:
    bag = write_ros1_bag(tmp_path / "a.bag")
    bag.write_bytes(bag.read_bytes()[:5000])
    with pytest.raises(DataError, match=r"cannot be read as a ROS 1 bag .*reindex"):
        open_log(bag)
    folder = write_ros2_bag(tmp_path / "bag")
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 5}\n")
    with pytest.raises(DataError, match=r"cannot be read as a ROS 2 bag .*reindex"):
        open_log(folder)


def test_a_bag_without_its_metadata_and_a_file_under_another_name_are_read(tmp_path: Path) -> None:
    folder = write_ros2_bag(tmp_path / "bag")
    (folder / "metadata.yaml").unlink()
    assert open_log(folder).takes[0].streams["/joint_states"].count == 200
    renamed = write_mcap(tmp_path / "a.mcap").rename(tmp_path / "a.csv")
    assert open_log(renamed).format == "MCAP"


def test_a_bag_without_definitions_is_read_by_those_that_ship_with_ros(tmp_path: Path) -> None:
    folder = write_ros2_bag(tmp_path / "bag")
    with sqlite3.connect(next(folder.glob("*.db3"))) as database:
        database.execute("DELETE FROM message_definitions")
    database.close()
    stream = open_log(folder).takes[0].streams["/joint_states"]
    assert_same(stream.fields["position[elbow]"].values, joint_numbers()[1][:, 1])


def test_json_in_mcap_is_read_and_other_encodings_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        out = PlainMcapWriter(file)
        out.start()
        schema = out.register_schema("Motor", "jsonschema", b"{}")
        json_topic = out.register_channel("/motor", "json", schema)
        proto = out.register_channel("/proto", "protobuf", out.register_schema("x.Y", "protobuf", b"abc"))
        for n in range(10):
            stamp = T0 + n * 10**8
            out.add_message(json_topic, stamp, json.dumps({"motor": {"angle": n / 3}, "on": True}).encode(), stamp)
            out.add_message(proto, stamp, b"\x08\x01", stamp)
        out.finish()
    log = open_log(path)
    stream = log.takes[0].streams["/motor"]
    assert stream.fields["motor.angle"].values.tolist() == [n / 3 for n in range(10)]
    assert "protobuf" in log.unread["/proto"]
    assert "not read: /proto" in map_text(log, "m.toml")


def test_two_publishers_on_one_topic_complement_each_other(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file, McapWriter(file) as out:
        kind = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for n in range(20):
            for name, value in (("arm", n / 7), ("finger", -n / 7)):
                message = {"header": stamped(T0 + n * 10**7), "name": [name], "position": [value], "velocity": [], "effort": []}
                out.write_message("/joint_states", kind, message, T0 + n * 10**7, T0 + n * 10**7)
    as_input = ("(finger.*)output", r"\1input")
    recording = imported(path, tmp_path / "set", as_input)
    trial = recording.trials[0]
    assert len(trial.time) == 20
    assert trial.values["joint.arm.position"].tolist() == [n / 7 for n in range(20)]
    assert trial.values["joint.finger.position"].tolist() == [-n / 7 for n in range(20)]


def test_messages_defined_in_idl_are_read(tmp_path: Path) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float64 angle\nfloat32[3] tension\n", "lab_msgs/msg/Status"))
    idl = (
        f"{RULE}\nIDL: lab_msgs/msg/Status\nmodule lab_msgs {{ module msg {{ typedef float float__3[3];\n"
        "struct Status { double angle; float__3 tension; }; }; };\n"
    )
    with (tmp_path / "a.mcap").open("wb") as file:
        out = PlainMcapWriter(file)
        out.start()
        channel = out.register_channel("/status", "cdr", out.register_schema("lab_msgs/msg/Status", "ros2idl", idl.encode()))
        for n in range(5):
            message = store.types["lab_msgs/msg/Status"](n / 3, np.array([n, 1, 2], np.float32))
            out.add_message(channel, T0 + n, bytes(store.serialize_cdr(message, "lab_msgs/msg/Status")), T0 + n)
        out.finish()
    fields = open_log(tmp_path / "a.mcap").takes[0].streams["/status"].fields
    assert fields["angle"].values.tolist() == [n / 3 for n in range(5)]
    assert fields["tension[0]"].values.tolist() == list(range(5))


def test_a_stamp_without_a_header_is_a_clock(tmp_path: Path) -> None:
    kind = f"builtin_interfaces/Time stamp\nfloat64 tension\n{RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    with (tmp_path / "a.mcap").open("wb") as file, McapWriter(file) as out:
        schema = out.register_msgdef("lab_msgs/msg/Cell", kind)
        for n in range(5):
            out.write_message("/cell", schema, {**stamped(T0 + n * 10**7), "tension": 1.0}, T0 + n * 10**7 + DELAY, T0)
    text = map_text(open_log(tmp_path / "a.mcap"), "m.toml")
    assert 'name = "/cell", clock = "stamp"' in text
    assert "log time is later by 3 ms" in text


def test_nested_messages_are_flat_fields() -> None:
    message = {
        "header": {"stamp": {"sec": 1, "nanosec": 2}},
        "joint_names": ["a", "b"],
        "actual": {"positions": [1.0, 2.0], "velocities": [], "point": [7.0, 8.0]},
        "matrix": [[1.0, 2.0], [3.0, 4.0]],
        "on": True,
        "points": [{"x": 5.0}, {"x": 6.0}],
        "note": "text",
        "raw": bytes(10),
    }
    assert flatten(message) == {
        "actual.positions[a]": 1.0, "actual.positions[b]": 2.0, "actual.point[0]": 7.0, "actual.point[1]": 8.0,
        "matrix[a][0]": 1.0, "matrix[a][1]": 2.0, "matrix[b][0]": 3.0,
        "matrix[b][1]": 4.0, "on": 1.0, "points[a].x": 5.0, "points[b].x": 6.0,
    }  # fmt: skip
    assert flatten({"data": "begin"}) == {"data": "begin"}
