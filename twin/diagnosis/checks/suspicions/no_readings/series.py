"""What each channel or marker of a file reads, trial by trial, beside the prediction of the robot as described.

What is no reading is looked for in held-out trials too: it is a matter of the file alone, and no number depends on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case
from twin.measurements import Channel
from twin.prediction.evaluate import OUTPUT_GROUPS


@dataclass(frozen=True)
class Series:
    """One trial of a channel, or of the x, y and z of a marker: readings (n, d) SI, and their prediction, NaN without one."""

    name: str
    channels: tuple[Channel, ...]
    trial: int
    time: np.ndarray
    read: np.ndarray
    shown: np.ndarray
    noise: float
    drives: bool = False

    @cached_property
    def left(self) -> np.ndarray:
        """The readings (n, d) less the prediction; the readings where nothing is predicted."""
        return self.read - np.where(np.isfinite(self.shown), self.shown, 0.0)

    @cached_property
    def at_zero(self) -> np.ndarray:
        """The rows (n,) in which all three axes of a marker are written as exactly zero."""
        zero = np.array([float(c.scale.to_si(0.0)) for c in self.channels])
        return (self.read == zero).all(axis=1) & (len(zero) == len("xyz"))

    @cached_property
    def runs(self) -> np.ndarray:
        """The beginning and end (m, 2) of each run of rows that read exactly the same; rows without a reading are in none."""
        known = np.flatnonzero(np.isfinite(self.read).all(axis=1))
        if not known.size:
            return np.empty((0, 2), int)
        new = np.flatnonzero((np.diff(known) > 1) | (np.diff(self.read[known], axis=0) != 0.0).any(axis=1)) + 1
        return np.stack([known[np.insert(new, 0, 0)], known[np.append(new - 1, -1)] + 1], axis=1)

    @cached_property
    def apart(self) -> np.ndarray:
        """How far (m,) each run is from those before and after it, at least; 0 at the ends, and where these are as far apart."""
        out, value = np.zeros(len(self.runs)), self.read[self.runs[:, 0]]
        if len(out) > 2:
            least = np.linalg.norm(np.diff(value, axis=0), axis=1)
            least = np.minimum(least[1:], least[:-1])
            out[1:-1] = np.where(least > np.linalg.norm(value[2:] - value[:-2], axis=1), least, 0.0)
        return out

    @cached_property
    def off_course(self) -> np.ndarray:
        """How far (m,) the ends of each run are, at most, from the line between the readings before and after it; 0 at the ends."""
        out, value = np.zeros(len(self.runs)), self.read[self.runs[:, 0]]
        if len(out) > 2:
            row = (value[2:] - value[:-2]) / (np.ptp(self.runs[1:-1], axis=1) + 1)[:, None]
            off = (value[1:-1] - value[:-2] - row, value[2:] - value[1:-1] - row)
            out[1:-1] = np.max([np.linalg.norm(o, axis=1) for o in off], axis=0)
        return out

    @cached_property
    def written(self) -> np.ndarray:
        """The readings (n, d) in the file's units."""
        scales = [c.scale for c in self.channels]
        return np.stack([(v - s.offset) * s.denominator / s.numerator for v, s in zip(self.read.T, scales, strict=True)], axis=1)


def of_outputs(case: Case) -> dict[str, list[Series]]:
    """Return the readings of each output as it is in the file, by channel or marker."""
    places: dict[tuple[str, int, int], list[int]] = {}
    for j, o in enumerate(case.prepared.outputs):
        if o.channel.name in case.prepared.recording.trials[0].values:  # others are made from several
            places.setdefault((o.group, o.index, -1 if OUTPUT_GROUPS[o.group].is_point else o.axis), []).append(j)
    found = {}
    for (group, _, _), columns in places.items():
        channels = tuple(case.prepared.outputs[j].channel for j in columns)
        noise = max(c.noise or OUTPUT_GROUPS[group].typical_noise for c in channels)
        shown = [p[:, columns] for p in case.predicted] if case.predicted is not None else None
        name = called_as_one(channels)
        found[name] = list(_series(case, _nothing(name, channels, noise), shown))
    return found


def of_drives(case: Case) -> dict[str, list[Series]]:
    """Return the readings of each driving channel."""
    return {c.name: list(_series(case, _nothing(c.name, (c,), c.noise or 0.0, True), None)) for c in case.prepared.drivers}


def _nothing(name: str, channels: tuple[Channel, ...], noise: float, drives: bool = False) -> Series:
    return Series(name, channels, 0, np.empty(0), np.empty((0, 1)), np.empty((0, 1)), noise, drives)


def _series(case: Case, of: Series, shown: Sequence[np.ndarray] | None) -> Iterable[Series]:
    trials = {t.name: t for t in case.prepared.recording.trials}
    for k, inputs in enumerate(case.prepared.inputs):
        trial = trials[inputs.name]
        read = np.stack([trial.values[c.name] for c in of.channels], axis=1)
        yield replace(of, trial=k, time=inputs.time, read=read, shown=np.full_like(read, np.nan) if shown is None else shown[k])


def called_as_one(channels: Sequence[Channel]) -> str:
    """Return the name that channels of one marker share: disk_3."""
    first = channels[0]
    return first.name if len(channels) == 1 else first.name.removesuffix(first.axis or "").rstrip("_.")


def headline(case: Case) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the readings (n, m) of the headline outputs in each trial, their prediction, and their noise (m,).

    Nothing where they are not in the file, or where nothing is predicted.
    """
    group = {case.prepared.outputs[j].channel.name for j in case.columns(case.group)}
    every = [trials for trials in of_outputs(case).values() if trials[0].channels[0].name in group]
    if not every or case.predicted is None:
        return []
    noise = np.concatenate([np.full(len(trials[0].channels), trials[0].noise) for trials in every])
    return [
        (np.concatenate([s.read for s in of], axis=1), np.concatenate([s.shown for s in of], axis=1), noise)
        for of in zip(*every, strict=True)
    ]


def where(case: Case, rows: dict[int, list[int]]) -> str:
    """Return how many rows these are, by trial, and when the first is."""
    k = min(rows)
    n = sum(map(len, rows.values()))
    return f"{n} row{'s' * (n > 1)}, first in {case.prepared.inputs[k].name} at {case.prepared.inputs[k].time[min(rows[k])]:.6g} s"
