"""A folder of tables: files of one layout are runs of one stream; runs are paired over streams by what their names share."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.streams import Log, Stream, Take

MAX_FILES = 2000
Reader = Callable[[Path, str], tuple[Stream, tuple[str, ...]]]


def read_folder(folder: Path, files: list[Path], reader: Reader) -> Log:
    """Return the log of a folder's tables. Raises DataError if none of its files is one."""
    if len(files) > MAX_FILES:
        raise DataError(f"{folder}: {len(files)} files; at most {MAX_FILES} are read, import them in parts")
    layouts: dict[tuple[str, ...], dict[str, Stream]] = {}
    notes: dict[str, None] = {}
    unread: dict[str, str] = {}
    for file in files:
        try:
            stream, said = reader(file, stem(file))
        except DataError as fault:
            unread[file.name] = short_repr(str(fault).removeprefix(f"{file}: "), 150)
            continue
        layouts.setdefault((stream.kind, *stream.fields), {})[stem(file)] = stream
        notes |= dict.fromkeys(said)
    if not layouts:
        raise DataError(f"{folder}: no file that can be read ({short_repr('; '.join(unread.values()), 300)}); name a log")
    return Log(
        folder, f"folder of {sum(map(len, layouts.values()))} tables", _takes(folder, list(layouts.values())), tuple(notes), unread
    )


def stem(path: Path) -> str:
    """Return a file's name without its endings: `a.csv.gz` -> `a`."""
    return re.sub(r"(\.(csv|txt|tsv|dat|log|json|jsonl|parquet|pq|gz|mcap|bag|db3))+$", "", path.name, flags=re.IGNORECASE)


def _takes(folder: Path, layouts: list[dict[str, Stream]]) -> list[Take]:
    if all(len(files) == 1 for files in layouts):
        name = next(iter(layouts[0])) if len(layouts) == 1 else folder.resolve().name
        return [Take(name, {name: stream for files in layouts for name, stream in files.items()})]
    several = sum(len(files) > 1 for files in layouts) > 1
    takes: dict[str, dict[str, Stream]] = {}
    for files in layouts:
        shared = _shared_beginning(list(files))
        name = shared.strip(" _-.") or ("table" if len(layouts) == 1 else next(iter(files)))
        for file, stream in files.items():
            key = file.removeprefix(shared) if several and len(files) > 1 else file
            called = name if len(files) > 1 else file
            takes.setdefault(key, {})[called] = replace(stream, name=called)
    return [Take(key, streams) for key, streams in sorted(takes.items(), key=lambda each: _in_order(each[0]))]


def _shared_beginning(names: list[str]) -> str:
    """Return what all names begin with, up to a sign between words."""
    if len(names) == 1:
        return names[0]
    shared = os.path.commonprefix(names)  # noqa: RUF071 - letters, not paths
    end = max((n + 1 for n, letter in enumerate(shared) if not letter.isalnum()), default=0)
    return shared if shared and not shared[-1].isalnum() else shared[:end]


def _in_order(name: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
