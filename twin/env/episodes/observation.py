"""Observations put together from named parts, each within bounds that it cannot leave.

Commands, unit vectors and angles have bounds by what they are. Sensors have those of instruments chosen for the robot, several
times what it was seen to do at the ends of its actions; a reading beyond them saturates, as that instrument's would.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from gymnasium import spaces

# Largest size of a part, in the part's own unit.
PULL_RANGE = 4.0  # of `most`: load cells and encoders of a backbone; 1.1 was seen
PLACE_RANGE = 2.0  # of L: a robot reaches its length, the rest is for stretch and a camera that is out of place
RESISTANCE_RANGE = 10.0  # 0.1: from zero to twice that at no strain; 2.5 was seen
ENCODER_RANGE = 2.0  # of `most`, which commands do not exceed; the rest is for backlash, offsets and noise
TENSION_RANGE = 100.0  # N, of a finger's tendon; 4 N were seen
SPEED_RANGE = 100.0  # m/s and rad/s of a thing, 10 rad/s of a joint


class PartBounds(NamedTuple):
    """How many numbers a part has, and their bounds."""

    size: int
    low: float
    high: float

    @classmethod
    def within(cls, size: int, most: float) -> "PartBounds":
        """Return `size` numbers of at most this size."""
        return cls(size, -most, most)


class ObservationLayout:
    """The parts of an observation in their order."""

    def __init__(self, parts: Mapping[str, PartBounds]) -> None:
        self.parts = {name: part for name, part in parts.items() if part.size}

    def box(self, names: Collection[str]) -> spaces.Box:
        """Return the space of these parts, side by side."""
        parts = [part for name, part in self.parts.items() if name in names]
        low, high = (np.repeat([getattr(p, side) for p in parts], [p.size for p in parts]) for side in ("low", "high"))
        return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    def join(self, values: Mapping[str, np.ndarray], names: Collection[str]) -> np.ndarray:
        """Return these parts (n,), float32, each clipped to its bounds."""
        parts = [(np.ravel(values[name]), part) for name, part in self.parts.items() if name in names]
        return np.concatenate([np.clip(value, part.low, part.high).astype(np.float32) for value, part in parts])
