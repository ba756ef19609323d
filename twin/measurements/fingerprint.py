"""The hash of a recording: the same measurements give the same hash on every machine."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from twin.measurements.recording import Recording


def recording_hash(recording: Recording) -> str:
    """Return the SHA-256 over channels, gravity and trials in SI; all NaN count as one value, and -0.0 as 0.0."""
    digest = hashlib.sha256()

    def add_text(*parts: object) -> None:
        digest.update(repr(parts).encode("utf-8", "backslashreplace") + b"\n")

    def add_numbers(name: str, values: object) -> None:
        array = np.asarray(values, "<f8") + 0.0
        array[np.isnan(array)] = np.nan
        add_text(name, array.shape)
        digest.update(np.ascontiguousarray(array).tobytes())

    add_text("robot", recording.robot)
    for channel in recording.channels:
        add_text(
            "channel",
            channel.name,
            channel.role,
            channel.si_unit,
            channel.noise and float(channel.noise),
            *filter(None, [channel.quantity]),
        )
    if recording.gravity is not None:
        add_numbers("gravity", recording.gravity)
    for trial in recording.trials:
        add_text("trial", trial.label, None if trial.start is None else float(trial.start), sorted(trial.other.items()))
        for name, value in sorted(trial.conditions.items()):
            add_numbers(name, [value])
        add_numbers("time", trial.time)
        for channel in recording.channels:
            add_numbers(channel.name, trial.values[channel.name])
        if trial.clouds is not None:
            add_numbers("points", trial.clouds.points)
            add_numbers("offsets", trial.clouds.offsets)
            add_numbers("cloud time", trial.clouds.time)
    return digest.hexdigest()
