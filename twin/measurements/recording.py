"""Recordings: trials of a robot, measured, simulated or predicted, in SI units and read-only.

All parts of the program exchange data as recordings; `source` says where one comes from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

import numpy as np

from twin.foundation.errors import DataError, UnknownNameError
from twin.measurements.channels import Channel, Role
from twin.measurements.fingerprint import recording_hash

Condition = float | np.ndarray  # a scalar or (3,), SI

START_POSE = "start_pose"  # a trial's condition: the keyframe of its model that it starts from
EXTERNAL_CONTACT = "external_contact"  # a trial's condition: something, mostly a hand, pushes the robot with an unknown force


def read_only(values: Any, dtype: type = float) -> np.ndarray:
    """Return `values` as a read-only array, copied unless it is one already."""
    array = np.asarray(values, dtype)
    if array.flags.writeable or array.base is not None:
        array = array.copy()
        array.setflags(write=False)
    return array


class _PickledByConstructor:
    """Base that pickles and copies through the constructor, so that a copy in another process is read-only too."""

    def __reduce__(self) -> tuple[Any, ...]:
        values = (getattr(self, each.name) for each in fields(self))  # type: ignore[arg-type]
        return type(self), tuple(dict(value) if isinstance(value, MappingProxyType) else value for value in values)


@dataclass(frozen=True, eq=False)
class Clouds(_PickledByConstructor):
    """The point clouds of one trial; frame f is `points[offsets[f]:offsets[f + 1]]`.

    Raises DataError for shapes or offsets that do not match, non-finite points, or time that does not increase.
    """

    points: np.ndarray  # (M, 3) m, base frame
    offsets: np.ndarray  # (F + 1,) integers, from 0 to M
    time: np.ndarray  # (F,) s

    def __post_init__(self) -> None:
        for name, dtype in (("points", float), ("offsets", np.int64), ("time", float)):
            object.__setattr__(self, name, read_only(getattr(self, name), dtype))
        points, offsets, time = self.points, self.offsets, self.time
        if points.ndim != 2 or points.shape[1] != 3:
            raise DataError(f"cloud points have shape {points.shape}; (M, 3) is needed, in metres")
        if time.ndim != 1 or offsets.shape != (len(time) + 1,):
            raise DataError(f"cloud offsets have shape {offsets.shape} and time {time.shape}; (F + 1,) and (F,) are needed")
        if offsets[0] != 0 or offsets[-1] != len(points) or np.any(np.diff(offsets) < 0):
            raise DataError(f"cloud offsets must rise from 0 to the number of points, {len(points)}")
        if not np.all(np.isfinite(points)):
            raise DataError("cloud points hold NaN or infinity; leave such points out")
        if not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
            raise DataError("cloud time must be finite and strictly increasing, in seconds")


@dataclass(frozen=True, eq=False)
class Trial(_PickledByConstructor):
    """One run from rest: samples of every channel over time, and the conditions.

    Raises DataError unless time increases and every channel has one value a sample.
    """

    name: str  # its file, relative to the set's folder, with forward slashes
    time: np.ndarray  # (n,) s, strictly increasing
    values: Mapping[str, np.ndarray]  # channel -> (n,) SI; NaN is a missing value
    conditions: Mapping[str, Condition] = field(default_factory=dict)  # SI: tip_payload, ambient_temperature, gravity, tip_force
    other: Mapping[str, object] = field(default_factory=dict)  # unknown conditions, as written
    start: float | None = None  # s since the first trial
    clouds: Clouds | None = None

    def __post_init__(self) -> None:
        time = read_only(self.time)
        values = {name: read_only(column) for name, column in self.values.items()}
        if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
            raise DataError(f"time of trial {self.name} must be finite and strictly increasing, in seconds")
        for name, column in values.items():
            if column.shape != time.shape:
                raise DataError(f"{name} of trial {self.name} has shape {column.shape}; its time has {time.shape}")
        known = {name: value if np.ndim(value) == 0 else read_only(value) for name, value in self.conditions.items()}
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", MappingProxyType(values))
        object.__setattr__(self, "conditions", MappingProxyType(known))
        object.__setattr__(self, "other", MappingProxyType(dict(self.other)))

    @property
    def label(self) -> str:
        """The file's name without its ending, as reports print it."""
        path = PurePosixPath(self.name)
        return str(path.with_suffix("")) if path.suffix.lower() in (".csv", ".parquet") else self.name


@dataclass(frozen=True, eq=False)
class Recording(_PickledByConstructor):
    """Trials of one robot with the same channels.

    Raises DataError for a channel declared twice and for a trial whose values are not those of the channels.
    """

    robot: str
    title: str
    source: str  # "hardware", "simulation", free text after a colon
    gravity: np.ndarray | None  # (3,) m/s^2 in the base frame; None: the robot's own
    channels: tuple[Channel, ...]
    trials: tuple[Trial, ...]
    folder: Path | None = None  # from which it was read
    notices: tuple[str, ...] = ()  # remarks for the user

    def __post_init__(self) -> None:
        names = [channel.name for channel in self.channels]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise DataError(f"channel {twice} is declared twice; declare it once")
        for trial in self.trials:
            if odd := set(names) ^ set(trial.values):
                raise DataError(f"trial {trial.name} and the channels differ in {', '.join(sorted(odd))}; they must agree")
        if self.gravity is not None:
            object.__setattr__(self, "gravity", read_only(self.gravity))
            if self.gravity.shape != (3,) or not np.all(np.isfinite(self.gravity)):
                raise DataError(f"gravity {self.gravity.tolist()} is no three-vector of finite numbers, in m/s^2")

    def inputs(self) -> tuple[Channel, ...]:
        """Return the channels that drive the twin."""
        return self._with_role("input")

    def outputs(self) -> tuple[Channel, ...]:
        """Return the channels that are compared with the twin."""
        return self._with_role("output")

    def contexts(self) -> tuple[Channel, ...]:
        """Return the channels of known surroundings."""
        return self._with_role("context")

    def _with_role(self, role: Role) -> tuple[Channel, ...]:
        return tuple(channel for channel in self.channels if channel.role == role)

    @property
    def n_samples(self) -> int:
        """The number of samples of all trials together."""
        return sum(len(trial.time) for trial in self.trials)

    def select(self, trials: Iterable[int | str]) -> Recording:
        """Return the recording with these trials only, by index, file name or label, in the given order.

        Raises UnknownNameError for a trial that does not exist.
        """
        by_name = {key: trial for trial in self.trials for key in (trial.label, trial.name)}
        chosen = []
        for each in trials:
            if isinstance(each, str):
                trial = by_name.get(each)
            else:
                trial = self.trials[each] if -len(self.trials) <= each < len(self.trials) else None
            if trial is None:
                raise UnknownNameError("trial", str(each), [trial.label for trial in self.trials])
            chosen.append(trial)
        return replace(self, trials=tuple(chosen))

    def with_values(self, values: Sequence[Mapping[str, np.ndarray]], source: str) -> Recording:
        """Return the recording with other values: one mapping channel -> (n,) SI for each trial; other channels keep theirs.

        Raises UnknownNameError for a name that is no channel, DataError unless there is one mapping for each trial.
        """
        if len(values) != len(self.trials):
            raise DataError(f"values for {len(values)} trials, but the recording has {len(self.trials)}")
        names = [channel.name for channel in self.channels]
        if unknown := sorted({name for new in values for name in new} - set(names)):
            raise UnknownNameError("channel", unknown[0], names)
        changed = (replace(trial, values={**trial.values, **new}) for trial, new in zip(self.trials, values, strict=True))
        return replace(self, source=source, trials=tuple(changed))

    def data_hash(self) -> str:
        """Return the SHA-256 of channels, gravity and trials; title, folder, source and notices do not count."""
        return recording_hash(self)
