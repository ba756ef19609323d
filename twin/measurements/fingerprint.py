"""A recording's fingerprint: the same measured content gives the same hash on every machine."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from twin.measurements.recording import Recording


def fingerprint(recording: Recording) -> str:
    """SHA-256 over channels, gravity and trials in SI; missing values count as one NaN and -0.0 as 0.0."""
    digest = hashlib.sha256()

    def text(*parts: object) -> None:
        digest.update(repr(parts).encode("utf-8", "backslashreplace") + b"\n")

    def numbers(name: str, values: object) -> None:
        array = np.asarray(values, "<f8") + 0.0
        array[np.isnan(array)] = np.nan
        text(name, array.shape)
        digest.update(np.ascontiguousarray(array).tobytes())

    text("robot", recording.robot)
    for channel in recording.channels:
        text("channel", channel.name, channel.role, channel.si_unit, channel.noise and float(channel.noise))
    if recording.gravity is not None:
        numbers("gravity", recording.gravity)
    for trial in recording.trials:
        text("trial", trial.label, None if trial.start is None else float(trial.start), sorted(trial.other.items()))
        for name, value in sorted(trial.conditions.items()):
            numbers(name, [value])
        numbers("time", trial.time)
        for channel in recording.channels:
            numbers(channel.name, trial.values[channel.name])
        if trial.clouds is not None:
            numbers("points", trial.clouds.points)
            numbers("offsets", trial.clouds.offsets)
            numbers("cloud time", trial.clouds.time)
    return digest.hexdigest()
