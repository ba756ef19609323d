"""Reading a measurement set: measurements.toml and its trials -> Recording, or one clear line about what is wrong.

Nothing read is changed or repaired in silence: what is left out, missing or not understood becomes a notice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from twin.errors import DataError, listed, shown
from twin.forms import Form, Text, fill
from twin.measurements.channels import MADE, Channel, Role
from twin.measurements.clouds import read_clouds
from twin.measurements.conditions import LARGEST, read_conditions
from twin.measurements.files import LARGEST_SET, LARGEST_TOML, check_name, inside, is_file, located, parse_toml, read_text
from twin.measurements.notices import notices_of
from twin.measurements.plausible import check_roles, check_table, check_trials, why_unusable
from twin.measurements.quantity_strings import number, vector
from twin.measurements.recording import Recording, Trial
from twin.measurements.tables import Table, read_table

FORMAT = "twin-measurements/1"
FILE = "measurements.toml"
_SOURCES = ("hardware", "simulation")
_SUFFIXES = (".csv", ".parquet")
LATEST = 1e9  # s: thirty years


class SetFile(Form):
    """The top of a `measurements.toml`."""

    format: str = Field(description=f'"{FORMAT}"')
    robot: Text = Field(description="a robot's name, or the path to its folder from this file")
    title: Text = Field("", description="one line for people")
    source: Text = Field("not stated", description='"hardware" or "simulation"; free text may follow after a colon')
    gravity: Any = Field(None, description="[x, y, z] m/s^2 in the base frame; left out: the robot's own")
    channel: list[Any] = Field([], description="[[channel]] tables: the columns")
    trial: list[Any] = Field([], description="[[trial]] tables: the files, one a run")


class ChannelTable(Form):
    """One [[channel]]."""

    name: str = Field(description="the column, a name of the grammar below")
    role: Role = Field(description="input: drives the twin; output: compared with it; context: known surroundings")
    unit: str = Field(description="any unit of the right dimension")
    noise: Any = Field(None, description="one standard deviation, in the same unit")


def read(path: str | Path, *, least_trials: int = 2) -> Recording:
    """The measurement set in folder `path`, or whose measurements.toml is `path`; values in SI, arrays read-only.

    Trials of fewer than 3 samples or without one finite output are left out, with a notice.

    Raises DataError, naming file, row and column, for everything that breaks the contract, and for fewer than `least_trials`
    usable trials: two are needed to keep one away from every fit. All that is wrong with measurements.toml is told at once.
    """
    file = Path(path) if Path(path).name == FILE else Path(path) / FILE
    declared, gravity, channels, written = _declared(file)
    notes = []
    if declared.source.partition(":")[0].strip() not in _SOURCES:
        notes.append(
            f"source is {shown(declared.source)}; the contract knows {' and '.join(_SOURCES)}, with free text after a colon"
        )
    trials: list[Trial] = []
    tables: list[Table] = []
    left_out: list[str] = []
    room = LARGEST_SET
    for each in written:
        trial, table = _read_trial(file.parent, each, channels)
        room -= table.columns["time"].size * len(table.columns)
        if room < 0:
            raise DataError(f"{file}: more than {LARGEST_SET} numbers in all; split the set, or thin its trials out")
        tables.append(replace(table, columns={}))  # its numbers are in the trial
        if reason := why_unusable(trial, channels):
            left_out.append(f"{trial.name} is left out: {reason}")
        else:
            trials.append(trial)
    with located(file):
        check_trials(channels, trials, left_out, least_trials)
    notes += left_out + notices_of(channels, trials, tables)
    about = (declared.robot, declared.title, declared.source, gravity, channels)
    return Recording(*about, tuple(trials), file.parent, tuple(notes))


@dataclass(frozen=True)
class Written:
    """A [[trial]] as declared: its table and clouds, start (s), conditions that are understood (SI) and others."""

    table: Path
    cloud: Path | None
    start: float | None
    conditions: dict[str, float | np.ndarray]
    other: dict[str, object]


def _declared(file: Path) -> tuple[SetFile, np.ndarray | None, tuple[Channel, ...], list[Written]]:
    """What measurements.toml says. Raises DataError with all that is wrong with it."""
    if not is_file(file):
        raise DataError(f"{shown(str(file), 300)}: no such file; a measurement set is a folder with a {FILE}")
    problems: list[str] = []
    with located(file):
        table = parse_toml(read_text(file, LARGEST_TOML))
        if table.get("format") != FORMAT:
            raise DataError(f'format is {shown(table.get("format"))}; write format = "{FORMAT}"')
        declared = fill(SetFile, table, "", problems)
        if declared is None:
            raise DataError(listed(problems))
        if not declared.robot.strip():
            problems.append(f"robot is {shown(declared.robot)}; name one, or a path to its folder")
        gravity = _told(problems, "gravity", lambda: _gravity(declared.gravity)) if "gravity" in table else None
        found = [_told(problems, f"channel {n}", lambda each=each: _channel(each)) for n, each in enumerate(declared.channel, 1)]
        channels = tuple(c for c in found if c is not None)
        names = [c.name for c in channels]
        problems += [
            f"channel {name} is declared twice; declare it once" for name in sorted({n for n in names if names.count(n) > 1})
        ]
        if not problems:
            check_roles(channels)
        trials = [
            _told(problems, f"trial {n}", lambda each=each: _trial(file.parent, each)) for n, each in enumerate(declared.trial, 1)
        ]
        written = [t for t in trials if t is not None]
        labels = [_label(t.table) for t in written]
        for n, t in enumerate(written):
            if labels[n] in labels[:n]:
                problems.append(f"trial {n + 1}: file {shown(t.table.name)} is there twice; list every trial once")
        if problems:
            raise DataError(listed(problems))
    return declared, gravity, channels, written


Told = TypeVar("Told")


def _told(problems: list[str], where: str, call: Callable[[], Told]) -> Told | None:
    """What `call` returns, or None with its DataError added to `problems`."""
    try:
        return call()
    except DataError as fault:
        problems.append(f"{where}: {fault}")
        return None


def _gravity(value: object) -> np.ndarray:
    pull = vector(value, "m/s^2")
    if not np.all(np.abs(pull) <= LARGEST["gravity"]):
        raise DataError(f"{shown(value)} is not plausible; at most {LARGEST['gravity']:g} m/s^2 along each axis")
    return pull


def _channel(table: object) -> Channel:
    problems: list[str] = []
    found = fill(ChannelTable, table, "", problems)
    if found is None:
        raise DataError("; ".join(problems))
    channel = Channel(found.name, found.role, found.unit)
    if channel.kind in MADE:
        raise DataError(f"{found.name} is made from point clouds, not read; give the trial's clouds as `cloud`")
    if found.noise is None:
        return channel
    with located(f"noise of {found.name}"):
        noise = channel.scale.difference().to_si(number(found.noise))
    return Channel(found.name, found.role, found.unit, noise)


def _trial(folder: Path, entry: object) -> Written:
    if not isinstance(entry, dict):
        raise DataError(f"it is {shown(entry)}; write one [[trial]] table for each")
    table = _trial_file(folder, entry)
    cloud = inside(folder, entry["cloud"]) if "cloud" in entry else None
    start = None
    if "start" in entry:
        with located("start"):
            start = number(entry["start"])
            if not abs(start) <= LATEST:
                raise DataError(f"{start:g} s is not plausible; at most {LATEST:g} s since the first trial")
    return Written(table, cloud, start, *read_conditions(entry))


def _label(path: Path) -> Path:
    """What tells trials apart: two files that differ in their ending alone are one trial."""
    return path.with_suffix("")


def _read_trial(folder: Path, written: Written, channels: Sequence[Channel]) -> tuple[Trial, Table]:
    table = read_table(written.table, ["time", *(channel.name for channel in channels)])
    check_table(table, channels)
    values = {channel.name: channel.scale.to_si(table.columns[channel.name]) for channel in channels}
    for column in values.values():
        column.setflags(write=False)  # a trial need not copy it then
    clouds = read_clouds(written.cloud) if written.cloud else None
    name = written.table.relative_to(folder).as_posix()
    return Trial(name, table.columns["time"], values, written.conditions, written.other, written.start, clouds), table


def _trial_file(folder: Path, entry: Mapping[str, object]) -> Path:
    name = check_name(entry.get("file"))
    if not name.lower().endswith(_SUFFIXES):
        found = [suffix for suffix in _SUFFIXES if (folder / (name + suffix)).is_file()]
        if len(found) != 1:
            raise DataError(f"file {shown(name)} ends neither in .csv nor in .parquet; name one that does")
        name += found[0]
    return inside(folder, name)
