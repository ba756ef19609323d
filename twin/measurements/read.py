"""Reading of a measurement set: measurements.toml and its trials become a Recording, or one error in a clear line.

Nothing is changed or repaired silently: trials left out, missing values and unknown keys become notices.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from twin.foundation.errors import DataError, join_problems, short_repr
from twin.foundation.file_schema import TableSchema, Text, validate_table
from twin.foundation.files import (
    MAX_SET_NUMBERS,
    MAX_SET_TOML_BYTES,
    check_file_name,
    is_file,
    parse_toml,
    prefix_errors,
    read_utf8,
    resolve_in_folder,
)
from twin.measurements.channels import DERIVED_KINDS, Channel, Role
from twin.measurements.clouds import read_clouds
from twin.measurements.conditions import MAX_CONDITION, read_conditions
from twin.measurements.notices import collect_notices
from twin.measurements.parsing import declared as rules_of
from twin.measurements.parsing.declared import Done, Rules
from twin.measurements.parsing.plausible import check_roles, check_table, check_trials, unusable_reason
from twin.measurements.parsing.quantity_strings import parse_number, parse_vector
from twin.measurements.parsing.tables import Table, read_table
from twin.measurements.recording import Recording, Trial

SET_FORMAT = "twin-measurements/1"
SET_FILE = "measurements.toml"
_SOURCE_KINDS = ("hardware", "simulation")
_SUFFIXES = (".csv", ".parquet")
MAX_START = 1e9  # s since the first trial: thirty years


class SetFile(TableSchema):
    """The top of a `measurements.toml`."""

    format: str = Field(description=f'"{SET_FORMAT}"')
    robot: Text = Field(description="a robot's name, or the path to its folder from this file")
    title: Text = Field("", description="one line for people")
    source: Text = Field("not stated", description='"hardware" or "simulation"; free text may follow after a colon')
    gravity: Any = Field(None, description="[x, y, z] m/s^2 in the base frame; left out: the robot's own")
    time: Any = Field(
        None, description='"epoch", "s", "ms", "us" or "ns" of any start: each first stamp is subtracted; left out: s'
    )
    missing: Any = Field(None, description="[x, y, z] of a lost marker, or one number of any channel: no reading, in file units")
    channel: list[Any] = Field([], description="[[channel]] tables: the columns")
    trial: list[Any] = Field([], description="[[trial]] tables: the files, one a run")


class ChannelTable(TableSchema):
    """One [[channel]]."""

    name: str = Field(description="the column, a name of the grammar below")
    role: Role = Field(description="input: drives the twin; output: compared with it; context: known surroundings")
    unit: str = Field(description="any unit of the right dimension")
    noise: Any = Field(None, description="one standard deviation, in the same unit")
    quantity: Text = Field("", description="what the column is, a name of the grammar below; left out: its name says so")
    scale: Any = Field(1.0, description="a reading counts as reading * scale + offset, in the unit")
    offset: Any = Field(0.0, description="see scale")
    missing: Any = Field(None, description="a number that is no reading, as the column has it")
    wraps: Any = Field(None, description="the span at which a reading rolls over, as the column has it: 360; it is unwrapped")


def read(path: str | Path, *, least_trials: int = 2) -> Recording:
    """Read the measurement set in folder `path`, or whose measurements.toml is `path`; values in SI, arrays read-only.

    Trials of fewer than 3 samples or without a finite output value are left out, with a notice.

    Raises DataError, naming file, row and column, for a set that breaks the contract, and for fewer than `least_trials` usable
    trials: two are needed to hold one out of every fit. All problems of measurements.toml are reported together.
    """
    file = Path(path) if Path(path).name == SET_FILE else Path(path) / SET_FILE
    declared, gravity, channels, declared_trials, rules = _read_declarations(file)
    notices = []
    if declared.source.partition(":")[0].strip() not in _SOURCE_KINDS:
        notices.append(
            f"source is {short_repr(declared.source)}; known are {' and '.join(_SOURCE_KINDS)}, with free text after a colon"
        )
    trials: list[Trial] = []
    tables: list[Table] = []
    left_out: list[str] = []
    done: dict[str, Done] = {}
    numbers_left = MAX_SET_NUMBERS
    for declared_trial in declared_trials:
        trial, table, done_here = _read_trial(file.parent, declared_trial, channels, rules)
        numbers_left -= table.columns["time"].size * len(table.columns)
        if numbers_left < 0:
            raise DataError(f"{file}: more than {MAX_SET_NUMBERS} numbers in all; split the set, or thin its trials out")
        tables.append(replace(table, columns={}))  # its numbers are in the trial
        if reason := unusable_reason(trial, channels):
            left_out.append(f"{trial.name} is left out: {reason}")
        else:
            trials.append(trial)
            done[trial.name] = done_here
    with prefix_errors(file):
        check_trials(channels, trials, left_out, least_trials)
    timed = rules_of.started(rules, trials, {name: d.first for name, d in done.items()})
    notices += rules_of.notices(rules, list(done.values()), timed != trials)
    notices += left_out + collect_notices(channels, timed, tables)
    head = (declared.robot, declared.title, declared.source, gravity, channels)
    return Recording(*head, tuple(timed), file.parent, tuple(notices))


ParsedChannel = tuple[Channel, dict[str, float], dict[str, float]]  # with `missing` and `wraps`, by its name


@dataclass(frozen=True)
class DeclaredTrial:
    """A [[trial]] as declared: its files, start (s), known conditions (SI) and others."""

    table: Path
    cloud: Path | None
    start: float | None
    conditions: dict[str, float | np.ndarray]
    other: dict[str, object]


def _read_declarations(file: Path) -> tuple[SetFile, np.ndarray | None, tuple[Channel, ...], list[DeclaredTrial], Rules]:
    """Read measurements.toml. Raises DataError with all its problems."""
    if not is_file(file):
        raise DataError(f"{short_repr(str(file), 300)}: no such file; a measurement set is a folder with a {SET_FILE}")
    problems: list[str] = []
    with prefix_errors(file):
        table = parse_toml(read_utf8(file, MAX_SET_TOML_BYTES))
        if table.get("format") != SET_FORMAT:
            raise DataError(f'format is {short_repr(table.get("format"))}; write format = "{SET_FORMAT}"')
        declared = validate_table(SetFile, table, "", problems)
        if declared is None:
            raise DataError(join_problems(problems))
        if not declared.robot.strip():
            problems.append(f"robot is {short_repr(declared.robot)}; name one, or a path to its folder")
        gravity = _collect_fault(problems, "gravity", lambda: _parse_gravity(declared.gravity)) if "gravity" in table else None
        parsed = [
            _collect_fault(problems, f"channel {n}", lambda each=each: _parse_channel(each))
            for n, each in enumerate(declared.channel, 1)
        ]
        channels = tuple(c for c, _, _ in filter(None, parsed))
        rules = _parse_rules(declared, [each for each in parsed if each is not None], problems)
        names = [c.name for c in channels]
        problems += [
            f"channel {name} is declared twice; declare it once" for name in sorted({n for n in names if names.count(n) > 1})
        ]
        if not problems:
            check_roles(channels)
        trials = [
            _collect_fault(problems, f"trial {n}", lambda each=each: _parse_trial(file.parent, each))
            for n, each in enumerate(declared.trial, 1)
        ]
        declared_trials = [t for t in trials if t is not None]
        labels = [_trial_label(t.table) for t in declared_trials]
        for n, t in enumerate(declared_trials):
            if labels[n] in labels[:n]:
                problems.append(f"trial {n + 1}: file {short_repr(t.table.name)} is there twice; list every trial once")
        if problems:
            raise DataError(join_problems(problems))
    return declared, gravity, channels, declared_trials, rules


def _parse_rules(declared: SetFile, channels: Sequence[ParsedChannel], problems: list[str]) -> Rules:
    time, missing = declared.time, declared.missing
    clock = None if time is None else _collect_fault(problems, "time", lambda: rules_of.parse_time(time))
    lost = None if missing is None else _collect_fault(problems, "missing", lambda: rules_of.parse_missing(missing))
    missing_of = {name: value for _, each, _ in channels for name, value in each.items()}
    return Rules(clock or "", lost or (), missing_of, {name: value for _, _, each in channels for name, value in each.items()})


Result = TypeVar("Result")


def _collect_fault(problems: list[str], where: str, call: Callable[[], Result]) -> Result | None:
    """Return the result of `call`, or None with its DataError added to `problems`."""
    try:
        return call()
    except DataError as fault:
        problems.append(f"{where}: {fault}")
        return None


def _parse_gravity(value: object) -> np.ndarray:
    pull = parse_vector(value, "m/s^2")
    if not np.all(np.abs(pull) <= MAX_CONDITION["gravity"]):
        raise DataError(f"{short_repr(value)} is not plausible; at most {MAX_CONDITION['gravity']:g} m/s^2 along each axis")
    return pull


def _parse_channel(table: object) -> ParsedChannel:
    problems: list[str] = []
    found = validate_table(ChannelTable, table, "", problems)
    if found is None:
        raise DataError("; ".join(problems))
    with prefix_errors(f"scale and offset of {found.name}"):
        factor, offset = parse_number(found.scale), parse_number(found.offset)
    channel = Channel(found.name, found.role, found.unit, None, found.quantity, factor, offset)
    if channel.kind in DERIVED_KINDS:
        raise DataError(f"{found.name} is made from point clouds, not read; give the trial's clouds as `cloud`")
    if found.noise is not None:
        with prefix_errors(f"noise of {found.name}"):
            channel = replace(channel, noise=channel.unit_scale.without_offset().to_si(parse_number(found.noise)))
    return channel, *rules_of.of_channel(found.name, found.missing, found.wraps)


def _parse_trial(folder: Path, entry: object) -> DeclaredTrial:
    if not isinstance(entry, dict):
        raise DataError(f"it is {short_repr(entry)}; write one [[trial]] table for each")
    table = _trial_file(folder, entry)
    cloud = resolve_in_folder(folder, entry["cloud"]) if "cloud" in entry else None
    start = None
    if "start" in entry:
        with prefix_errors("start"):
            start = parse_number(entry["start"])
            if not abs(start) <= MAX_START:
                raise DataError(f"{start:g} s is not plausible; at most {MAX_START:g} s since the first trial")
    return DeclaredTrial(table, cloud, start, *read_conditions(entry))


def _trial_label(path: Path) -> Path:
    """Return the path without its ending: two files that differ only in the ending are one trial."""
    return path.with_suffix("")


def _read_trial(folder: Path, declared: DeclaredTrial, channels: Sequence[Channel], rules: Rules) -> tuple[Trial, Table, Done]:
    table, done = rules_of.apply(rules, read_table(declared.table, ["time", *(channel.name for channel in channels)]), channels)
    check_table(table, channels)
    values = {channel.name: channel.scale.to_si(table.columns[channel.name]) for channel in channels}
    for column in values.values():
        column.setflags(write=False)  # so that the trial need not copy it
    clouds = rules_of.on_clock(rules, done, read_clouds(declared.cloud) if declared.cloud else None)
    name = declared.table.relative_to(folder).as_posix()
    trial = Trial(name, table.columns["time"], values, declared.conditions, declared.other, declared.start, clouds)
    return trial, table, done


def _trial_file(folder: Path, entry: Mapping[str, object]) -> Path:
    name = check_file_name(entry.get("file"))
    if not name.lower().endswith(_SUFFIXES):
        found = [suffix for suffix in _SUFFIXES if (folder / (name + suffix)).is_file()]
        if len(found) != 1:
            raise DataError(f"file {short_repr(name)} ends neither in .csv nor in .parquet; name one that does")
        name += found[0]
    return resolve_in_folder(folder, name)
