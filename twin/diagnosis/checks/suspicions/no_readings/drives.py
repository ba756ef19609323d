"""Cells of a drive that are no reading: without them the robot as described does what the outputs show, with them it does not.

A robot with inertia, or with a slow drive, answers late and for long, so that no single row tells. A trial is predicted again with
the cells left empty, as `prepare` fills them: on straight lines between the cells around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case
from twin.diagnosis.thresholds import LEFT_BY_FILE_CHANGE, SHARED_MOTION_SHARE, SPIKE_WINDOW, UNMISSABLE_MOTION
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.simulate import simulate


def no_readings(case: Case, drive: int, trial: int, runs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return which of these runs of rows, in order, of a drive the outputs of a trial do not answer to."""
    if case.predicted is None:
        return []
    as_is = _Answer.of(case, trial, case.predicted[trial])
    runs = [(a, b) for a, b in runs if as_is.astray(a, b + max(b - a, SPIKE_WINDOW))]
    if not runs:
        return []
    inputs, empty = case.prepared.inputs[trial], np.zeros(len(case.prepared.inputs[trial].time), bool)
    for a, b in runs:
        empty[a:b] = True
    command = inputs.command.copy()
    command[empty, drive] = np.interp(inputs.time[empty], inputs.time[~empty], command[~empty, drive])
    each = [replace(i, command=command) if k == trial else i for k, i in enumerate(case.prepared.inputs)]
    prepared = replace(case.prepared, inputs=tuple(each))
    try:
        (trace,) = simulate(case.twin, prepared, trials=[trial])
    except SolveError:
        return []
    shown = trace.outputs(case.twin, prepared)
    answer = _Answer.of(case, trial, shown)
    return [(a, b) for (a, b), (end, _) in pairwise([*runs, (len(empty), 0)]) if answer.closer(a, end)]


@dataclass(frozen=True)
class _Answer:
    """The outputs of a trial, in their noise, beside its prediction without some cells of a drive."""

    left: np.ndarray  # (n, m) measured less predicted without the cells
    change: np.ndarray  # (n, m) of the prediction by the cells

    @classmethod
    def of(cls, case: Case, trial: int, without: np.ndarray) -> _Answer:
        """Compare with the outputs that are in the file, held out or not: what is no reading is a matter of the file alone."""
        values = next(t.values for t in case.prepared.recording.trials if t.name == case.prepared.inputs[trial].name)
        columns = [j for j, o in enumerate(case.prepared.outputs) if o.channel.name in values]
        outputs = [case.prepared.outputs[j] for j in columns]
        noise = np.array([o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise for o in outputs])
        read = np.stack([values[o.channel.name] for o in outputs], axis=1)
        assert case.predicted is not None
        return cls((read - without[:, columns]) / noise, (case.predicted[trial] - without)[:, columns] / noise)

    def astray(self, first: int, end: int) -> bool:
        """Return whether the outputs leave the prediction by what cannot be missed in rows `first` to `end`: else all is well."""
        off = self._since(first, end)
        most = float(np.linalg.norm(np.nan_to_num(off), axis=1).max(initial=0.0))
        return most > UNMISSABLE_MOTION * np.sqrt(max(1, np.isfinite(off).any(axis=0).sum()))

    def _since(self, first: int, end: int) -> np.ndarray:
        """Return what is left (n, m) in rows `first` to `end` less the mean of the rows just before, of outputs read there."""
        beside = self.left[max(0, first - SPIKE_WINDOW) : first]
        known = np.isfinite(beside).any(axis=0)
        return np.where(known, self.left[first:end] - np.nanmean(np.where(known, beside, 0.0), axis=0), np.nan)

    def closer(self, first: int, end: int) -> bool:
        """Return whether, in rows `first` to `end`, the outputs do not show what the cells do to the prediction.

        What the description is wrong about just before is taken off. Rows count in which the cells do a quarter of the most that
        they do: in others the description's own errors are as large.
        """
        without = self._since(first, end)
        there = np.isfinite(without)
        without, change = np.where(there, without, 0.0), np.where(there, self.change[first:end], 0.0)
        size = np.linalg.norm(change, axis=1)
        most = float(size.max(initial=0.0))
        if not most > UNMISSABLE_MOTION * np.sqrt(max(1, there.any(axis=0).sum())):
            return False
        acts = size > SHARED_MOTION_SHARE * most
        return bool(np.linalg.norm(without[acts]) < LEFT_BY_FILE_CHANGE * np.linalg.norm((without - change)[acts]))
