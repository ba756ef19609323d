"""Commands that go far from one row to the next: when they do in between is not in the log, and what is late shows that."""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.checks.zero_jumps import of_robot
from twin.diagnosis.search.lag_or_delay import LATE
from twin.diagnosis.thresholds import COMMAND_STEP_SHARE, ERROR_AFTER_STEP_RATIO
from twin.prediction.prepared import PreparedRecording


def undersampled_commands(prepared: PreparedRecording, trials: Sequence[int], found: Fit) -> list[str]:
    """Whether what is left beside a lag or a delay is left just after commands that leapt from one row to the next, in words.

    A command is taken to run straight between rows. One that steps at some time in between and is followed late leaves up to the
    whole step, whatever the law.
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
    leapt, dt = np.concatenate(after), np.concatenate(apart)
    left = found.z.reshape(len(leapt), -1)
    there, elsewhere = (float(np.sqrt(np.nanmean(left[rows] ** 2))) if rows.any() else 0.0 for rows in (leapt, ~leapt))
    if not dt.size or there < ERROR_AFTER_STEP_RATIO * elsewhere:
        return []
    return [
        f"{late[0].replace('_', ' ')}: {dt.size} times a command goes more than {100 * COMMAND_STEP_SHARE:.0f} % of its range "
        f"within one row of {np.median(dt):.2g} s, and what is left in the two rows after is {there / elsewhere:.1f} times what is "
        "left elsewhere; when the command went is not in the log, and no law makes up for that: log commands as often as the "
        "drives get them"
    ]
