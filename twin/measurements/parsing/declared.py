"""What measurements.toml declares about the numbers of its tables: the clock, what is no reading, what rolls over.

Only what is declared is done, and a notice says what that was.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.foundation.files import prefix_errors
from twin.measurements.channels import Channel, parse_channel_name
from twin.measurements.parsing.plausible import EPOCH_SECONDS
from twin.measurements.parsing.quantity_strings import parse_number
from twin.measurements.parsing.tables import Table
from twin.measurements.recording import Clouds, Trial

CLOCKS = {"s": 1.0, "epoch": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # `time` -> its ticks in a second
_FEWEST_AXES = 2  # of a marker that is lost; one coordinate alone may read anything


@dataclass(frozen=True)
class Rules:
    """What is declared: the clock ("" where nothing is), what is no reading of any channel or marker, and both per channel."""

    time: str = ""
    missing: tuple[float, ...] = ()  # one number, or the x, y and z of a lost marker, in the file's units
    missing_of: Mapping[str, float] = field(default_factory=dict)
    wraps: Mapping[str, float] = field(default_factory=dict)  # channel -> the span at which it rolls over, in its unit


@dataclass(frozen=True)
class Done:
    """What was done to one table: its first stamp as written, and how often by channel or marker."""

    first: float
    lost: Mapping[str, int]
    rolled: Mapping[str, int]


def parse_time(value: object) -> str:
    """Return `time` as declared. Raises DataError for another clock."""
    if not isinstance(value, str) or value not in CLOCKS:
        raise DataError(f'{short_repr(value)} is no clock; write one of {", ".join(CLOCKS)} ("epoch": seconds since 1970)')
    return value


def parse_missing(value: object) -> tuple[float, ...]:
    """Return `missing` of a set: a number, or three. Raises DataError for anything else."""
    if not isinstance(value, list):
        return (parse_number(value),)
    if len(value) != len("xyz"):
        raise DataError(f"{short_repr(value)}; write a number, or the x, y and z of a lost marker, such as [0, 0, 0]")
    return tuple(parse_number(each) for each in value)


def parse_wraps(value: object) -> float:
    """Return `wraps` of a channel. Raises DataError unless it is above zero."""
    span = parse_number(value)
    if not span > 0.0:
        raise DataError(f"{span:g}; write the span at which the reading rolls over, in its unit, such as 360")
    return span


def apply(rules: Rules, table: Table, channels: Sequence[Channel]) -> tuple[Table, Done]:
    """Return the table with what is declared done, and what that was; the very table where nothing is declared."""
    columns, lost, rolled = dict(table.columns), {}, {}
    for name, where in _lost(rules, columns, channels):
        for column in where:
            columns[column] = np.where(where[column], np.nan, columns[column])
            lost[name] = int(where[column].sum())
    for name, span in rules.wraps.items():
        columns[name], rolled[name] = unwrapped(columns[name], span)
    first = float(columns["time"][0]) if len(columns["time"]) else 0.0
    if rules.time and np.isfinite(first):
        columns["time"] = (columns["time"] - first) / CLOCKS[rules.time]
    return (replace(table, columns=columns) if rules != Rules() else table), Done(first, lost, rolled)


def _lost(rules: Rules, columns: Mapping[str, np.ndarray], channels: Sequence[Channel]) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Return each channel or marker with readings that are none, and where these are in each of its columns."""
    found = [(name, {name: columns[name] == value}) for name, value in rules.missing_of.items()]
    if len(rules.missing) == 1:
        found += [(c.name, {c.name: columns[c.name] == rules.missing[0]}) for c in channels]
    elif rules.missing:
        for name, axes in markers_of(channels).items():
            at = np.all([columns[c.name] == rules.missing["xyz".index(c.axis or "")] for c in axes], axis=0)
            found.append((name, {c.name: at for c in axes}))
    return [(name, where) for name, where in found if any(at.any() for at in where.values())]


def markers_of(channels: Sequence[Channel]) -> dict[str, list[Channel]]:
    """Return the channels of x, y and z of each position of which two or three are logged, by what the position is called."""
    found: dict[tuple[object, ...], list[Channel]] = {}
    for c in channels:
        if c.axis in ("x", "y", "z") and c.si_unit == "m":
            parts = parse_channel_name(c.means)
            found.setdefault((parts.kind, parts.index, parts.finger, parts.element), []).append(c)
    whole = [axes for axes in found.values() if len(axes) >= _FEWEST_AXES]
    return {axes[0].means.removesuffix(axes[0].axis or "").rstrip("_."): axes for axes in whole}


def unwrapped(readings: np.ndarray, span: float) -> tuple[np.ndarray, int]:
    """Return readings (n,) without the jumps of a roll-over at `span`, and the number of these; NaN is passed over.

    A step of more than half a span is taken for the shorter way round.
    """
    known = np.isfinite(readings)
    turns = -np.round(np.diff(readings[known]) / span)
    out = readings.copy()
    out[known] += span * np.concatenate([np.zeros(min(1, int(known.sum()))), np.cumsum(turns)])
    return out, int(np.count_nonzero(turns))


def on_clock(rules: Rules, done: Done, clouds: Clouds | None) -> Clouds | None:
    """Return point clouds on the clock of their trial's table."""
    if clouds is None or not rules.time:
        return clouds
    return replace(clouds, time=(clouds.time - done.first) / CLOCKS[rules.time])


def started(rules: Rules, trials: Sequence[Trial], first: Mapping[str, float]) -> list[Trial]:
    """Return the trials with starts from their first stamps, where these are since 1970 and no start is declared."""
    seconds = {t.name: first[t.name] / CLOCKS[rules.time or "s"] for t in trials}
    if not rules.time or any(t.start is not None for t in trials) or any(s < EPOCH_SECONDS for s in seconds.values()):
        return list(trials)
    return [replace(t, start=seconds[t.name] - min(seconds.values())) for t in trials]


def notices(rules: Rules, done: Sequence[Done], from_stamps: bool) -> list[str]:
    """Return what was done, in words, one sentence a key."""
    said = []
    if rules.time:
        divided = f", the rest divided by {CLOCKS[rules.time]:g}" if CLOCKS[rules.time] != 1.0 else ""
        starts = "; the starts of the trials are taken from the stamps" if from_stamps else ""
        said.append(f'time = "{rules.time}", as declared: the first stamp of each trial is subtracted{divided}{starts}')
    if rules.missing or rules.missing_of:
        counts = _counted([d.lost for d in done])
        said.append(f"missing, as declared: no readings are {counts or 'none; no row holds such a value'}")
    if rules.wraps:
        spans = ", ".join(f"{name} at {span:g}" for name, span in rules.wraps.items())
        counts = _counted([d.rolled for d in done])
        said.append(f"wraps, as declared ({spans}): unwrapped within each trial, jumps in {counts or 'none'}")
    return said


def _counted(each: Sequence[Mapping[str, int]]) -> str:
    names = dict.fromkeys(name for found in each for name, count in found.items() if count)
    return ", ".join(f"{name} {sum(found.get(name, 0) for found in each)}" for name in names)


def of_channel(name: str, missing: object, wraps: object) -> tuple[dict[str, float], dict[str, float]]:
    """Return `missing` and `wraps` of one channel, by its name. Raises DataError, naming the key."""
    with prefix_errors(f"missing of {name}"):
        lost = {} if missing is None else {name: parse_number(missing)}
    with prefix_errors(f"wraps of {name}"):
        return lost, {} if wraps is None else {name: parse_wraps(wraps)}
