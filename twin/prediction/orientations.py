"""Orientations among a recording's outputs: quaternions, or roll, pitch and yaw, compared as rotation vectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twin.body import Body, orientation
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording
from twin.measurements.channels import ANGLES, QUATERNION
from twin.measurements.recording import Trial

QUATERNION_TO_ANGLE = 2.0  # an error of a unit quaternion's component is half that of the rotation


@dataclass(frozen=True)
class Orientation:
    """The channels that together are the orientation of a place of the body, and the three that are compared in their stead."""

    channels: tuple[Channel, ...]  # qw, qx, qy, qz, or roll, pitch, yaw
    turns: tuple[Channel, ...]  # the rotation vector's x, y, z
    index: int  # of the place, as in `Signals.group("turn")`

    def measured(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the rotation vectors (n, 3) rad of a trial's readings."""
        read = np.column_stack([values[c.name] for c in self.channels])
        return (orientation.from_quaternions if len(self.channels) == len(QUATERNION) else orientation.from_angles)(read)

    def readings(self, turn: np.ndarray) -> dict[str, np.ndarray]:
        """Return the channels' readings of rotation vectors (n, 3) rad."""
        found = (orientation.quaternions if len(self.channels) == len(QUATERNION) else orientation.angles)(turn)
        return {c.name: column for c, column in zip(self.channels, found.T, strict=True)}


def orientations(recording: Recording, body: Body) -> tuple[Orientation, ...]:
    """Return the orientations among the outputs that the body can show. Raises DataError for a part of a quaternion."""
    by_place: dict[str, dict[str, Channel]] = {}
    for channel in recording.outputs():
        place, _, axis = channel.means.rpartition("_")
        if axis in (*QUATERNION, *ANGLES) and f"{place}_turn_x" in body.senses:
            by_place.setdefault(place, {})[axis] = channel
    found = []
    for place, axes in by_place.items():
        quaternion = [axes[a] for a in QUATERNION if a in axes]
        if quaternion and len(quaternion) < len(QUATERNION):
            raise DataError(
                f"{', '.join(c.name for c in quaternion)}: an orientation of {place} needs all of {', '.join(QUATERNION)}; add "
                "the others, or give these the role 'context'"
            )
        channels = quaternion or [axes[a] for a in ANGLES if a in axes]
        if len(channels) < len(ANGLES):
            continue  # single angles are compared as such
        noises = [c.noise * (QUATERNION_TO_ANGLE if quaternion else 1.0) for c in channels if c.noise is not None]
        noise = float(np.mean(noises)) if len(noises) == len(channels) else None
        turns = tuple(Channel(f"{place}_turn_{a}", "output", "deg", noise) for a in "xyz")
        found.append(Orientation(tuple(channels), turns, body.senses[f"{place}_turn_x"].index))
    return tuple(found)


def measured_columns(found: Sequence[Orientation], trial: Trial) -> list[np.ndarray]:
    """Return the rotation vectors (n, 3) rad of each orientation in a trial."""
    return [o.measured(trial.values) for o in found]
