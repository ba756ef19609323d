"""A recording at even steps without empty cells, for formats that know nothing else."""

from dataclasses import replace

import numpy as np

from twin.foundation.errors import DataError
from twin.measurements.recording import Recording, Trial

MAX_FRAMES = 10_000_000


def at_even_steps(recording: Recording, rate: float) -> Recording:
    """Return the recording at `rate` samples a second: inputs hold their last reading, all others are interpolated linearly.

    A trial keeps the span in which all its channels have readings. Raises DataError for a rate that is not positive or makes more
    than MAX_FRAMES samples, and for a trial whose channels share no time.
    """
    span = sum(float(trial.time[-1] - trial.time[0]) for trial in recording.trials)
    if not 0.0 < rate * max(span, 1e-9) < MAX_FRAMES:
        raise DataError(
            f"rate {rate:g} a second over {span:g} s; a positive rate that makes fewer than {MAX_FRAMES} frames is needed"
        )
    held = {channel.name for channel in recording.inputs()}
    return replace(recording, trials=tuple(_resampled(trial, rate, held) for trial in recording.trials))


def _resampled(trial: Trial, rate: float, held: set[str]) -> Trial:
    stated = {name: np.flatnonzero(np.isfinite(values)) for name, values in trial.values.items()}
    if missing := [name for name, rows in stated.items() if len(rows) == 0]:
        raise DataError(f"{trial.name}: not one reading of {', '.join(missing)}; leave the channel or the trial out")
    first = max(float(trial.time[rows[0]]) for rows in stated.values())
    last = min(float(trial.time[rows[-1]]) for name, rows in stated.items() if name not in held)
    count = int(np.floor((last - first) * rate + 1e-6)) + 1
    if count < 2:
        raise DataError(
            f"{trial.name}: its channels have readings at the same time for {last - first:.3g} s only; leave the trial out"
        )
    time = first + np.arange(count) / rate
    values = {}
    for name, rows in stated.items():
        at, readings = trial.time[rows], trial.values[name][rows]
        before = np.maximum(np.searchsorted(at, time + 1e-9, side="right") - 1, 0)
        values[name] = readings[before] if name in held else np.interp(time, at, readings)
    start = None if trial.start is None else trial.start + first
    return replace(trial, time=np.arange(count) / rate, values=values, start=start, clouds=None)
