"""Stage `thin`: of a log with far more rows than the robot's motion needs, every k-th row is used."""

from dataclasses import replace

import numpy as np
from scipy.stats import norm

from twin.body import Drive
from twin.diagnosis.thresholds import (
    FEWEST_ROWS_OF_TRIAL,
    MOST_MISSING_TO_THIN,
    MOTION_BETWEEN_ROWS,
    ROWS_PER_SECOND_OF_BUDGET,
    ROWS_THAT_SUFFICE,
)
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording


def thinned(recording: Recording, prepared: PreparedRecording, budget: float | None) -> tuple[Recording, int]:
    """Return the recording with every k-th row, and k: 1 where it is returned as it is.

    Logs of more than `ROWS_THAT_SUFFICE` rows are thinned as far as commands go by no more than a small part of their range from
    one kept row to the next; with a `budget` (s) to what that pays for. Rows so close that a command moves less than its noise
    would also look like reversals to what rubs. Rows are picked, not averaged: their noise stays that of a reading. What is stepped
    in time or heats (controls, currents), point clouds, and devices that take turns in the rows are left as they are.
    """
    timed = {Drive.CONTROL, Drive.CURRENT} & set(prepared.drives)
    missing = np.concatenate([np.isnan(y) for y in prepared.measured]).mean(axis=0)
    if timed or any(t.clouds is not None for t in recording.trials) or missing.max(initial=0.0) > MOST_MISSING_TO_THIN:
        return recording, 1
    total, shortest = recording.n_samples, min(len(t.time) for t in recording.trials)
    most = max(1, shortest // FEWEST_ROWS_OF_TRIAL)
    every = _largest_step(prepared, most) if total > ROWS_THAT_SUFFICE else 1
    if budget is not None:
        every = max(every, min(most, int(np.ceil(total / (ROWS_PER_SECOND_OF_BUDGET * budget)))))
    if every == 1:
        return recording, 1
    trials = tuple(replace(t, time=t.time[::every], values={n: v[::every] for n, v in t.values.items()}) for t in recording.trials)
    return replace(recording, trials=trials), every


def _largest_step(prepared: PreparedRecording, most: int) -> int:
    """Return the largest number of rows, `most` at most, in which commands go by a small part of their range.

    Compared are means of so many rows, less what their noise makes of it. One step in a hundred may be larger.
    """
    commands = [i.command for i in prepared.inputs]
    room = MOTION_BETWEEN_ROWS * np.ptp(np.concatenate(commands), axis=0)
    # The median of second differences is that of noise, of sqrt(6) times its standard deviation, wherever commands run smoothly.
    rough = np.median(np.concatenate([np.abs(np.diff(c, 2, axis=0)) for c in commands]), axis=0)
    noise = rough / (norm.ppf(0.75) * np.sqrt(6.0))
    for every in range(most, 1, -1):
        blocks = [c[: len(c) // every * every].reshape(-1, every, c.shape[1]).mean(axis=1) for c in commands]
        moved = np.quantile(np.concatenate([np.abs(np.diff(b, axis=0)) for b in blocks]), 0.99, axis=0)
        if np.all(moved <= room + norm.ppf(0.995) * np.sqrt(2.0 / every) * noise):
            return every
    return 1


def words(recording: Recording, every: int, kept: float, whole: float, unit: str) -> str:
    """Return what was left out and what it does to the error of held-out trials: of the rows `kept` and of the `whole` log."""
    rows = [len(t.time) for t in recording.trials]
    rate = float(np.median(np.concatenate([np.diff(t.time) for t in recording.trials])))
    return (
        f"{sum(rows)} rows in {len(rows)} trials, {1e3 * rate:.3g} ms apart: every {every}{_ordinal(every)} was used; the error on "
        f"held-out trials is {kept:.3g} {unit} in these and {whole:.3g} {unit} in all rows"
    )


def _ordinal(n: int) -> str:
    return "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
