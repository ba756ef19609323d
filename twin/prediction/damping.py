"""Whether shapes follow their tensions as late as the body's damping lets them: decided by the data, where rates are so fast."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.body import Drive
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin


def damped_as_measured(
    prepared: PreparedRecording, twin: Twin, predicted: Sequence[np.ndarray], trials: Sequence[int]
) -> tuple[PreparedRecording, tuple[np.ndarray, ...]]:
    """Return the recording and its prediction, without the body's damping where the listed trials are nearer to that.

    `predicted` (n_k, n_output) SI, of all trials, is with it. The damping of a body is seldom known, and steps of MuJoCo need some;
    a body of less follows its tensions sooner. What is later than the damping allows is no reason to leave it out. Nothing is
    calibrated yet: what an affine map of the prediction explains, a camera that is not aligned or a body too stiff, does not count.
    Trials that pull and never release hardly tell a late body from a stiff one.
    """
    if not any(i.damped for i in prepared.inputs) or Drive.CONTROL in prepared.drives:
        return prepared, tuple(predicted)
    at_once = without_damping(prepared)
    try:
        other = tuple(t.outputs(twin, at_once) for t in simulate(twin, at_once))
    except SolveError:
        return prepared, tuple(predicted)
    if _closer(prepared, [np.concatenate([of[k] for k in trials]) for of in (prepared.measured, predicted, other)]) <= 0.0:
        return prepared, tuple(predicted)
    words = "shapes follow fast tensions sooner than the described damping lets them: it is left out of this prediction"
    return replace(at_once, notices=(*at_once.notices, words)), other


def _closer(prepared: PreparedRecording, of: Sequence[np.ndarray]) -> float:
    """Return by how much |z|^2 is less of the second prediction than of the first; `of`: measured and both, (n, n_output) SI."""
    y, damped, at_once = of
    A, fall = np.column_stack([np.ones(len(y)), damped]), 0.0
    for j, o in enumerate(prepared.outputs):
        seen = np.isfinite(y[:, j])
        r = (y[:, j : j + 1] - np.column_stack([damped[:, j], at_once[:, j]]))[seen]
        left = r - A[seen] @ np.linalg.lstsq(A[seen], r, rcond=None)[0]
        sigma = o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise
        fall += float((left[:, 0] ** 2).sum() - (left[:, 1] ** 2).sum()) / sigma**2
    return fall


def without_damping(prepared: PreparedRecording) -> PreparedRecording:
    """Return the recording, its shapes to be predicted as if they followed tensions at once."""
    return replace(prepared, inputs=tuple(replace(i, damped=False) for i in prepared.inputs))
