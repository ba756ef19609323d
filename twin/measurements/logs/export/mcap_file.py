"""A measurement set as one MCAP file of ROS 2 messages, in SI, which ROS 2 tools, Foxglove and PlotJuggler read.

    /ROLE/disk_1 (and marker_K, tip, site.NAME)   geometry_msgs/PointStamped
    /ROLE/joint_states                            sensor_msgs/JointState, of joint.NAME.position, .velocity, .torque
    /ROLE/CHANNEL                                 std_msgs/Float64, everything else
    /trial                                        std_msgs/String, the name of each trial where it begins
    metadata "twin-measurements"                  robot, title, source, and what each topic is

Trials follow each other by their `start`, or one second apart; times count from 1 s. An empty cell is no message.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.measurements.channels import Channel
from twin.measurements.logs.bags.mcap_log import EXPORT_METADATA
from twin.measurements.logs.export.definitions import FLOAT64, JOINT_STATE, POINT_STAMPED, STRING
from twin.measurements.logs.libraries import library
from twin.measurements.recording import Recording, Trial

BETWEEN_TRIALS = 1.0  # s
FIRST_TIME = 1.0  # s: a stamp of zero means "not set" in ROS
TRIAL_TOPIC = "/trial"
_JOINT_PARTS = {"joint_position": "position", "joint_velocity": "velocity", "joint_effort": "effort"}


@dataclass
class Topic:
    """The channels of a topic, and by what part of its message each goes."""

    name: str
    schema: tuple[str, str]  # type, definition
    parts: dict[Any, Channel] = field(default_factory=dict)


def write_mcap(recording: Recording, path: Path) -> None:
    """Write a recording as MCAP, whole or not at all. Raises DataError for a file that exists, or if the disk refuses it."""
    writer = library("mcap_ros2.writer", "mcap-ros2-support").Writer
    if path.exists():
        raise DataError(f"{path}: exists already and is not overwritten; name a new file")
    write_atomically(path, lambda stream: _write(recording, stream, writer))


def _write(recording: Recording, stream: BinaryIO, writer: Any) -> None:
    topics = _topics(recording)
    out = writer(stream)
    schemas = {kind: out.register_msgdef(*kind) for kind in {STRING, *(topic.schema for topic in topics)}}
    begins = _begins(recording)
    for begin, trial in sorted(zip(begins, recording.trials, strict=True), key=lambda each: each[0]):
        first = _nanoseconds(begin + float(trial.time[0]))
        out.write_message(TRIAL_TOPIC, schemas[STRING], {"data": trial.label}, log_time=first, publish_time=first)
        for row, time in enumerate(trial.time.tolist()):
            stamp = _nanoseconds(begin + time)
            for topic in topics:
                if (message := _message(topic, trial, row, stamp)) is not None:
                    out.write_message(topic.name, schemas[topic.schema], message, log_time=stamp, publish_time=stamp)
    out.add_metadata(EXPORT_METADATA, _about(recording, topics))
    out.finish()


def _begins(recording: Recording) -> list[float]:
    """Return when trials begin on the file's time line, s: by their starts if these do not overlap, else one after the other."""
    starts = [trial.start for trial in recording.trials]
    if all(start is not None for start in starts):
        known = [start for start in starts if start is not None]
        ordered = sorted(zip(known, recording.trials, strict=True), key=lambda each: each[0])
        ends = [start + float(trial.time[-1]) for start, trial in ordered]
        firsts = [start + float(trial.time[0]) for start, trial in ordered]
        if all(end < first for end, first in zip(ends, firsts[1:], strict=False)):
            return [FIRST_TIME + start - firsts[0] for start in known]
    begins, now = [], FIRST_TIME
    for trial in recording.trials:
        begins.append(now - float(trial.time[0]))
        now += float(trial.time[-1] - trial.time[0]) + BETWEEN_TRIALS
    return begins


def _topics(recording: Recording) -> list[Topic]:
    found: dict[str, Topic] = {}
    for channel in recording.channels:
        name, schema, part = _topic_of(channel)
        topic = found.setdefault(name, Topic(name, schema))
        if part in topic.parts:  # a second reading of the same quantity
            name, schema, part = f"/{channel.role}/{channel.name}", FLOAT64, ""
            topic = found.setdefault(name, Topic(name, schema))
        topic.parts[part] = channel
    return list(found.values())


def _topic_of(channel: Channel) -> tuple[str, tuple[str, str], Any]:
    """Return the topic of a channel, its type, and the part of the message."""
    if channel.kind in _JOINT_PARTS:
        joint = channel.means.removeprefix("joint.").rpartition(".")[0]
        return f"/{channel.role}/joint_states", JOINT_STATE, (joint, _JOINT_PARTS[channel.kind])
    if channel.axis in ("x", "y", "z") and channel.si_unit == "m":
        return f"/{channel.role}/{channel.means[:-2]}", POINT_STAMPED, channel.axis
    return f"/{channel.role}/{channel.name}", FLOAT64, ""


def _message(topic: Topic, trial: Trial, row: int, stamp: int) -> dict[str, Any] | None:
    """Return a topic's message of a row, or None if none of its channels has a reading."""
    values = {part: float(trial.values[channel.name][row]) for part, channel in topic.parts.items()}
    if all(math.isnan(value) for value in values.values()):
        return None
    header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base"}
    if topic.schema == FLOAT64:
        return {"data": values[""]}
    if topic.schema == POINT_STAMPED:
        return {"header": header, "point": {axis: values.get(axis, math.nan) for axis in "xyz"}}
    return {"header": header, **_joint_state(values)}


def _joint_state(values: Mapping[Any, float]) -> dict[str, Any]:
    names = list(dict.fromkeys(joint for joint, _ in values))
    parts = {part: [values.get((name, part), math.nan) for name in names] for part in ("position", "velocity", "effort")}
    return {"name": names} | {part: [] if np.all(np.isnan(numbers)) else numbers for part, numbers in parts.items()}


def _about(recording: Recording, topics: list[Topic]) -> dict[str, str]:
    channels = {channel.name: [topic.name, channel.means, channel.si_unit] for topic in topics for channel in topic.parts.values()}
    return {
        "robot": recording.robot, "title": recording.title, "source": recording.source,
        "channels": json.dumps(channels),  # name -> topic, quantity, SI unit
    }  # fmt: skip


def _nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9)
