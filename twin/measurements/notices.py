"""Notices about a set that is otherwise in order, one sentence for each kind of finding."""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from twin.foundation.errors import short_repr
from twin.measurements.channels import Channel
from twin.measurements.parsing.tables import Table
from twin.measurements.recording import EXTERNAL_CONTACT, START_POSE, Trial

MAX_COLUMNS_NAMED = 5  # undeclared columns


def collect_notices(channels: Sequence[Channel], trials: Sequence[Trial], tables: Sequence[Table]) -> list[str]:
    """Return notices on undeclared columns, unknown conditions, inputs with gaps, and channels empty in a trial."""
    notices = []
    extra = _files_by_name((table.path.name, table.extra) for table in tables)
    if len(extra) > MAX_COLUMNS_NAMED:
        named = ", ".join(map(short_repr, list(extra)[:MAX_COLUMNS_NAMED]))
        files = list(dict.fromkeys(itertools.chain.from_iterable(extra.values())))
        notices.append(
            f"{len(extra)} columns are not declared in measurements.toml and not read: {named} and others ({_list_files(files)})"
        )
    else:
        for name, files in extra.items():
            notices.append(f"column {short_repr(name)} is not declared in measurements.toml and not read ({_list_files(files)})")
    for name, files in _files_by_name(
        (trial.name, trial.other.keys() - {EXTERNAL_CONTACT, START_POSE}) for trial in trials
    ).items():
        notices.append(f"condition {name!r} is not understood: the twin does not act on it ({_list_files(files)})")
    holed: dict[tuple[int, tuple[str, ...]], list[str]] = {}
    for channel in channels:
        gaps = {trial.name: int(np.count_nonzero(np.isnan(trial.values[channel.name]))) for trial in trials}
        empty = [trial.name for trial in trials if gaps[trial.name] == len(trial.time)]
        some = tuple(name for name, count in gaps.items() if count and name not in empty)
        if empty:
            notices.append(f"{channel.role} {channel.name} has no value in {_list_files(empty)}")
        if some and channel.role == "input":
            holed.setdefault((sum(gaps[name] for name in some), some), []).append(channel.name)
    for (count, files), names in holed.items():
        inputs = (
            f"input {names[0]} misses {count} values" if len(names) == 1 else f"inputs {', '.join(names)} miss {count} values each"
        )
        notices.append(f"{inputs} ({_list_files(files)})")
    return notices


def _files_by_name(found: Iterable[tuple[str, Iterable[str]]]) -> dict[str, list[str]]:
    """Turn pairs of a file and the names found in it into a map from each name to its files."""
    files: dict[str, list[str]] = {}
    for file, names in found:
        for name in names:
            files.setdefault(name, []).append(file)
    return files


def _list_files(files: Sequence[str]) -> str:
    """Return up to three names, or two and the number of the others."""
    return ", ".join(files) if len(files) <= 3 else f"{files[0]}, {files[1]} and {len(files) - 2} more"
