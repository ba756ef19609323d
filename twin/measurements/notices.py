"""Notices: what a user should know about a set that is otherwise in order, one plain sentence a kind of finding."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from twin.errors import shown
from twin.measurements.channels import Channel
from twin.measurements.plausible import SLACK_SIGMAS
from twin.measurements.recording import CONTACT, Trial
from twin.measurements.tables import Table

MOST_NAMED = 5  # undeclared columns


def notices_of(channels: Sequence[Channel], trials: Sequence[Trial], tables: Sequence[Table]) -> list[str]:
    """Undeclared columns, conditions that are not understood, inputs with gaps or below zero, and channels empty in a trial."""
    notices = []
    extra = _where((table.path.name, table.extra) for table in tables)
    if len(extra) > MOST_NAMED:
        named = ", ".join(map(shown, list(extra)[:MOST_NAMED]))
        files = list(dict.fromkeys(itertools.chain.from_iterable(extra.values())))
        notices.append(
            f"{len(extra)} columns are not declared in measurements.toml and not read: {named} and others ({_listed(files)})"
        )
    else:
        for name, files in extra.items():
            notices.append(f"column {shown(name)} is not declared in measurements.toml and not read ({_listed(files)})")
    for name, files in _where((trial.name, trial.other.keys() - {CONTACT}) for trial in trials).items():
        notices.append(f"condition {name!r} is not understood: the twin does not act on it ({_listed(files)})")
    for channel in channels:
        gaps = {trial.name: int(np.count_nonzero(np.isnan(trial.values[channel.name]))) for trial in trials}
        empty = [trial.name for trial in trials if gaps[trial.name] == len(trial.time)]
        holed = [name for name, count in gaps.items() if count and name not in empty]
        lowest = min((float(np.nanmin(t.values[channel.name])) for t in trials if t.name not in empty), default=0.0)
        if channel.role == "input" and channel.kind == "tendon_tension" and lowest < -SLACK_SIGMAS * (channel.noise or 0.01):
            notices.append(f"input {channel.name} falls to {lowest:.3g} N, below what its noise explains: a zero offset?")
        if empty:
            notices.append(f"{channel.role} {channel.name} has no value in {_listed(empty)}")
        if holed and channel.role == "input":
            count = sum(gaps[name] for name in holed)
            notices.append(f"input {channel.name} misses {count} values, which are not filled in ({_listed(holed)})")
    return notices


def _where(found: Iterable[tuple[str, Iterable[str]]]) -> dict[str, list[str]]:
    """File and the names found in it -> name and the files it stands in."""
    files: dict[str, list[str]] = {}
    for file, names in found:
        for name in names:
            files.setdefault(name, []).append(file)
    return files


def _listed(files: Sequence[str]) -> str:
    return ", ".join(files) if len(files) <= 3 else f"{files[0]}, {files[1]} and {len(files) - 2} more"
