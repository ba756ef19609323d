"""Read and write demonstrations in the layout of LeRobot's datasets, version 3.0: one Parquet file an episode.

    data/chunk-000/file-000.parquet    frames: observation.state, observation.resistance (ohm), observation.encoder (m), action,
                                       object.pose (m, quaternion; for scoring), timestamp, frame_index, episode_index, index,
                                       task_index
    meta/info.json, meta/stats.json, meta/tasks.parquet, meta/episodes/chunk-000/file-000.parquet

Written by pyarrow: LeRobot's own library (0.4.4, the last for Python 3.11) needs a torch below 2.11, which the estimators here are
not trained with. `observation.state` is the shape of all fingers, coordinates of its modes, m; `action` its change to the next
frame.

Source: huggingface/lerobot, `datasets/io_utils.py` and `dataset_writer.py`.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError

LEROBOT_VERSION = "v3.0"
EPISODES_PER_CHUNK = 1000  # episodes
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
INDEX_COLUMNS = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}


def write_episode(folder: Path, episode: int, frames: dict[str, np.ndarray], fps: int) -> None:
    """Write the columns (n, width) of one episode, whole or not at all; `write_meta` fills in `index`."""
    n = len(next(iter(frames.values())))
    columns = {name: fixed_lists(values) for name, values in frames.items()}
    counted = (np.arange(n) / fps, np.arange(n), np.full(n, episode), np.zeros(n), np.zeros(n))
    for (name, kind), values in zip(INDEX_COLUMNS.items(), counted, strict=True):
        columns[name] = pa.array(values.astype(kind))
    write_table(_episode_path(folder, episode), pa.table(columns))


def write_meta(folder: Path, task: str, robot: str, fps: int) -> None:
    """Number the frames through, and describe the episodes that are there."""
    paths = _episode_paths(folder)
    tables, first = [], 0
    for path in paths:
        table = pq.read_table(path)
        index = pa.array(np.arange(first, first + len(table)))
        table = table.set_column(table.schema.get_field_index("index"), "index", index)
        write_table(path, table)
        tables.append(table)
        first += len(table)
    lengths = np.array([len(t) for t in tables])
    features = {
        f.name: {"dtype": INDEX_COLUMNS.get(f.name, "float32"), "shape": [_width(f.type)], "names": None} for f in tables[0].schema
    }
    info = {
        "codebase_version": LEROBOT_VERSION, "robot_type": robot, "total_episodes": len(paths), "total_frames": int(first),
        "total_tasks": 1, "chunks_size": EPISODES_PER_CHUNK, "data_files_size_in_mb": 100, "video_files_size_in_mb": 200,
        "fps": fps, "splits": {"train": f"0:{len(paths)}"}, "data_path": DATA_PATH, "video_path": None, "features": features,
    }  # fmt: skip
    whole = {name: np.concatenate([column_array(t[name]) for t in tables]).astype(float) for name in features}
    _write_json(folder / "meta/stats.json", {name: _stats(values) for name, values in whole.items()})
    columns = [_pandas_column("task_index", "int64", "int64"), _pandas_column("task", "unicode", "object")]
    words = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    tasks = pa.table({"task_index": pa.array([0]), "task": pa.array([task])}).replace_schema_metadata({"pandas": json.dumps(words)})
    write_table(folder / "meta/tasks.parquet", tasks)
    write_table(folder / EPISODES_PATH, _episodes_table(lengths, task))
    _write_json(folder / "meta/info.json", info)


def read_episodes(folder: Path, names: tuple[str, ...]) -> list[dict[str, np.ndarray]]:
    """Read columns (n, width) of every episode. Raises DataError where there are none or one cannot be read."""
    try:
        tables = [pq.read_table(path, columns=list(names)) for path in _episode_paths(folder)]
    except (OSError, pa.ArrowInvalid) as fault:
        raise DataError(f"{folder}: an episode cannot be read ({fault}); make the demonstrations again") from None
    return [{name: column_array(table[name]).astype(float) for name in names} for table in tables]


def _episode_paths(folder: Path) -> list[Path]:
    """Return the files of all episodes. Raises DataError where there are none."""
    paths = sorted(folder.glob("data/chunk-*/file-*.parquet"))
    if not paths:
        raise DataError(f"{folder}: no episodes there; make them with twin demonstrate")
    return paths


def _episode_path(folder: Path, episode: int) -> Path:
    """Return the file of one episode."""
    return folder / DATA_PATH.format(chunk_index=episode // EPISODES_PER_CHUNK, file_index=episode % EPISODES_PER_CHUNK)


def _episodes_table(lengths: np.ndarray, task: str) -> pa.Table:
    """Return the table of the episodes' lengths and places."""
    n = len(lengths)
    ends, zero = np.cumsum(lengths), np.zeros(n, int)
    return pa.table({
        "episode_index": np.arange(n), "tasks": pa.array([[task]] * n), "length": lengths,
        "data/chunk_index": np.arange(n) // EPISODES_PER_CHUNK, "data/file_index": np.arange(n) % EPISODES_PER_CHUNK,
        "dataset_from_index": ends - lengths, "dataset_to_index": ends,
        "meta/episodes/chunk_index": zero, "meta/episodes/file_index": zero,
    })  # fmt: skip


def _stats(values: np.ndarray) -> dict[str, list[float]]:
    """Return minimum, maximum, mean, standard deviation and count of each column."""
    x = values.reshape(len(values), -1)
    found = {"min": x.min(axis=0), "max": x.max(axis=0), "mean": x.mean(axis=0), "std": x.std(axis=0), "count": np.array([len(x)])}
    return {name: value.tolist() for name, value in found.items()}


def _pandas_column(name: str, kind: str, numpy: str) -> dict[str, str | None]:
    """Return the metadata by which pandas reads a column."""
    return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}


def fixed_lists(values: np.ndarray) -> pa.Array:
    """Return values (n, width) as a column of lists of fixed size, in single precision."""
    return pa.FixedSizeListArray.from_arrays(pa.array(values.astype(np.float32).ravel()), values.shape[1])


def column_array(column: pa.ChunkedArray) -> np.ndarray:
    """Return a column as an array (n,) or (n, width)."""
    whole = column.combine_chunks()
    if pa.types.is_fixed_size_list(whole.type):
        return whole.flatten().to_numpy(zero_copy_only=False).reshape(len(whole), -1)
    return whole.to_numpy(zero_copy_only=False)


def _width(kind: pa.DataType) -> int:
    """Return how many numbers a column has in a row."""
    return kind.list_size if pa.types.is_fixed_size_list(kind) else 1


def write_table(path: Path, rows: pa.Table, split: bool = False) -> None:
    """Write a table, whole or not at all. `split`: store bytes of a kind together, a third of the space for numbers that all
    differ."""
    path.parent.mkdir(parents=True, exist_ok=True)
    options: dict[str, Any] = {"compression": "zstd", "use_dictionary": not split, "use_byte_stream_split": split}
    write_atomically(path, lambda file: pq.write_table(rows, file, **options))


def _write_json(path: Path, content: object) -> None:
    """Write a JSON file, whole or not at all."""
    write_atomically(path, (json.dumps(content, indent=1) + "\n").encode())
