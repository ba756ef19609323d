"""LeRobot datasets (v3, and v2 which has a file an episode): features of meta/info.json in Parquet, one take an episode."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.streams import Clock, Log, Stream, Take
from twin.measurements.logs.tables.columns import list_entries, stream_of_table
from twin.measurements.logs.tables.parquet import read_parquet_table
from twin.measurements.logs.tables.text_files import read_text

INFO_FILE = Path("meta") / "info.json"
STREAM, EPISODE, FRAME_CLOCK = "frames", "episode_index", "frame_index / fps"


def read_lerobot(folder: Path) -> Log:
    """Return the log of a LeRobot dataset. Raises DataError for one without info, data or episodes."""
    try:
        info = json.loads(read_text(folder / INFO_FILE)[0])
        features, rate = dict(info.get("features", {})), float(info.get("fps") or 0.0)
    except (ValueError, TypeError, AttributeError, RecursionError) as fault:
        raise DataError(f"{folder / INFO_FILE}: no LeRobot info ({short_repr(str(fault))}); correct the file") from None
    files = sorted(folder.glob("data/**/*.parquet"))
    if not files:
        raise DataError(f"{folder}: no data/*/*.parquet; download the data of the dataset, too")
    tables = [_flat(read_parquet_table(file), features) for file in files]
    try:
        table = pa.concat_tables(tables, promote_options="default")
    except pa.ArrowException as fault:
        raise DataError(f"{folder}: its files differ in columns ({short_repr(str(fault))}); correct the dataset") from None
    if EPISODE not in table.column_names or table.num_rows == 0:
        raise DataError(f"{folder}: no column {EPISODE} or no row in data; correct the dataset")
    stream = stream_of_table(STREAM, "LeRobot frames", table)
    notes = [f"LeRobot {info.get('codebase_version', '?')}, robot {info.get('robot_type', '?')!r}, {rate:g} frames a second"]
    if pictures := [name for name, each in features.items() if _holds_pictures(each)]:
        notes.append(f"pictures are not read: {', '.join(pictures)}")
    return Log(folder, "LeRobot dataset", _episodes(_with_frame_clock(stream, rate)), tuple(notes))


def _holds_pictures(feature: Any) -> bool:
    return isinstance(feature, dict) and feature.get("dtype") in ("video", "image")


def _flat(table: pa.Table, features: dict[str, Any]) -> pa.Table:
    """Return a table whose lists are columns, named as info.json names their entries."""
    columns: dict[str, pa.ChunkedArray] = {}
    for name, values in zip(table.column_names, table.columns, strict=True):
        names = _names(features.get(name))
        if pa.types.is_nested(values.type) and not pa.types.is_struct(values.type):
            columns |= dict(list_entries(name, values, names))
        elif len(names) == 1 and name.startswith(("action", "observation")):
            columns[f"{name}[{names[0]}]"] = values
        else:
            columns[name] = values
    return pa.table(columns)


def _names(feature: Any) -> list[str]:
    """Return the names of a feature's entries: a list, or lists inside a table such as {"motors": [...]}."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        names = [each for part in names.values() if isinstance(part, list) for each in part]
    return [str(each) for each in names] if isinstance(names, list) else []


def _with_frame_clock(stream: Stream, rate: float) -> Stream:
    """Add the exact clock frame_index / fps: time stamps are stored in 32 bits."""
    frames = stream.fields.get("frame_index")
    if frames is None or rate <= 0.0:
        return stream
    ticks = frames.values.astype(float) / rate
    stamps = stream.fields.get("timestamp")
    agrees = stamps is None or np.all(np.abs(stamps.values - ticks) < 1e-4 + 1e-6 * ticks)  # LeRobot's own tolerance
    clocks = dict(stream.clocks)
    exact = {FRAME_CLOCK: Clock(ticks, "s")}
    clocks = {**exact, **clocks} if agrees else {**clocks, **exact}
    clocks |= {"timestamp": Clock(stamps.values, "s")} if stamps is not None else {}
    return Stream(stream.name, stream.kind, stream.fields, clocks, stream.count, stream.remarks)


def _episodes(stream: Stream) -> list[Take]:
    numbers = stream.fields[EPISODE].values
    takes = []
    for episode in np.unique(numbers):
        part = stream.rows(np.flatnonzero(numbers == episode))
        takes.append(Take(f"episode_{int(episode)}", {STREAM: part}))
    return takes
