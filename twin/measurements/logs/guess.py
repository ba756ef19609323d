"""What fields may be: quantity, role and unit, by the type of message and by names. A guess is only ever a proposal in the map.

The quantities are those of `parse_channel_name`; what that does not know is not proposed.
"""

import re
from dataclasses import dataclass, replace

from twin.foundation.errors import DataError
from twin.measurements.channels import Channel, parse_channel_name
from twin.measurements.logs.bags.messages import short_type
from twin.measurements.logs.streams import Field, Stream
from twin.measurements.logs.tables.headers import split_unit

UNKNOWN = "?"
_COMMAND = {
    "cmd", "cmds", "command", "commands", "commanded", "des", "desired", "target", "targets", "goal", "ref", "reference",
    "setpoint", "sp", "sent", "ctrl", "control", "action", "qdes", "ordered",
}  # fmt: skip
_MEASURED = {"read", "meas", "measured", "actual", "obs", "observed", "observation", "state", "states", "feedback", "fb"}
_TENDON = {"tendon", "tendons", "cable", "cables", "wire", "wires"}
_MOTOR = {"motor", "motors", "servo", "servos", "winch", "spool", "dynamixel"}
_ANGLE = {"angle", "angles", "pos", "position", "positions", "rad", "deg", "theta"}
_LENGTH = {"length", "displacement", "disp", "pos", "position", "travel", "pull", "stroke"}
_TIP = {"tip", "ee", "effector", "endeffector", "tcp"}
_DISK = {"disk", "disks", "disc", "segment", "section", "body", "link"}
_ROS_UNITS = (
    (r"orientation|rotation|quaternion", "1"), (r"angular_velocity|angular\.", "rad/s"), (r"linear_acceleration", "m/s^2"),
    (r"linear\.", "m/s"), (r"torque", "N*m"), (r"force", "N"), (r"(position|translation|point)\.", "m"), (r"voltage", "V"),
)  # fmt: skip
_OF_JOINT = re.compile(r"(?:(.+)\.)?(positions?|velocit(?:y|ies)|efforts?)\[(.+)\]")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_JOINT_WORDS = {
    "position": ("q", "qpos", "pos", "position", "angle"), "velocity": ("dq", "qd", "qvel", "vel", "velocity", "speed"),
    "torque": ("tau", "torque", "effort"),
}  # fmt: skip


@dataclass(frozen=True)
class Guess:
    """A proposal. Empty or "?" where it cannot be known; `sure` where the format itself says it."""

    quantity: str = UNKNOWN
    role: str = UNKNOWN
    unit: str = UNKNOWN
    sure: bool = False
    proposed: bool = True  # False: written into the map, but commented out


def guess_fields(stream: Stream) -> dict[str, Guess]:
    """Return a proposal for each field of a stream."""
    found = {name: _guess(stream, name, each) for name, each in stream.fields.items() if not each.labels}
    found = {name: _checked(guess, stream.fields[name]) for name, guess in _count_from_one(found).items()}
    return {
        name: replace(each, unit=_ros_unit(stream.kind, name)) if each.unit == UNKNOWN else each for name, each in found.items()
    }


def _ros_unit(kind: str, name: str) -> str:
    """Return the unit that ROS's own messages have, all SI (REP 103), or "?"."""
    if not kind.startswith(("geometry_msgs/", "sensor_msgs/", "nav_msgs/", "transform of ")):
        return UNKNOWN
    return next((unit for words, unit in _ROS_UNITS if re.search(words, name)), UNKNOWN)


def _guess(stream: Stream, name: str, field: Field) -> Guess:
    kind = short_type(stream.kind)
    if (match := _OF_JOINT.fullmatch(name)) and not match[3].isdigit():
        return _joint_state(f"{stream.name} {match[1] or ''}", match[2], match[3])
    if match := re.fullmatch(r"(action|observation\.state|observation\.environment_state)\[(.+)\]", name):
        return _lerobot(match[1], match[2])
    if match := re.match(r"/(input|output|context)/(.+)", stream.name):  # as `twin export` names topics
        return replace(_guess(replace(stream, name=match[2]), name, field), role=match[1])
    if kind == "Imu":
        return _imu(stream.name, name)
    plain = split_unit(name)[0]
    if kind in ("Float64", "Float32", "Float64MultiArray", "Float32MultiArray", "Int32", "Int64"):
        plain = f"{stream.name} {name.removeprefix('data')}"
        index = re.fullmatch(r"data\[(\d+)\]", name)
        if index and not re.search(r"\d", stream.name):
            return _by_words(f"{stream.name} {int(index[1]) + 1}", field)
    elif re.search("position|translation|orientation|rotation", name) or kind.startswith("Point"):
        return _pose(stream, name) or _by_words(plain, field)
    return _by_words(plain, field)


def _joint_state(place: str, part: str, joint: str) -> Guess:
    """Return a proposal for a list by joint names, in ROS's units; `place` are the topic and what the list is in."""
    quantity, unit = {"pos": ("position", "rad"), "vel": ("velocity", "rad/s"), "eff": ("torque", "N*m")}[part[:3]]
    if _COMMAND & set(_words(place)):
        return Guess(f"actuator.{joint}.ctrl", "input", unit, proposed=quantity == "position")
    if "error" in place:
        return Guess()
    return Guess(f"joint.{joint}.{quantity}", "output", unit, sure=True, proposed=quantity == "position")


def _lerobot(feature: str, name: str) -> Guess:
    joint = re.sub(r"\.(pos|vel)$", "", name)
    role = {"action": "input", "observation.state": "output"}.get(feature, "context")
    if known := _known(name):
        return Guess(known, role)
    if joint.isdigit() or role == "context":
        return Guess(UNKNOWN, role)
    return Guess(f"actuator.{joint}.ctrl" if role == "input" else f"joint.{joint}.position", role)


def _imu(topic: str, name: str) -> Guess:
    number = next((word for word in _words(topic) if word.isdigit()), "1")
    if match := re.fullmatch(r"(angular_velocity|linear_acceleration)\.([xyz])", name):
        quantity, unit = ("gyro", "rad/s") if match[1] == "angular_velocity" else ("accel", "m/s^2")
        return Guess(f"imu_{number}_{quantity}_{match[2]}", "output", unit, sure=True)
    return Guess()


def _pose(stream: Stream, name: str) -> Guess | None:
    """Return a proposal for a coordinate or quaternion of a body that the topic or the field names; None for others."""
    match = re.search(r"(?:^|\.)([xyzw])$", name)
    if match is None:
        return None
    if "covariance" in name or "twist" in name:
        return Guess()
    turns = "orientation" in name or "rotation" in name
    of_ros = not stream.kind.startswith(("Motive", "text", "Parquet", "JSON"))
    body = _body(_words(f"{stream.name if of_ros else ''} {name[: match.start()]}"))
    if not body:
        return Guess()
    unit = ("1" if turns else "m") if of_ros else UNKNOWN
    return Guess(f"{body}_q{match[1]}" if turns else f"{body}_{match[1]}", "output", unit)


def _body(words: list[str]) -> str:
    number = next((word for word in words if word.isdigit()), "")
    if _TIP & set(words):
        return "tip"
    if not number:
        return ""
    return f"disk_{number}" if _DISK & set(words) and not {"marker", "markers"} & set(words) else f"marker_{number}"


def _by_words(text: str, field: Field) -> Guess:
    """Return a proposal from the words of a name."""
    words = _words(text)
    role = "input" if _COMMAND & set(words) else "output" if _MEASURED & set(words) else UNKNOWN
    for plain in (text.strip(), "_".join(words)):
        if known := _known(plain):
            return Guess(known, _role(known, role), field.unit or UNKNOWN)
    quantity = _quantity(words) or _joint_by_name("_".join(text.strip("/ ").split("/")[-2:]), role)
    if not quantity:
        return Guess(UNKNOWN, "input" if re.fullmatch(r"u_?\d+", text.strip()) else role, field.unit or UNKNOWN)
    return Guess(quantity, _role(quantity, role), field.unit or UNKNOWN)


def _role(quantity: str, by_words: str) -> str:
    """Return the role of a quantity where the words of its name do not say it."""
    if quantity.endswith(".ctrl"):
        return "input"
    if quantity == "ambient_temperature":
        return "context"
    return "output" if by_words == UNKNOWN and re.search(r"(disk|marker|tip)_|\.position$", quantity) else by_words


def _quantity(words: list[str]) -> str:
    """Return the quantity that words name, or an empty text."""
    has = set(words)
    number = next((word for word in words if word.isdigit()), "")
    axis = next((word for word in words if word in ("x", "y", "z")), "")
    if has & {"ambient", "room"} and has & {"temp", "temperature"}:
        return "ambient_temperature"
    if axis and not has & {"vel", "velocity", "acc", "accel", "gyro", "force", "torque", "mag", "q"} and (body := _body(words)):
        return f"{body}_{axis}"
    if not number:
        return ""
    if turn := next((word for word in words if word in ("qw", "qx", "qy", "qz")), ""):
        return f"{_body(words)}_{turn}"
    if (
        has & {"tension", "tensions"}
        or (has & _TENDON and has & {"force", "forces"})
        or {"load", "cell"} <= has
        or "loadcell" in has
    ):
        return f"tendon_{number}_tension"
    if has & _TENDON and has & _LENGTH:
        return f"tendon_{number}_displacement"
    for names, kind in (
        (_MOTOR, "motor"),
        ({"joint", "joints"}, "joint"),
        ({"sma", "heater"}, "sma"),
        ({"sensor", "strain"}, "sensor"),
    ):
        if has & names:
            part = next((part for part in ("current", "torque", "voltage", "temperature", "resistance") if part in has), "")
            part = part or ("angle" if has & (_ANGLE | _COMMAND | _MEASURED) else "")
            return f"{kind}_{number}_{part}" if part else ""
    return ""


def _joint_by_name(text: str, role: str) -> str:
    """Return the quantity of a name such as q_FL_hip, qdes_FL_hip or elbow_pos, or an empty text."""
    for quantity, words in _JOINT_WORDS.items():
        either = "|".join(words)
        match = re.fullmatch(rf"(?:{either})[_. ](.*[A-Za-z].*)|(.*[A-Za-z].*)[_. ](?:{either})", text.strip())
        name = (match[1] or match[2]) if match else ""
        words_of_name = set(_words(name))
        if name and not words_of_name & (_COMMAND | {"x", "y", "z", "w", "enable", "enabled", "limit", "max", "min"}):
            return f"joint.{name}.{quantity}" if role != "input" else f"actuator.{name}.ctrl"
    match = re.fullmatch(r"(?:qdes|q_des|q_cmd|q_target|target|cmd|goal)[_. ](.*[A-Za-z].*)", text.strip())
    return f"actuator.{match[1]}.ctrl" if match and not match[1].startswith(("pos", "vel", "torque")) else ""


def _words(text: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(text)]


def _known(name: str) -> str:
    """Return a name that is a quantity, or an empty text."""
    try:
        parse_channel_name(name)
    except DataError:
        return ""
    return name


def _count_from_one(found: dict[str, Guess]) -> dict[str, Guess]:
    """Return proposals whose numbers count from 1, where those of a kind counted from 0."""
    counted = re.compile(r"([a-z]+_)(\d+)(_.*)")
    shifted = {match[1] + match[3] for each in found.values() if (match := counted.fullmatch(each.quantity)) and match[2] == "0"}
    moved = {}
    for name, each in found.items():
        match = counted.fullmatch(each.quantity)
        if match and match[1] + match[3] in shifted:
            each = replace(each, quantity=f"{match[1]}{int(match[2]) + 1}{match[3]}")
        elif match:
            each = replace(each, quantity=f"{match[1]}{int(match[2])}{match[3]}")
        moved[name] = each
    return moved


def _checked(guess: Guess, field: Field) -> Guess:
    """Return a proposal without a quantity outside the grammar, and without a unit that does not fit."""
    if guess.quantity == UNKNOWN or not _known(guess.quantity):
        return replace(guess, quantity=UNKNOWN, proposed=False, unit=field.unit or guess.unit)
    unit = field.unit or guess.unit
    try:
        Channel("x", "output", unit, None, guess.quantity)
    except DataError:
        unit = UNKNOWN
    return replace(guess, unit=unit)
