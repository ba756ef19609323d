"""A check for commands that change far within one row: the log does not say when, and a lag or a delay depends on it."""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.checks.zero_jumps import of_robot
from twin.diagnosis.search.lag_or_delay import LATE
from twin.diagnosis.thresholds import COMMAND_STEP_SHARE, ERROR_AFTER_STEP_RATIO
from twin.prediction.prepared import PreparedRecording


def undersampled_commands(prepared: PreparedRecording, trials: Sequence[int], found: Fit) -> list[str]:
    """Return a notice if the error beside a lag or a delay is largest just after such commands; else nothing.

    A command is taken to change linearly between rows. A step at some time in between, followed with a delay, leaves an error of up
    to the whole step, whatever the effect.
    """
    late = [e.id for e in of_robot(found.model.twin.effects) if e.id in LATE]
    if not late:
        return []
    span = np.max([np.ptp(prepared.inputs[k].command, axis=0) for k in trials], axis=0)
    after, apart = [], []
    for k in trials:
        far = (np.abs(np.diff(prepared.inputs[k].command, axis=0)) > COMMAND_STEP_SHARE * np.maximum(span, 1e-12)).any(axis=1)
        after.append(np.append(False, far) | np.append(np.append(False, False), far[:-1]))
        apart.append(np.diff(prepared.inputs[k].time)[far])
    stepped, dt = np.concatenate(after), np.concatenate(apart)
    left = found.z.reshape(len(stepped), -1)
    there, elsewhere = (float(np.sqrt(np.nanmean(left[rows] ** 2))) if rows.any() else 0.0 for rows in (stepped, ~stepped))
    if not dt.size or there < ERROR_AFTER_STEP_RATIO * elsewhere:
        return []
    return [
        f"{late[0].replace('_', ' ')}: {dt.size} times a command goes more than {100 * COMMAND_STEP_SHARE:.0f} % of its range "
        f"within one row of {np.median(dt):.2g} s, and the error in the two rows after is {there / elsewhere:.1f} times that "
        "elsewhere; the log does not say when the command changed, and no effect can make up for that: log commands as often as "
        "the drives get them"
    ]
