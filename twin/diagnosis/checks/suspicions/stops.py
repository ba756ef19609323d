"""Joints that end earlier than described: an angle that stays at its end while its drive goes on."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.thresholds import GONE_ON, UNMISSABLE_MOTION
from twin.prediction.evaluate import OUTPUT_GROUPS

ANGLES = ("angle", "joint angle")  # groups of outputs


def ends(case: Case) -> Iterator[Suspicion]:
    """Yield joints that stay at the end of what they were seen at, while a drive goes on and the robot as described moves with it.

    A joint that rubs stays where it is when its drive turns back, not while it goes on.
    """
    if case.predicted is None:
        return
    command = np.concatenate([case.prepared.inputs[k].command for k in case.trials])
    drives = np.abs(command - command[0]).max(axis=0)
    for j, o in enumerate(case.prepared.outputs):
        seen = np.concatenate([case.prepared.measured[k][:, j] for k in case.trials])
        if o.group not in ANGLES or not np.isfinite(seen).any():
            continue
        width = UNMISSABLE_MOTION * (o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise)
        for end in (np.nanmax(seen), np.nanmin(seen)):
            if any(_goes_on(case, k, j, np.abs(case.prepared.measured[k][:, j] - end) < width, drives, width) for k in case.trials):
                at = OUTPUT_GROUPS[o.group].factor * float(np.median(seen[np.abs(seen - end) < width]))
                words = f"{o.channel.name} ends at {at:.3g} {OUTPUT_GROUPS[o.group].unit} while the drives go on: a stop"
                change = "leave its rows at the stop empty, or use a robot that has the stop"
                yield Suspicion("end stop", words, change)


def _goes_on(case: Case, k: int, j: int, at_end: np.ndarray, drives: np.ndarray, width: float) -> bool:
    """Return whether in some run of rows at the end a drive goes on by `GONE_ON`, and the predicted joint with it."""
    assert case.predicted is not None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_end, [False]]).astype(int)))
    for first, stop in list(pairwise(edges))[::2]:
        command, predicted = np.abs(case.prepared.inputs[k].command[first:stop]), case.predicted[k][first:stop, j]
        gone = (command.max(axis=0) - command[0])[drives > 0.0] / drives[drives > 0.0]
        if first > 0 and gone.size and gone.max() >= GONE_ON and np.ptp(predicted) > width:
            return True
    return False
