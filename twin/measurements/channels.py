"""Channel names: the grammar that says what a column is, and the channel it declares.

    [finger_N_] tendon_I_(tension|displacement) | sma_I_(current|voltage|temperature|resistance) | ambient_temperature
              | disk_K_(x|y|z) | marker_K_(x|y|z) | tip_(x|y|z) | sensor_I_resistance | joint_I_(angle|torque)

Indices count from 1, base to tip, and are written without leading zeros.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple, cast, get_args

from twin.errors import DataError, shown
from twin.units import Scale, unit_scale

Role = Literal["input", "output", "context"]
Axis = Literal["x", "y", "z"]

# kind -> (pattern with # for the index and @ for the axis, SI unit)
KINDS: dict[str, tuple[str, str]] = {
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
MADE: dict[str, tuple[str, str]] = {"skin": ("skin_#", "m")}  # of point clouds (`patches.py`); no file has them
ALLOWED_NAMES = ", ".join(
    pattern.replace("#", "K" if "@" in pattern else "I").replace("@", "x|y|z") for pattern, _ in KINDS.values()
) + ", each also as finger_N_..."  # fmt: skip
_INDEX = "[1-9][0-9]{0,3}"
_GRAMMAR = {
    kind: re.compile(
        f"(?:finger_(?P<finger>{_INDEX})_)?" + pattern.replace("#", f"(?P<index>{_INDEX})").replace("@", "(?P<axis>[xyz])")
    )
    for kind, (pattern, _) in (KINDS | MADE).items()
}


class Meaning(NamedTuple):
    """What a channel name says."""

    kind: str
    index: int | None  # from 1, base to tip; None for the tip and the surroundings
    axis: Axis | None
    finger: int | None  # from 1; None outside a hand


@lru_cache(maxsize=4096)
def meaning(name: str) -> Meaning:
    """What `name` says. Raises DataError, listing the grammar, for a name outside it."""
    for kind, pattern in _GRAMMAR.items():
        if found := pattern.fullmatch(name):
            said = {part: text for part, text in found.groupdict().items() if text}
            index, finger = (int(said[part]) if part in said else None for part in ("index", "finger"))
            return Meaning(kind, index, cast(Axis | None, said.get("axis")), finger)
    raise DataError(f"{shown(name)} is no channel name; allowed: {ALLOWED_NAMES} (indices from 1)")


@dataclass(frozen=True)
class Channel:
    """One measured quantity: its name, what it is for, the unit its file declares, and one standard deviation in SI.

    Raises DataError for a name outside the grammar, an unknown role or unit, and noise that is not positive.
    """

    name: str
    role: Role
    unit: str  # as declared; values inside the program are in `si_unit`
    noise: float | None = None  # one standard deviation, in `si_unit`; None where none is declared

    def __post_init__(self) -> None:
        meaning(self.name)
        if self.role not in get_args(Role):
            raise DataError(f"role {shown(self.role)} of {self.name}; allowed: {', '.join(get_args(Role))}")
        unit_scale(self.unit, self.si_unit)
        if self.noise is not None and not (math.isfinite(self.noise) and self.noise > 0.0):
            raise DataError(f"noise {self.noise!r} of {self.name} is not positive; write one standard deviation or leave it out")

    @property
    def kind(self) -> str:
        """What is measured: a key of `KINDS`, or of `MADE`."""
        return meaning(self.name).kind

    @property
    def index(self) -> int | None:
        """Which tendon, disk, sensor ..., from 1, base to tip."""
        return meaning(self.name).index

    @property
    def axis(self) -> Axis | None:
        """Coordinate of a position in the base frame."""
        return meaning(self.name).axis

    @property
    def finger(self) -> int | None:
        """Which finger of a hand, from 1."""
        return meaning(self.name).finger

    @property
    def si_unit(self) -> str:
        """The unit of the values inside the program."""
        return (KINDS | MADE)[self.kind][1]

    @property
    def scale(self) -> Scale:
        """From the declared unit to SI and back."""
        return unit_scale(self.unit, self.si_unit)
