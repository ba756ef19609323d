"""Checks that measured numbers must pass."""

from collections.abc import Sequence

import numpy as np

from twin.foundation.errors import DataError
from twin.measurements.channels import Channel
from twin.measurements.parsing.tables import Table
from twin.measurements.recording import Trial

_MIN_SAMPLES = 3
MIN_TIME_STEP, MAX_TRIAL_TIME = 1e-6, 1e7  # s: a microsecond, faster than any robot here is logged; four months
EPOCH_SECONDS = 1e8  # s since 1970: every clock of today reads more; larger by a power of 1000 in milli-, micro- or nanoseconds


def check_table(table: Table, channels: Sequence[Channel]) -> None:
    """Raise DataError, naming the cell, for an infinite value, bad time, or less than 0 K.

    Time is bad if it does not increase or cannot be in seconds.
    """
    time = table.columns["time"]
    _check_finite(table, "time", time)
    if len(missing := np.flatnonzero(np.isnan(time))):
        raise DataError(f"{table.cell(int(missing[0]), 'time')}: missing; every row needs its time in seconds")
    if len(back := np.flatnonzero(np.diff(time) <= 0)):
        at = int(back[0]) + 1
        order = f"{float(time[at])!r} after {float(time[at - 1])!r}"
        way_out = (
            "sort or split the trial" if time[at] < time[at - 1] else "make one row of those with equal stamps, such as their mean"
        )
        raise DataError(f"{table.cell(at, 'time')}: {order}; time must strictly increase, {way_out}")
    steps = np.diff(time)
    if len(short := np.flatnonzero(steps < MIN_TIME_STEP)):
        step = f"a step of {float(steps[short[0]]):.3g} s; time is in seconds, and at least {MIN_TIME_STEP:g} s apart"
        raise DataError(f"{table.cell(int(short[0]) + 1, 'time')}: {step}")
    if len(time) and not abs(time[0]) + (time[-1] - time[0]) <= MAX_TRIAL_TIME:
        last = float(time[-1])
        unit, divided = next(
            ((u, f"divide by {10.0**n:g} and ") for n, u in ((9, "ns"), (6, "us"), (3, "ms")) if last / 10.0**n > EPOCH_SECONDS),
            ("epoch", ""),
        )
        raise DataError(
            f"{table.cell(len(time) - 1, 'time')}: {last!r} s; time is in seconds since a start of your choice, and at "
            f"most {MAX_TRIAL_TIME:g} s: {divided}subtract the first trial's first stamp, with `start` in [[trial]] for when each "
            f'began, or write time = "{unit}" at the top of measurements.toml'
        )
    for channel in channels:
        column = channel.scale.to_si(table.columns[channel.name])
        _check_finite(table, channel.name, column)
        if channel.si_unit == "K":
            _check_absolute_zero(table, channel, column)


def _check_finite(table: Table, name: str, column: np.ndarray) -> None:
    if len(infinite := np.flatnonzero(np.isinf(column))):
        raise DataError(f"{table.cell(int(infinite[0]), name)}: infinite value; write a number, or nothing if it is missing")


def _check_absolute_zero(table: Table, channel: Channel, column: np.ndarray) -> None:
    if len(below := np.flatnonzero(column < 0.0)):
        at = int(below[0])
        read = float(table.columns[channel.name][at])
        advice = "below absolute zero; leave the cell empty if it is missing"
        raise DataError(f"{table.cell(at, channel.name)}: {read!r} {channel.unit}, {advice}")


def unusable_reason(trial: Trial, channels: Sequence[Channel]) -> str:
    """Return why a trial cannot be used; empty if it can."""
    if len(trial.time) < _MIN_SAMPLES:
        return f"{len(trial.time)} samples, at least {_MIN_SAMPLES} are needed"
    outputs = [trial.values[channel.name] for channel in channels if channel.role == "output"]
    if all(np.all(np.isnan(column)) for column in outputs):
        return "not one output value in it"
    return ""


def check_roles(channels: Sequence[Channel]) -> None:
    """Raise DataError for a set without input or without output."""
    for role in ("input", "output"):
        if not any(channel.role == role for channel in channels):
            raise DataError(f'no {role} channel; give at least one [[channel]] role = "{role}"')


def check_trials(channels: Sequence[Channel], trials: Sequence[Trial], left_out: Sequence[str], least_trials: int) -> None:
    """Raise DataError for too few usable trials, and for a channel without any value in them."""
    if len(trials) < least_trials:
        needed = f"at least {least_trials} are needed, each with {_MIN_SAMPLES} samples and an output value"
        why = f" ({'; '.join(left_out[:3])}{', ...' if len(left_out) > 3 else ''})" if left_out else ""
        raise DataError(f"{len(trials)} usable trials; {needed}{why}")
    for channel in channels:
        if trials and all(np.all(np.isnan(trial.values[channel.name])) for trial in trials):
            raise DataError(f"channel {channel.name} has no value in any usable trial; remove it, or export the data again")
