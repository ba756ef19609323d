"""Decoded ROS messages, and JSON, as flat fields: `pose.position.x`, `data[2]`, `position[elbow]`.

A list beside a list of names of the same length is read by those names (JointState and its like); in a TFMessage each child
frame is a stream of its own. Texts are kept only in messages that hold nothing else (marks).
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

LONGEST_LIST = 128  # entries of a list that become fields; longer ones are pictures, scans and clouds
MAX_STAMP_SECONDS = 2**33  # s since 1970
_NAME_LISTS = ("name", "names", "joint_names", "interface_names", "joint_name", "motor_names")
# lists that the names one level up are of, too; another list of the same length may be a point
_OF_JOINTS = (
    "position", "positions", "velocity", "velocities", "acceleration", "accelerations", "effort", "efforts", "torque", "torques",
    "current", "currents", "temperature", "temperatures",
)  # fmt: skip
_NO_NUMBERS = (
    "Image", "CompressedImage", "PointCloud2", "PointCloud", "LaserScan", "OccupancyGrid", "CameraInfo", "CompressedVideo",
    "Octomap",
)  # fmt: skip
Values = dict[str, float | str]


def short_type(kind: str) -> str:
    """Return the last part of a message type: sensor_msgs/msg/JointState -> JointState."""
    return kind.rpartition("/")[2]


def holds_no_numbers(kind: str) -> bool:
    """Return whether messages of this type are pictures, clouds or maps, which no channel can hold."""
    return short_type(kind) in _NO_NUMBERS


def split_message(topic: str, kind: str, message: object) -> Iterator[tuple[str, str, object]]:
    """Yield the streams in a message as (name, type, message): the message itself, or the frames of a TFMessage."""
    if short_type(kind) != "TFMessage":
        yield topic, kind, message
        return
    for each in _items(message).get("transforms", ()):
        header = _items(_items(each).get("header", {}))
        child = _items(each).get("child_frame_id", "?")
        yield f"{topic}[{child}]", f"transform of {child} in {header.get('frame_id', '?')}", each


def flatten(message: object) -> Values:
    """Return the numbers of a message by field, without its stamp and covariances; its texts if it holds no number."""
    values: Values = {}
    texts: dict[str, str] = {}
    _flatten(message, "", (), values, texts)
    return values if values else dict(texts)


def header_stamp(message: object) -> int | None:
    """Return header.stamp in ns since 1970, or None where there is none or it was not set."""
    return _stamp_ns(_items(_items(_items(message).get("header", {})).get("stamp", {})))


def own_stamp(message: object) -> int | None:
    """Return the stamp of a message without a header in ns since 1970, or None as `header_stamp`."""
    return _stamp_ns(_items(_items(message).get("stamp", {})))


def _stamp_ns(stamp: Mapping[str, Any]) -> int | None:
    seconds = stamp.get("sec", stamp.get("secs"))
    rest = stamp.get("nanosec", stamp.get("nsecs", stamp.get("nsec", 0)))
    if not isinstance(seconds, int | np.integer) or not isinstance(rest, int | np.integer):
        return None
    total = int(seconds) * 10**9 + int(rest)
    return total if 0 < total < MAX_STAMP_SECONDS * 10**9 else None


def _items(message: object) -> Mapping[str, Any]:
    """Return the parts of a message of any of the libraries, without constants and private names."""
    if isinstance(message, Mapping):
        return message
    names = getattr(message, "__slots__", None) or list(getattr(message, "__dict__", ()))
    return {name: getattr(message, name) for name in names if not name.startswith("_")}


def _flatten(message: object, path: str, names: Sequence[str], values: Values, texts: dict[str, str]) -> None:
    items = _items(message)
    own = next((found for each in _NAME_LISTS if (found := _text_list(items.get(each)))), None)
    for key, value in items.items():
        if key in ("header", "layout") or "covariance" in key or (key == "stamp" and not path):
            continue
        place = f"{path}.{key}" if path else key
        if isinstance(value, bool | np.bool_ | int | float | np.integer | np.floating):
            values[place] = float(value)
        elif isinstance(value, str):
            texts[place] = value
        elif _is_list(value):
            by_parent = names if key in _OF_JOINTS else ()
            _flatten_list(value, place, by_parent if own is None else own, values, texts)
        elif value is not None:
            _flatten(value, place, names if own is None else own, values, texts)


def _flatten_list(value: Any, place: str, names: Sequence[str], values: Values, texts: dict[str, str]) -> None:
    if len(value) > LONGEST_LIST or isinstance(value, bytes | bytearray | memoryview):
        return
    value = value.tolist() if isinstance(value, np.ndarray) else value
    by_name = len(names) == len(value) and len(set(names)) == len(names)
    for n, each in enumerate(value):
        at = f"{place}[{names[n] if by_name else n}]"
        if type(each) is float:  # the usual case first
            values[at] = each
        elif isinstance(each, bool | np.bool_ | int | float | np.integer | np.floating):
            values[at] = float(each)
        elif isinstance(each, str):
            return
        elif _is_list(each):
            _flatten_list(each, at, (), values, texts)
        elif each is not None:
            _flatten(each, at, (), values, texts)


def _is_list(value: object) -> bool:
    return not isinstance(value, str | Mapping) and hasattr(value, "__len__") and hasattr(value, "__getitem__")


def _text_list(value: object) -> list[str]:
    if not _is_list(value) or isinstance(value, bytes | bytearray | memoryview | np.ndarray):
        return []
    found = list(value)  # type: ignore[call-overload]
    return [str(each) for each in found] if found and all(isinstance(each, str) for each in found) else []
