"""Writing of a measurement set, whole or not at all, in the units its channels declare."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import check_file_name, written_whole
from twin.measurements.conditions import PAYLOAD_AT, SCALAR_CONDITIONS
from twin.measurements.parsing.toml_text import toml_lines
from twin.measurements.read import SET_FILE, SET_FORMAT
from twin.measurements.recording import Recording, Trial

FileFormat = Literal["csv", "parquet"]


def write(recording: Recording, folder: str | Path, *, file_format: FileFormat = "csv") -> None:
    """Write measurements.toml, and a table and the clouds of each trial; `read` returns the same values.

    The files are written next to `folder` and renamed at the end, so that they appear together.

    Raises DataError for a folder that is not empty, for trial names that clash or lead out of it, and if the disk refuses it.
    """
    folder = Path(folder)
    if file_format not in ("csv", "parquet"):
        raise DataError(f"file format {file_format!r}; allowed: csv, parquet")
    labels = [check_file_name(trial.label) for trial in recording.trials]
    if len(set(labels)) < len(labels):
        raise DataError(f"{folder}: two trials have the same name; give each its own")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise DataError(f"{folder}: holds something already and is not overwritten; name a new folder or empty this one")
        with written_whole(folder) as draft:
            (draft / SET_FILE).write_text(_toml(recording, file_format), encoding="utf-8")
            for trial in recording.trials:
                _write_trial(recording, trial, draft, file_format)
    except (OSError, UnicodeError, pa.ArrowException) as fault:
        raise DataError(f"{folder}: cannot be written ({short_repr(str(fault))}); choose another place") from None


def _toml(recording: Recording, file_format: FileFormat) -> str:
    gravity = None if recording.gravity is None else recording.gravity.tolist()
    lines = toml_lines(
        {"format": SET_FORMAT, "robot": recording.robot, "title": recording.title, "source": recording.source, "gravity": gravity}
    )
    for channel in recording.channels:
        noise = None if channel.noise is None else float(channel.unit_scale.without_offset().from_si(np.array([channel.noise]))[0])
        declared = {"name": channel.name, "role": channel.role, "unit": channel.unit, "noise": noise}
        declared |= {"quantity": channel.quantity} if channel.quantity else {}
        declared |= {"scale": channel.factor, "offset": channel.offset} if (channel.factor, channel.offset) != (1.0, 0.0) else {}
        lines += ["", "[[channel]]", *toml_lines(declared)]
    for trial in recording.trials:
        cloud = None if trial.clouds is None else f"{trial.label}.clouds.npz"
        conditions: dict[str, object] = {
            name: _condition(name, value) for name, value in trial.conditions.items() if not name.startswith(PAYLOAD_AT)
        }
        if payload := {n.removeprefix(PAYLOAD_AT): f"{float(v)!r} kg" for n, v in trial.conditions.items() if n not in conditions}:
            conditions["payload"] = payload
        entry = {"file": f"{trial.label}.{file_format}", "start": trial.start, **conditions, **trial.other, "cloud": cloud}
        lines += ["", "[[trial]]", *toml_lines(entry)]
    return "\n".join(lines) + "\n"


def _condition(name: str, value: float | np.ndarray) -> object:
    return f"{float(value)!r} {SCALAR_CONDITIONS[name]}" if name in SCALAR_CONDITIONS else np.asarray(value).tolist()


def _write_trial(recording: Recording, trial: Trial, folder: Path, file_format: FileFormat) -> None:
    path = folder / f"{trial.label}.{file_format}"
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = {"time": trial.time}
    columns |= {channel.name: channel.scale.from_si(trial.values[channel.name]) for channel in recording.channels}
    if file_format == "parquet":
        pyarrow.parquet.write_table(pa.table(columns), path)
    else:
        path.write_text(_csv(columns), encoding="utf-8")
    if trial.clouds is not None:
        clouds = trial.clouds
        np.savez_compressed(folder / f"{trial.label}.clouds.npz", points=clouds.points, offsets=clouds.offsets, time=clouds.time)


def _csv(columns: Mapping[str, np.ndarray]) -> str:
    cells = [["" if value != value else repr(value) for value in column.tolist()] for column in columns.values()]
    return "\n".join([",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]) + "\n"
