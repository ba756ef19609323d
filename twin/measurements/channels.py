"""Channel names: their grammar, and the channels they declare.

    [finger_N_] tendon_I_(tension|displacement) | sma_I_(current|voltage|temperature|resistance) | ambient_temperature
              | (disk_K|marker_K|tip)_(x|y|z|qw|qx|qy|qz|roll|pitch|yaw) | imu_K_(gyro|accel)_(x|y|z)
              | sensor_I_resistance | joint_I_(angle|torque)
              | motor_I_(angle|current|torque)
    on a robot that is an MJCF, NAME being the model's, dots and slashes included:
    actuator.NAME.(ctrl|position|velocity|force) | joint.NAME.(position|velocity|torque) | tendon.NAME.(length|velocity|tension)
              | site.NAME.(x|y|z) | sensor.NAME[.K]

Indices count from 1, base to tip, and are written without leading zeros. A channel whose column has another name says what it is as
its `quantity`.
"""

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, cast, get_args

from twin.foundation.errors import DataError, short_repr
from twin.foundation.units import Scale, unit_scale

Role = Literal["input", "output", "context"]
Axis = Literal["x", "y", "z", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw"]
QUATERNION, ANGLES = ("qw", "qx", "qy", "qz"), ("roll", "pitch", "yaw")
_AXES = {"@": ("x", "y", "z"), "%": QUATERNION, "&": ANGLES}  # what a mark of a pattern stands for

# kind -> (pattern with # for the index and @, % or & for the axis, SI unit)
CHANNEL_KINDS: dict[str, tuple[str, str]] = {
    "tendon_tension": ("tendon_#_tension", "N"),
    "tendon_displacement": ("tendon_#_displacement", "m"),
    "sma_current": ("sma_#_current", "A"),
    "sma_voltage": ("sma_#_voltage", "V"),
    "sma_temperature": ("sma_#_temperature", "K"),
    "sma_resistance": ("sma_#_resistance", "ohm"),
    "ambient_temperature": ("ambient_temperature", "K"),
    "disk": ("disk_#_@", "m"),
    "marker": ("marker_#_@", "m"),
    "tip": ("tip_@", "m"),
    **{f"{at}_quaternion": (f"{at}{n}_%", "1") for at, n in (("disk", "_#"), ("marker", "_#"), ("tip", ""))},
    **{f"{at}_angles": (f"{at}{n}_&", "rad") for at, n in (("disk", "_#"), ("marker", "_#"), ("tip", ""))},
    "imu_rate": ("imu_#_gyro_@", "rad/s"),
    "imu_force": ("imu_#_accel_@", "m/s^2"),
    "sensor_resistance": ("sensor_#_resistance", "ohm"),
    "joint_angle": ("joint_#_angle", "rad"),
    "joint_torque": ("joint_#_torque", "N*m"),
    "motor_angle": ("motor_#_angle", "rad"),
    "motor_current": ("motor_#_current", "A"),
    "motor_torque": ("motor_#_torque", "N*m"),
}
_ROTARY_OR_LINEAR = ("rad", "m")
_TURNING_OR_SLIDING = ("rad/s", "m/s")
_TORQUE_OR_FORCE = ("N*m", "N")
# quantities of an MJCF's elements: kind -> (pattern with NAME for the element, SI units by the element's own kind)
ELEMENT_KINDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "actuator_ctrl": ("actuator.NAME.ctrl", ("1", "rad", "m", "N*m", "N", "rad/s", "m/s", "V", "A")),
    "actuator_position": ("actuator.NAME.position", _ROTARY_OR_LINEAR),
    "actuator_velocity": ("actuator.NAME.velocity", _TURNING_OR_SLIDING),
    "actuator_force": ("actuator.NAME.force", _TORQUE_OR_FORCE),
    "joint_position": ("joint.NAME.position", _ROTARY_OR_LINEAR),
    "joint_velocity": ("joint.NAME.velocity", _TURNING_OR_SLIDING),
    "joint_effort": ("joint.NAME.torque", _TORQUE_OR_FORCE),
    "tendon_length": ("tendon.NAME.length", ("m", "rad")),
    "tendon_velocity": ("tendon.NAME.velocity", ("m/s", "rad/s")),
    "element_tension": ("tendon.NAME.tension", ("N", "N*m")),
    "site": ("site.NAME.@", ("m",)),
    "element_sensor": ("sensor.NAME", ("1", "rad", "m", "N*m", "N", "rad/s", "m/s", "m/s^2", "rad/s^2")),
}
DERIVED_KINDS: dict[str, tuple[str, str]] = {
    "skin": ("skin_#", "m"),  # made from point clouds (`patches.py`), not read
    # made from quaternions or from roll, pitch, yaw
    **{f"{at}_turn": (f"{at}{n}_turn_@", "rad") for at, n in (("disk", "_#"), ("marker", "_#"), ("tip", ""))},
}


def readable(pattern: str) -> str:
    """Return a pattern with its axes written out: disk_K_x|y|z."""
    for mark, axes in _AXES.items():
        pattern = pattern.replace(mark, "|".join(axes))
    return pattern


ALLOWED_NAMES = (
    "tendon_I_tension|displacement, sma_I_current|voltage|temperature|resistance, ambient_temperature, "
    "disk_K_x|y|z|qw|qx|qy|qz|roll|pitch|yaw (marker_K, tip alike), imu_K_gyro|accel_x|y|z, sensor_I_resistance, "
    "joint_I_angle|torque, motor_I_angle|current|torque, each also as finger_N_...; of an MJCF "
    "joint|tendon|actuator|site|sensor.NAME.QUANTITY"
)
_INDEX = "[1-9][0-9]{0,3}"


def _with_axes(pattern: str) -> str:
    for mark, axes in _AXES.items():
        pattern = pattern.replace(mark, f"(?P<axis>{'|'.join(axes)})")
    return pattern


_GRAMMAR = {
    kind: re.compile(f"(?:finger_(?P<finger>{_INDEX})_)?" + _with_axes(pattern.replace("#", f"(?P<index>{_INDEX})")))
    for kind, (pattern, _) in (CHANNEL_KINDS | DERIVED_KINDS).items()
}
_ELEMENT_GRAMMAR = {
    kind: re.compile(re.escape(pattern).replace("NAME", "(?P<element>.{1,200})").replace("@", "(?P<axis>[xyz])"))
    for kind, (pattern, _) in ELEMENT_KINDS.items()
}


class ChannelName(NamedTuple):
    """The parts of a channel name."""

    kind: str
    index: int | None  # from 1, base to tip; None for the tip and the surroundings
    axis: Axis | None
    finger: int | None  # from 1; None outside a hand
    element: str | None = None  # of an MJCF


@lru_cache(maxsize=4096)
def parse_channel_name(name: str) -> ChannelName:
    """Return the parts of a channel name. Raises DataError, listing the grammar, for a name outside it."""
    for kind, pattern in _GRAMMAR.items():
        if match := pattern.fullmatch(name):
            parts = {part: text for part, text in match.groupdict().items() if text}
            index, finger = (int(parts[part]) if part in parts else None for part in ("index", "finger"))
            return ChannelName(kind, index, cast(Axis | None, parts.get("axis")), finger)
    for kind, grammar in _ELEMENT_GRAMMAR.items():
        if match := grammar.fullmatch(name):
            parts = match.groupdict()
            return ChannelName(kind, None, cast(Axis | None, parts.get("axis")), None, parts["element"])
    raise DataError(f"{short_repr(name)} is no channel name; allowed: {ALLOWED_NAMES} (indices from 1)")


def pattern_of(kind: str) -> str:
    """Return the pattern of the names of a kind, with # for an index, @, % or & for an axis and NAME for an element."""
    return (CHANNEL_KINDS | DERIVED_KINDS | ELEMENT_KINDS)[kind][0]


@dataclass(frozen=True)
class Channel:
    """One measured quantity: its name, role, unit in the file, and standard deviation in SI.

    The name is the column's. It says what the column is unless `quantity` does. A reading counts as reading * `factor` + `offset`,
    in `unit`.

    Raises DataError for a name outside the grammar, an unknown role or unit, and noise that is not positive.
    """

    name: str
    role: Role
    unit: str  # as declared; values inside the program are in `si_unit`
    noise: float | None = None  # one standard deviation, in `si_unit`; None where none is declared
    quantity: str = ""
    factor: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        parse_channel_name(self.means)
        if not (math.isfinite(self.factor) and self.factor != 0.0 and math.isfinite(self.offset)):
            raise DataError(
                f"scale {self.factor!r}, offset {self.offset!r} of {self.name}; finite numbers are needed, no scale of 0"
            )
        if self.role not in get_args(Role):
            raise DataError(f"role {short_repr(self.role)} of {self.name}; allowed: {', '.join(get_args(Role))}")
        unit_scale(self.unit, self.si_unit)  # raises for a unit of another dimension
        if self.noise is not None and not (math.isfinite(self.noise) and self.noise > 0.0):
            raise DataError(f"noise {self.noise!r} of {self.name} is not positive; write one standard deviation or leave it out")

    @property
    def means(self) -> str:
        """What the column is, a name of the grammar."""
        return self.quantity or self.name

    @property
    def kind(self) -> str:
        """The kind of quantity: a key of `CHANNEL_KINDS`, `DERIVED_KINDS` or `ELEMENT_KINDS`."""
        return parse_channel_name(self.means).kind

    @property
    def index(self) -> int | None:
        """The number of the tendon, disk, sensor ..., from 1, base to tip."""
        return parse_channel_name(self.means).index

    @property
    def axis(self) -> Axis | None:
        """The coordinate of a position in the base frame."""
        return parse_channel_name(self.means).axis

    @property
    def finger(self) -> int | None:
        """The finger of a hand, from 1."""
        return parse_channel_name(self.means).finger

    @property
    def si_unit(self) -> str:
        """The unit of the values inside the program."""
        if self.kind in ELEMENT_KINDS:
            return _fitting_unit(self.unit, ELEMENT_KINDS[self.kind][1])
        return (CHANNEL_KINDS | DERIVED_KINDS)[self.kind][1]

    @property
    def unit_scale(self) -> Scale:
        """The conversion of a number in the declared unit to SI and back."""
        return unit_scale(self.unit, self.si_unit)

    @property
    def scale(self) -> Scale:
        """The conversion of a reading to SI and back, with its factor and offset."""
        plain = self.unit_scale
        if self.factor == 1.0 and self.offset == 0.0:
            return plain
        return Scale(plain.numerator * self.factor, plain.denominator, float(plain.to_si(self.offset)))


@lru_cache(maxsize=1024)
def _fitting_unit(unit: str, si_units: tuple[str, ...]) -> str:
    """Return the SI unit of the dimension of `unit`, or the first: the conversion to that then says what is wrong."""
    for si in si_units:
        try:
            unit_scale(unit, si)
        except DataError:
            continue
        return si
    return si_units[0]
