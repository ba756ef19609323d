"""Devices on clocks of their own in one table: rows in which only inputs were read lie between those of the outputs.

A twin is solved in the rows of the outputs, driven by straight lines between the readings of each input. Rows between them are kept
where the inputs leave such a line, so that a robot with memory is led along the same path.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.measurements import Channel, Recording, Trial

STRAIGHT = 3.0  # standard deviations from a straight line that a reading of an input may be off: noise goes so far once in 370
RESOLUTION = 1e-3  # of an input's range, which stands for the noise of one without
HELD = frozenset({"sma_current", "sma_voltage"})  # what keeps its value from one reading to the next


def on_rows_of_outputs(recording: Recording) -> Recording:
    """Return the recording without rows that only lead a twin from one reading of an output to the next, and a notice.

    Only trials are changed in which an input has empty cells, no output is read in some rows, and no point clouds are. In these the
    inputs and the surroundings are interpolated linearly in the rows that are left. A recording without any is returned as is.
    """
    if any(c.kind in HELD for c in recording.inputs()):
        return recording
    off = {c.name: _tolerance(recording, c) for c in recording.inputs()}
    trials = tuple(_thinned(t, recording, off) for t in recording.trials)
    changed = [k for k, t in enumerate(trials) if t is not recording.trials[k]]
    if not changed:
        return recording
    before, after = (sum(len(of[k].time) for k in changed) for of in (recording.trials, trials))
    said = (
        f"{len(changed)} trial{'s' if len(changed) > 1 else ''} with clocks of several devices ({_intervals(recording, changed)}): "
        f"inputs follow straight lines between their readings; {before - after} of {before} rows, on these lines and without "
        "output, are not solved"
    )
    return replace(recording, trials=trials, notices=(*recording.notices, said))


def _tolerance(recording: Recording, channel: Channel) -> float:
    values = np.concatenate([t.values[channel.name] for t in recording.trials])
    known = values[np.isfinite(values)]
    return STRAIGHT * (channel.noise or RESOLUTION * (float(np.ptp(known)) if known.size else 0.0))


def _thinned(trial: Trial, recording: Recording, off: dict[str, float]) -> Trial:
    inputs = [c.name for c in recording.inputs()]
    holed = [n for n in inputs if np.isnan(trial.values[n]).any()]
    seen = np.any([np.isfinite(trial.values[c.name]) for c in recording.outputs()], axis=0)
    if not holed or seen.all() or not seen.any() or trial.clouds is not None:
        return trial
    if any(np.isnan(trial.values[n]).all() for n in inputs):
        return trial  # refused later, by its name
    kept = _kept(trial, seen, off)
    led = {*inputs, *(c.name for c in recording.contexts())}
    values = {n: (_led(trial, n) if n in led else v)[kept] for n, v in trial.values.items()}
    return replace(trial, time=trial.time[kept], values=values)


def _led(trial: Trial, name: str) -> np.ndarray:
    """Return a channel (n,) with straight lines between its readings; as it is where it has none."""
    known = np.isfinite(trial.values[name])
    return np.interp(trial.time, trial.time[known], trial.values[name][known]) if known.any() else trial.values[name]


def _kept(trial: Trial, seen: np.ndarray, off: dict[str, float]) -> np.ndarray:
    """Return the rows (n,) to solve: those seen, and of each stretch between them those farthest off a line, until none is off."""
    kept, led = seen.copy(), np.stack([_led(trial, n) for n in off], axis=1)
    read = np.stack([np.isfinite(trial.values[n]) for n in off], axis=1)
    most = np.array([max(o, np.finfo(float).tiny) for o in off.values()])
    while True:
        line = np.stack([np.interp(trial.time, trial.time[kept], column[kept]) for column in led.T], axis=1)
        away = (np.abs(led - line) / most * read).max(axis=1)
        part = np.cumsum(kept)
        for rows in np.split(np.arange(len(kept)), np.flatnonzero(np.diff(part)) + 1):
            worst = rows[np.argmax(away[rows])]
            kept[worst] |= away[worst] > 1.0
        if part[-1] == kept.sum():
            return kept


def _intervals(recording: Recording, changed: Sequence[int]) -> str:
    """Return how often inputs and outputs are read: the least and the largest median interval of a channel."""
    said = []
    for role, channels in (("inputs", recording.inputs()), ("outputs", recording.outputs())):
        steps = [np.concatenate([np.diff(t.time[np.isfinite(t.values[c.name])]) for t in (recording.trials[k] for k in changed)])
                 for c in channels]  # fmt: skip
        every = [f"{f([np.median(s) for s in steps if s.size]):.2g}" for f in (min, max)]
        said.append(f"{role} read every {' to '.join(dict.fromkeys(every))} s")
    return ", ".join(said)
