"""Reading a measurement set: measurements.toml and its trials -> Recording, or one clear line about what is wrong.

Nothing read is changed or repaired in silence: what is left out, missing or not understood becomes a notice.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from twin.errors import DataError
from twin.measurements.channels import Channel, Role
from twin.measurements.clouds import read_clouds
from twin.measurements.conditions import read_conditions
from twin.measurements.files import LARGEST_TOML, check_name, inside, located, read_text
from twin.measurements.notices import notices_of
from twin.measurements.plausible import check_roles, check_table, check_trials, why_unusable
from twin.measurements.quantity_strings import number, shown, vector
from twin.measurements.recording import Recording, Trial
from twin.measurements.tables import Table, read_table

FORMAT = "twin-measurements/1"
FILE = "measurements.toml"
_SOURCES = ("hardware", "simulation")
_TOP_KEYS = ("format", "robot", "title", "source", "gravity", "channel", "trial")
_CHANNEL_KEYS = ("name", "role", "unit", "noise")
_SUFFIXES = (".csv", ".parquet")


def read(path: str | Path, *, least_trials: int = 2) -> Recording:
    """The measurement set in folder `path`, or whose measurements.toml is `path`; values in SI, arrays read-only.

    Trials of fewer than 3 samples or without one finite output are left out, with a notice.

    Raises DataError, naming file, row and column, for everything that breaks the contract, and for fewer than `least_trials`
    usable trials: two are needed to keep one away from every fit.
    """
    file = Path(path) if Path(path).name == FILE else Path(path) / FILE
    document = _read_toml(file)
    with located(file):
        if document.get("format") != FORMAT:
            raise DataError(f'format is {shown(document.get("format"))}; write format = "{FORMAT}"')
        robot = _text(document, "robot", None)
        title = _text(document, "title", "")
        source = _text(document, "source", "not stated")
        with located("gravity"):
            gravity = vector(document["gravity"], "m/s^2") if "gravity" in document else None
        channels = _channels(_tables(document, "channel"))
        check_roles(channels)
        written = _tables(document, "trial")
    notes = [_unknown_keys("measurements.toml", document, _TOP_KEYS)]
    notes += [_unknown_keys(f"channel {table['name']}", table, _CHANNEL_KEYS) for table in _tables(document, "channel")]
    if source.partition(":")[0].strip() not in _SOURCES:
        notes.append(f"source is {shown(source)}; the contract knows {' and '.join(_SOURCES)}, with free text after a colon")

    trials: list[Trial] = []
    tables: list[Table] = []
    labels: set[str] = set()
    for at, entry in enumerate(written, start=1):
        trial, table = _read_trial(file, at, entry, channels)
        if trial.label in labels:
            raise DataError(f"{file}, trial {at}: file {shown(trial.name)} is there twice; list every trial once")
        labels.add(trial.label)
        tables.append(table)
        if reason := why_unusable(trial, channels):
            notes.append(f"{trial.name} is left out: {reason}")
        else:
            trials.append(trial)
    with located(file):
        check_trials(channels, trials, least_trials)
    notes += notices_of(channels, trials, tables)
    return Recording(robot, title, source, gravity, channels, tuple(trials), file.parent, tuple(note for note in notes if note))


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        if not file.is_file():
            raise DataError(f"{file}: no such file; a measurement set is a folder with a {FILE}")
        return tomllib.loads(read_text(file, LARGEST_TOML).decode())
    except (ValueError, RecursionError, OSError) as fault:
        raise DataError(f"{file}: not TOML ({shown(str(fault))}); correct the file") from None


def _text(document: Mapping[str, object], key: str, default: str | None) -> str:
    value = document.get(key, default)
    if not isinstance(value, str) or (default is None and not value.strip()):
        raise DataError(f'{key} is {shown(value)}; write {key} = "..." in quotes')
    return value


def _tables(document: Mapping[str, object], key: str) -> list[dict[str, Any]]:
    value = document.get(key, [])
    if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
        raise DataError(f"{key} is {shown(value)}; write one [[{key}]] table for each")
    return cast(list[dict[str, Any]], value)


def _channels(tables: list[dict[str, Any]]) -> tuple[Channel, ...]:
    channels: list[Channel] = []
    for at, table in enumerate(tables, start=1):
        with located(f"channel {at}"):
            name = _text(table, "name", None)
            role = cast(Role, table.get("role"))
            channel = Channel(name, role, _text(table, "unit", None))
            if name in (other.name for other in channels):
                raise DataError(f"{name} is declared twice; declare it once")
            if "noise" in table:
                with located(f"noise of {name}"):
                    noise = channel.scale.difference().to_si(number(table["noise"]))
                channel = Channel(name, role, channel.unit, noise)
        channels.append(channel)
    return tuple(channels)


def _read_trial(file: Path, at: int, entry: Mapping[str, object], channels: Sequence[Channel]) -> tuple[Trial, Table]:
    folder = file.parent
    with located(f"{file}, trial {at}"):
        path = _trial_file(folder, entry)
        cloud_path = inside(folder, entry["cloud"]) if "cloud" in entry else None
        with located("start"):
            start = number(entry["start"]) if "start" in entry else None
        conditions, other = read_conditions(entry)
    table = read_table(path, ["time", *(channel.name for channel in channels)])
    check_table(table, channels)
    values = {channel.name: channel.scale.to_si(table.columns[channel.name]) for channel in channels}
    clouds = read_clouds(cloud_path) if cloud_path else None
    name = path.relative_to(folder).as_posix()
    return Trial(name, table.columns["time"], values, conditions, other, start, clouds), table


def _trial_file(folder: Path, entry: Mapping[str, object]) -> Path:
    name = check_name(entry.get("file"))
    if not name.lower().endswith(_SUFFIXES):
        found = [suffix for suffix in _SUFFIXES if (folder / (name + suffix)).is_file()]
        if len(found) != 1:
            raise DataError(f"file {shown(name)} ends neither in .csv nor in .parquet; name one that does")
        name += found[0]
    return inside(folder, name)


def _unknown_keys(where: str, table: Mapping[str, object], known: tuple[str, ...]) -> str:
    unknown = [key for key in table if key not in known]
    return f"{where}: not understood and not kept: {', '.join(map(shown, unknown))}" if unknown else ""
