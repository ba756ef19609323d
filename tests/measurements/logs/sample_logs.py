"""Logs written by the libraries of their makers (mcap_ros2, rosbags, pyarrow), with the numbers that are in them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from twin.measurements import Recording, read, write
from twin.measurements.logs import assemble, map_text, open_log, read_map

T0 = 1_726_041_600_000_000_000  # ns, a day in 2024
RULE = "=" * 80
HEADER = f"{RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{RULE}\nMSG: builtin_interfaces/Time\n"
HEADER += "int32 sec\nuint32 nanosec\n"
JOINT_STATE = f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}"
POINT_DEFINITION = f"{RULE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
POINT = f"std_msgs/Header header\ngeometry_msgs/Point point\n{POINT_DEFINITION}{HEADER}"
DELAY = 3_000_000  # ns from header to recorder


def stamped(ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "base"}


def joint_numbers(count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Stamps in ns at 200 a second, and (count, 2) angles with all their digits."""
    return T0 + 5_000_000 * np.arange(count), np.random.default_rng(1).normal(size=(count, 2))


def point_numbers(count: int = 100) -> tuple[np.ndarray, np.ndarray]:
    """Stamps in ns at 100 a second beside those of the joints, and (count, 3) positions."""
    return T0 + 1_300_000 + 10_000_000 * np.arange(count), np.random.default_rng(2).normal(size=(count, 3))


def command_numbers(count: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """Stamps in ns at 50 a second, and (count,) tensions."""
    return T0 + 20_000_000 * np.arange(count), np.random.default_rng(3).uniform(1.0, 2.0, size=count)


def write_mcap(path: Path, header: bool = True) -> Path:
    """Joint states with names in changing order, points, and a command that has no header."""
    joints, points, commands = joint_numbers(), point_numbers(), command_numbers()
    with path.open("wb") as file, McapWriter(file) as out:
        joint_state = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        point_stamped = out.register_msgdef("geometry_msgs/msg/PointStamped", POINT)
        float64 = out.register_msgdef("std_msgs/msg/Float64", "float64 data")
        rows = [(int(t), "joint", n) for n, t in enumerate(joints[0])] + [(int(t), "point", n) for n, t in enumerate(points[0])]
        for t, what, n in sorted(rows + [(int(t), "command", n) for n, t in enumerate(commands[0])]):
            head = stamped(t if header else 0)
            if what == "joint":
                names, turn = ["shoulder", "elbow"], slice(None, None, 1 if n % 2 else -1)
                numbers = {"position": joints[1][n][turn].tolist(), "velocity": [], "effort": []}
                out.write_message(
                    "/joint_states", joint_state, {"header": head, "name": names[turn], **numbers}, t + DELAY, t + DELAY
                )
            elif what == "point":
                position = dict(zip("xyz", points[1][n].tolist(), strict=True))
                out.write_message("/mocap/tip", point_stamped, {"header": head, "point": position}, t + DELAY, t + DELAY)
            else:
                out.write_message("/tendon_1/tension_cmd", float64, {"data": float(commands[1][n])}, t + DELAY, t + DELAY)
    return path


def write_ros1_bag(path: Path) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    with Rosbag1Writer(path) as bag:
        joint = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        command = bag.add_connection("/tendon_1/tension_cmd", "std_msgs/msg/Float64", typestore=store)
        for n, (t, position) in enumerate(zip(*joint_numbers(), strict=True)):
            stamp = types["builtin_interfaces/msg/Time"](sec=int(t) // 10**9, nanosec=int(t) % 10**9)
            head = types["std_msgs/msg/Header"](seq=n, stamp=stamp, frame_id="base")
            empty = np.zeros(0)
            message = types["sensor_msgs/msg/JointState"](head, ["shoulder", "elbow"], position, empty, empty)
            bag.write(joint, int(t) + DELAY, store.serialize_ros1(message, "sensor_msgs/msg/JointState"))
        for t, value in zip(*command_numbers(), strict=True):
            message = types["std_msgs/msg/Float64"](float(value))
            bag.write(command, int(t) + DELAY, store.serialize_ros1(message, "std_msgs/msg/Float64"))
    return path


def write_ros2_bag(folder: Path, version: int = 9) -> Path:
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    with Rosbag2Writer(folder, version=version) as bag:
        joint = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        transform = bag.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        for t, position in zip(*joint_numbers(), strict=True):
            stamp = types["builtin_interfaces/msg/Time"](sec=int(t) // 10**9, nanosec=int(t) % 10**9)
            head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
            message = types["sensor_msgs/msg/JointState"](head, ["shoulder", "elbow"], position, np.zeros(0), np.zeros(0))
            bag.write(joint, int(t) + DELAY, store.serialize_cdr(message, "sensor_msgs/msg/JointState"))
            turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            frames = [
                types["geometry_msgs/msg/TransformStamped"](
                    head, child, types["geometry_msgs/msg/Transform"](types["geometry_msgs/msg/Vector3"](x, 0.0, 1.0), turn)
                )
                for child, x in (("tip", float(position[0])), ("disk_2", float(position[1])))
            ]
            message = types["tf2_msgs/msg/TFMessage"](frames)
            bag.write(transform, int(t) + DELAY, store.serialize_cdr(message, "tf2_msgs/msg/TFMessage"))
    return folder


def write_lerobot(folder: Path, lengths: tuple[int, ...] = (40, 30), rate: int = 50) -> dict[str, np.ndarray]:
    """A LeRobot v3 dataset in the documented layout (the library itself needs torch and video codecs); its numbers."""
    rows = sum(lengths)
    rng = np.random.default_rng(4)
    state, action = rng.normal(size=(rows, 2)), rng.normal(size=(rows, 2))
    frames = np.concatenate([np.arange(length) for length in lengths])
    table = pa.table(
        {
            "observation.state": pa.array(state.tolist(), pa.list_(pa.float64(), 2)),
            "action": pa.array(action.tolist(), pa.list_(pa.float64())),
            "timestamp": (frames / rate).astype(np.float32), "frame_index": frames, "index": np.arange(rows),
            "episode_index": np.repeat(np.arange(len(lengths)), lengths), "task_index": np.zeros(rows, np.int64),
        }
    )  # fmt: skip
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    pyarrow.parquet.write_table(table, folder / "data/chunk-000/file-000.parquet")
    motors = ["shoulder_pan.pos", "elbow_flex.pos"]
    features = {
        "observation.state": {"dtype": "float32", "shape": [2], "names": motors},
        "action": {"dtype": "float32", "shape": [2], "names": {"motors": motors}},
        "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channels"]},
    }
    info = {"codebase_version": "v3.0", "robot_type": "so100", "fps": rate, "total_episodes": len(lengths), "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info))
    return {"state": state, "action": action}


def filled_in(log_path: Path, map_path: Path, *changes: tuple[str, str]) -> Path:
    """Write the proposed map of a log with regular expressions replaced, as a user edits it."""
    text = map_text(open_log(log_path), map_path.name)
    for pattern, new in (('robot = "[?]"', 'robot = "continuum"'), ('source = "[?]"', 'source = "hardware"'), *changes):
        text, count = re.subn(pattern, new, text)
        assert count, pattern
    map_path.write_text(text)
    return map_path


def imported(log_path: Path, folder: Path, *changes: tuple[str, str]) -> Recording:
    """The set that a log becomes with a changed map, read back from its files."""
    map_path = filled_in(log_path, folder.parent / f"{folder.name}-map.toml", *changes)
    write(assemble(open_log(log_path), read_map(map_path))[0], folder)
    return read(folder, least_trials=1)


def readings(recording: Recording, name: str, trial: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a channel's own rows."""
    one = recording.trials[trial]
    has = np.isfinite(one.values[name])
    return one.time[has], one.values[name][has]
