"""Channel names: their grammar, and the channels they declare.

    [finger_N_] tendon_I_(tension|displacement) | sma_I_(current|voltage|temperature|resistance) | ambient_temperature
              | disk_K_(x|y|z) | marker_K_(x|y|z) | tip_(x|y|z) | sensor_I_resistance | joint_I_(angle|torque)

Indices count from 1, base to tip, and are written without leading zeros.
"""

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, cast, get_args

from twin.foundation.errors import DataError, short_repr
from twin.foundation.units import Scale, unit_scale

Role = Literal["input", "output", "context"]
Axis = Literal["x", "y", "z"]

# kind -> (pattern with # for the index and @ for the axis, SI unit)
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
    "sensor_resistance": ("sensor_#_resistance", "ohm"),
    "joint_angle": ("joint_#_angle", "rad"),
    "joint_torque": ("joint_#_torque", "N*m"),
}
DERIVED_KINDS: dict[str, tuple[str, str]] = {"skin": ("skin_#", "m")}  # made from point clouds (`patches.py`), not read
ALLOWED_NAMES = ", ".join(
    pattern.replace("#", "K" if "@" in pattern else "I").replace("@", "x|y|z") for pattern, _ in CHANNEL_KINDS.values()
) + ", each also as finger_N_..."  # fmt: skip
_INDEX = "[1-9][0-9]{0,3}"
_GRAMMAR = {
    kind: re.compile(
        f"(?:finger_(?P<finger>{_INDEX})_)?" + pattern.replace("#", f"(?P<index>{_INDEX})").replace("@", "(?P<axis>[xyz])")
    )
    for kind, (pattern, _) in (CHANNEL_KINDS | DERIVED_KINDS).items()
}


class ChannelName(NamedTuple):
    """The parts of a channel name."""

    kind: str
    index: int | None  # from 1, base to tip; None for the tip and the surroundings
    axis: Axis | None
    finger: int | None  # from 1; None outside a hand


@lru_cache(maxsize=4096)
def parse_channel_name(name: str) -> ChannelName:
    """Return the parts of a channel name. Raises DataError, listing the grammar, for a name outside it."""
    for kind, pattern in _GRAMMAR.items():
        if match := pattern.fullmatch(name):
            parts = {part: text for part, text in match.groupdict().items() if text}
            index, finger = (int(parts[part]) if part in parts else None for part in ("index", "finger"))
            return ChannelName(kind, index, cast(Axis | None, parts.get("axis")), finger)
    raise DataError(f"{short_repr(name)} is no channel name; allowed: {ALLOWED_NAMES} (indices from 1)")


@dataclass(frozen=True)
class Channel:
    """One measured quantity: its name, role, unit in the file, and standard deviation in SI.

    Raises DataError for a name outside the grammar, an unknown role or unit, and noise that is not positive.
    """

    name: str
    role: Role
    unit: str  # as declared; values inside the program are in `si_unit`
    noise: float | None = None  # one standard deviation, in `si_unit`; None where none is declared

    def __post_init__(self) -> None:
        parse_channel_name(self.name)
        if self.role not in get_args(Role):
            raise DataError(f"role {short_repr(self.role)} of {self.name}; allowed: {', '.join(get_args(Role))}")
        unit_scale(self.unit, self.si_unit)
        if self.noise is not None and not (math.isfinite(self.noise) and self.noise > 0.0):
            raise DataError(f"noise {self.noise!r} of {self.name} is not positive; write one standard deviation or leave it out")

    @property
    def kind(self) -> str:
        """The kind of quantity: a key of `CHANNEL_KINDS` or `DERIVED_KINDS`."""
        return parse_channel_name(self.name).kind

    @property
    def index(self) -> int | None:
        """The number of the tendon, disk, sensor ..., from 1, base to tip."""
        return parse_channel_name(self.name).index

    @property
    def axis(self) -> Axis | None:
        """The coordinate of a position in the base frame."""
        return parse_channel_name(self.name).axis

    @property
    def finger(self) -> int | None:
        """The finger of a hand, from 1."""
        return parse_channel_name(self.name).finger

    @property
    def si_unit(self) -> str:
        """The unit of the values inside the program."""
        return (CHANNEL_KINDS | DERIVED_KINDS)[self.kind][1]

    @property
    def scale(self) -> Scale:
        """The conversion from the declared unit to SI and back."""
        return unit_scale(self.unit, self.si_unit)
