"""Demonstrations in the layout of LeRobot's datasets, version 3.0: one Parquet file an episode, and what describes them.

    data/chunk-000/file-000.parquet    frames: observation.state, observation.resistance (ohm), observation.encoder (m), action,
                                       object.pose (m, quaternion; for scoring), timestamp, frame_index, episode_index, index,
                                       task_index
    meta/info.json, meta/stats.json, meta/tasks.parquet, meta/episodes/chunk-000/file-000.parquet

Written by pyarrow: LeRobot's own library (0.4.4, the last for Python 3.11) asks for a torch below 2.11, which the estimators here
are not trained with. `observation.state` is the shape of all fingers, coordinates of its modes, m; `action` how it changes to the
next frame.

Source: huggingface/lerobot, `datasets/io_utils.py` and `dataset_writer.py`.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.errors import DataError

VERSION = "v3.0"
CHUNK = 1000  # episodes
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
COUNTED = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}


def write_episode(folder: Path, episode: int, frames: dict[str, np.ndarray], fps: int) -> None:
    """Columns (n, width) of one episode; `index` follows when all are there. Whole or not at all."""
    n = len(next(iter(frames.values())))
    columns = {name: lists(values) for name, values in frames.items()}
    counted = (np.arange(n) / fps, np.arange(n), np.full(n, episode), np.zeros(n), np.zeros(n))
    for (name, kind), values in zip(COUNTED.items(), counted, strict=True):
        columns[name] = pa.array(values.astype(kind))
    write(_path(folder, episode), pa.table(columns))


def write_meta(folder: Path, task: str, robot: str, fps: int) -> None:
    """Number the frames through, and describe the episodes that are there."""
    paths = _paths(folder)
    tables, first = [], 0
    for path in paths:
        table = pq.read_table(path)
        index = pa.array(np.arange(first, first + len(table)))
        table = table.set_column(table.schema.get_field_index("index"), "index", index)
        write(path, table)
        tables.append(table)
        first += len(table)
    lengths = np.array([len(t) for t in tables])
    features = {
        f.name: {"dtype": COUNTED.get(f.name, "float32"), "shape": [_width(f.type)], "names": None} for f in tables[0].schema
    }
    info = {
        "codebase_version": VERSION, "robot_type": robot, "total_episodes": len(paths), "total_frames": int(first),
        "total_tasks": 1, "chunks_size": CHUNK, "data_files_size_in_mb": 100, "video_files_size_in_mb": 200, "fps": fps,
        "splits": {"train": f"0:{len(paths)}"}, "data_path": DATA, "video_path": None, "features": features,
    }  # fmt: skip
    whole = {name: np.concatenate([array(t[name]) for t in tables]).astype(float) for name in features}
    _text(folder / "meta/stats.json", {name: _stats(values) for name, values in whole.items()})
    columns = [_pandas("task_index", "int64", "int64"), _pandas("task", "unicode", "object")]
    words = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    tasks = pa.table({"task_index": pa.array([0]), "task": pa.array([task])}).replace_schema_metadata({"pandas": json.dumps(words)})
    write(folder / "meta/tasks.parquet", tasks)
    write(folder / EPISODES, _episodes(lengths, task))
    _text(folder / "meta/info.json", info)


def read_episodes(folder: Path, names: tuple[str, ...]) -> list[dict[str, np.ndarray]]:
    """Columns (n, width) of every episode. Raises DataError where there are none or one cannot be read."""
    try:
        tables = [pq.read_table(path, columns=list(names)) for path in _paths(folder)]
    except (OSError, pa.ArrowInvalid) as fault:
        raise DataError(f"{folder}: an episode cannot be read ({fault}); make the demonstrations again") from None
    return [{name: array(table[name]).astype(float) for name in names} for table in tables]


def _paths(folder: Path) -> list[Path]:
    paths = sorted(folder.glob("data/chunk-*/file-*.parquet"))
    if not paths:
        raise DataError(f"{folder}: no episodes there; make them with twin demonstrate")
    return paths


def _path(folder: Path, episode: int) -> Path:
    return folder / DATA.format(chunk_index=episode // CHUNK, file_index=episode % CHUNK)


def _episodes(lengths: np.ndarray, task: str) -> pa.Table:
    n = len(lengths)
    ends, zero = np.cumsum(lengths), np.zeros(n, int)
    return pa.table({
        "episode_index": np.arange(n), "tasks": pa.array([[task]] * n), "length": lengths,
        "data/chunk_index": np.arange(n) // CHUNK, "data/file_index": np.arange(n) % CHUNK,
        "dataset_from_index": ends - lengths, "dataset_to_index": ends,
        "meta/episodes/chunk_index": zero, "meta/episodes/file_index": zero,
    })  # fmt: skip


def _stats(values: np.ndarray) -> dict[str, list[float]]:
    x = values.reshape(len(values), -1)
    found = {"min": x.min(axis=0), "max": x.max(axis=0), "mean": x.mean(axis=0), "std": x.std(axis=0), "count": np.array([len(x)])}
    return {name: value.tolist() for name, value in found.items()}


def _pandas(name: str, kind: str, numpy: str) -> dict[str, str | None]:
    return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}


def lists(values: np.ndarray) -> pa.Array:
    return pa.FixedSizeListArray.from_arrays(pa.array(values.astype(np.float32).ravel()), values.shape[1])


def array(column: pa.ChunkedArray) -> np.ndarray:
    whole = column.combine_chunks()
    if pa.types.is_fixed_size_list(whole.type):
        return whole.flatten().to_numpy(zero_copy_only=False).reshape(len(whole), -1)
    return whole.to_numpy(zero_copy_only=False)


def _width(kind: pa.DataType) -> int:
    return kind.list_size if pa.types.is_fixed_size_list(kind) else 1


def write(path: Path, rows: pa.Table, split: bool = False) -> None:
    """Whole or not at all. `split`: bytes of a kind together, by which numbers that all differ take two thirds of the space."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    pq.write_table(rows, part, compression="zstd", use_dictionary=not split, use_byte_stream_split=split)
    part.replace(path)


def _text(path: Path, content: object) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    part.replace(path)
