"""What measured numbers must satisfy before a twin may look at them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.errors import DataError
from twin.measurements.channels import Channel
from twin.measurements.recording import Trial
from twin.measurements.tables import Table

_LEAST_SAMPLES = 3
SHORTEST_STEP, LONGEST_TRIAL = 1e-6, 1e7  # s: a microsecond, faster than any robot here is logged; four months
# How far below zero an input tension may read: sigmas of declared noise, or what the zero of a load cell may be off, of a small
# one and of the largest reading of a trial; the widest counts. An offset is data, which the diagnosis can name (load_cell_bias); a
# pushing tendon is not.
SLACK_SIGMAS, _ZERO_OFFSET, _OF_LARGEST = 5.0, 0.3, 0.05  # -, N, -


def check_table(table: Table, channels: Sequence[Channel]) -> None:
    """Raises DataError, naming the cell, for an infinite value, time that does not increase or cannot be in seconds, a pushing
    tendon and less than 0 K."""
    time = table.columns["time"]
    _check_finite(table, "time", time)
    if len(missing := np.flatnonzero(np.isnan(time))):
        raise DataError(f"{table.cell(int(missing[0]), 'time')}: missing; every row needs its time in seconds")
    if len(back := np.flatnonzero(np.diff(time) <= 0)):
        at = int(back[0]) + 1
        order = f"{float(time[at])!r} after {float(time[at - 1])!r}"
        raise DataError(f"{table.cell(at, 'time')}: {order}; time must strictly increase, sort or split the trial")
    steps = np.diff(time)
    if len(short := np.flatnonzero(steps < SHORTEST_STEP)):
        step = f"a step of {float(steps[short[0]]):.3g} s; time is in seconds, and at least {SHORTEST_STEP:g} s apart"
        raise DataError(f"{table.cell(int(short[0]) + 1, 'time')}: {step}")
    if len(time) and not abs(time[0]) + (time[-1] - time[0]) <= LONGEST_TRIAL:
        raise DataError(
            f"{table.cell(len(time) - 1, 'time')}: {float(time[-1])!r} s; time is in seconds, and at most {LONGEST_TRIAL:g} s"
        )
    for channel in channels:
        column = channel.scale.to_si(table.columns[channel.name])
        _check_finite(table, channel.name, column)
        if channel.si_unit == "K":
            _check_floor(table, channel, column, 0.0, "below absolute zero; leave the cell empty if it is missing")
        elif channel.kind == "tendon_tension" and channel.role == "input":
            slack = max(SLACK_SIGMAS * (channel.noise or 0.0), _ZERO_OFFSET, _OF_LARGEST * np.nanmax(column, initial=0.0))
            advice = f"a tendon cannot push (down to {-slack:.3g} N passes as noise or zero offset); correct the sign"
            _check_floor(table, channel, column, -slack, advice)


def _check_finite(table: Table, name: str, column: np.ndarray) -> None:
    if len(infinite := np.flatnonzero(np.isinf(column))):
        raise DataError(f"{table.cell(int(infinite[0]), name)}: infinite value; write a number, or nothing if it is missing")


def _check_floor(table: Table, channel: Channel, column: np.ndarray, floor: float, advice: str) -> None:
    if len(below := np.flatnonzero(column < floor)):
        at = int(below[0])
        read = float(table.columns[channel.name][at])
        raise DataError(f"{table.cell(at, channel.name)}: {read!r} {channel.unit}, {advice}")


def why_unusable(trial: Trial, channels: Sequence[Channel]) -> str:
    """Why nothing can be learnt from a trial; empty if something can."""
    if len(trial.time) < _LEAST_SAMPLES:
        return f"{len(trial.time)} samples, at least {_LEAST_SAMPLES} are needed"
    outputs = [trial.values[channel.name] for channel in channels if channel.role == "output"]
    if all(np.all(np.isnan(column)) for column in outputs):
        return "not one output value in it"
    return ""


def check_roles(channels: Sequence[Channel]) -> None:
    """Raises DataError for a set without input or without output."""
    for role in ("input", "output"):
        if not any(channel.role == role for channel in channels):
            raise DataError(f'no {role} channel; give at least one [[channel]] role = "{role}"')


def check_trials(channels: Sequence[Channel], trials: Sequence[Trial], left_out: Sequence[str], least_trials: int) -> None:
    """Raises DataError for too few usable trials, and for a channel without a single value in them."""
    if len(trials) < least_trials:
        needed = f"at least {least_trials} are needed, each with {_LEAST_SAMPLES} samples and an output value"
        why = f" ({'; '.join(left_out[:3])}{', ...' if len(left_out) > 3 else ''})" if left_out else ""
        raise DataError(f"{len(trials)} usable trials; {needed}{why}")
    for channel in channels:
        if trials and all(np.all(np.isnan(trial.values[channel.name])) for trial in trials):
            raise DataError(f"channel {channel.name} has no value in any usable trial; remove it, or export the data again")
