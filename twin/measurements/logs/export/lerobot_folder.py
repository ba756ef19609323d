"""A measurement set as a LeRobot v3 dataset: an episode a trial, inputs as `action`, outputs as `observation.state`, in SI.

Layout: https://huggingface.co/docs/lerobot/lerobot-dataset-v3. Numbers are float64;
`timestamp` is frame_index / fps in float32, as there. LeRobot knows neither empty cells nor uneven steps:
sets with either are refused unless a rate is given.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import written_whole
from twin.measurements.channels import Channel, Role
from twin.measurements.logs.export.even_steps import at_even_steps
from twin.measurements.recording import Recording, Trial

VERSION, STEP_TOLERANCE = "v3.0", 1e-4  # s: LeRobot's own
FEATURES: dict[str, Role] = {"action": "input", "observation.state": "output", "observation.environment_state": "context"}
_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_INDICES = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}


def write_lerobot(recording: Recording, folder: Path, rate: float | None = None) -> None:
    """Write a recording as a LeRobot dataset, whole or not at all.

    With a `rate` (frames a second) it is resampled as `at_even_steps` says. Raises DataError for a folder that holds something, and
    without a rate for a channel with an empty cell and trials of uneven steps.
    """
    if rate is None:
        _check_complete(recording)
        rate = _even_rate(recording)
    else:
        recording = at_even_steps(recording, rate)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise DataError(f"{folder}: holds something already and is not overwritten; name a new folder")
        with written_whole(folder) as draft:
            _write(recording, rate, draft)
    except (OSError, pa.ArrowException) as fault:
        raise DataError(f"{folder}: cannot be written ({short_repr(str(fault))}); choose another place") from None


def _even_rate(recording: Recording) -> float:
    """Return the frames a second of all trials. Raises DataError for steps that differ by more than LeRobot accepts."""
    steps = np.concatenate([np.diff(trial.time) for trial in recording.trials])
    if len(steps) == 0:
        raise DataError("trials of one row have no rate; LeRobot needs one")
    rate = 1.0 / float(np.median(steps))
    rate = float(round(rate)) if abs(rate - round(rate)) < 1e-6 * rate else rate
    for trial in recording.trials:
        off = np.abs(trial.time - trial.time[0] - np.arange(len(trial.time)) / rate)
        if (worst := int(np.argmax(off))) and off[worst] > STEP_TOLERANCE:
            raise DataError(
                f"{trial.name}, row {worst + 2}: {off[worst]:.3g} s off an even rate of {rate:.6g} a second; LeRobot allows "
                f"{STEP_TOLERANCE:g} s: give --rate {rate:.3g} to resample it"
            )
    return rate


def _check_complete(recording: Recording) -> None:
    for trial in recording.trials:
        for name, values in trial.values.items():
            if empty := int(np.count_nonzero(np.isnan(values))):
                raise DataError(
                    f"{trial.name}: {empty} empty cells in {name}; LeRobot has none; give --rate 50, say, to resample it"
                )


def _write(recording: Recording, rate: float, folder: Path) -> None:
    groups = {feature: [c for c in recording.channels if c.role == role] for feature, role in FEATURES.items()}
    groups = {feature: channels for feature, channels in groups.items() if channels}
    columns = {feature: _matrix(recording.trials, channels) for feature, channels in groups.items()}
    lengths = [len(trial.time) for trial in recording.trials]
    frames = np.concatenate([np.arange(length) for length in lengths])
    indices = {
        "timestamp": (frames / rate).astype(np.float32), "frame_index": frames,
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
        "index": np.arange(len(frames)), "task_index": np.zeros(len(frames), np.int64),
    }  # fmt: skip
    table = pa.table({name: _column(values) for name, values in columns.items()} | {k: pa.array(v) for k, v in indices.items()})
    _write_parquet(folder / _DATA_PATH.format(chunk_index=0, file_index=0), table)
    task = recording.title.strip() or "twin"
    _write_parquet(folder / "meta/tasks.parquet", _tasks(task))
    _write_parquet(folder / "meta/episodes/chunk-000/file-000.parquet", _episodes(lengths, task, columns))
    info = _info(recording, rate, groups, lengths)
    (folder / "meta/info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
    stats = {name: _stats(values) for name, values in (columns | {k: v[:, None] for k, v in indices.items()}).items()}
    (folder / "meta/stats.json").write_text(json.dumps(stats, indent=4), encoding="utf-8")


def _matrix(trials: Sequence[Trial], channels: Sequence[Channel]) -> np.ndarray:
    """Return (frames, channels) in SI."""
    return np.concatenate([np.stack([trial.values[channel.name] for channel in channels], axis=1) for trial in trials])


def _column(values: np.ndarray) -> pa.Array:
    """Return a feature as LeRobot stores it: a list a frame, but a plain number where it has one entry."""
    if values.shape[1] == 1:
        return pa.array(values[:, 0])
    offsets = pa.array(np.arange(0, values.size + 1, values.shape[1], dtype=np.int32))
    return pa.ListArray.from_arrays(offsets, pa.array(values.ravel()))


def _tasks(task: str) -> pa.Table:
    """Return the tasks as pandas would write them, the text as the index."""
    index = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    number = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    about = {"index_columns": ["task"], "column_indexes": [], "columns": [number, index], "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task])})
    return table.replace_schema_metadata({"pandas": json.dumps(about)})


def _episodes(lengths: Sequence[int], task: str, columns: dict[str, np.ndarray]) -> pa.Table:
    ends = np.cumsum(lengths)
    count = len(lengths)
    zeros = np.zeros(count, np.int64)
    found: dict[str, Any] = {
        "episode_index": np.arange(count), "tasks": [[task]] * count, "length": np.array(lengths), "data/chunk_index": zeros,
        "data/file_index": zeros, "dataset_from_index": ends - lengths, "dataset_to_index": ends,
        "meta/episodes/chunk_index": zeros, "meta/episodes/file_index": zeros,
    }  # fmt: skip
    for name, values in columns.items():
        parts = [_stats(values[end - length : end]) for end, length in zip(ends, lengths, strict=True)]
        found |= {f"stats/{name}/{key}": [part[key] for part in parts] for key in ("min", "max", "mean", "std", "count")}
    return pa.table(found)


def _stats(values: np.ndarray) -> dict[str, Any]:
    numbers = values.astype(float)
    of_columns = {"min": numbers.min(axis=0), "max": numbers.max(axis=0), "mean": numbers.mean(axis=0), "std": numbers.std(axis=0)}
    return {name: each.tolist() for name, each in of_columns.items()} | {"count": [len(values)]}


def _info(recording: Recording, rate: float, groups: dict[str, list[Channel]], lengths: Sequence[int]) -> dict[str, Any]:
    features: dict[str, Any] = {
        name: {"dtype": "float64", "shape": [len(channels)], "names": [channel.means.replace("/", "_") for channel in channels]}
        for name, channels in groups.items()
    }
    features |= {name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in _INDICES.items()}
    return {
        "codebase_version": VERSION, "robot_type": recording.robot, "total_episodes": len(lengths),
        "total_frames": int(sum(lengths)), "total_tasks": 1, "chunks_size": 1000, "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": int(rate) if rate == int(rate) else rate, "splits": {"train": f"0:{len(lengths)}"}, "data_path": _DATA_PATH,
        "video_path": None, "features": features,
    }  # fmt: skip


def _write_parquet(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pyarrow.parquet.write_table(table, path, compression="snappy")
