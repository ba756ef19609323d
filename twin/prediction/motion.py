"""How far shapes lag behind fast commands and swing past them: decided by the data, where commands are so fast."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from twin.body import Drive
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import Trace, can_step, simulate
from twin.prediction.twin import Twin

LEAST_SWING = 0.1  # sigma (RMS) of outputs, by which inertia must move them for steps to be tried: a smaller error is not seen
LONGEST_STEPPED = 300.0  # s of all trials, which take a rod's steps up to two minutes
# sigma (RMS) of outputs, by which steps of a model's motion may err: 0.02 to 0.03 on the example days of the independent simulator
# in steps of 2 ms; 0.12 on a servo arm that steps of its command swing at 9 rad/s, of which joint friction, whose steps are half
# as long, was once claimed
STEP_ERROR = 0.05
MOST_HALVINGS = 2  # four times the time
TRIALS_NAMED = 3  # of those in which bodies touch
SOONER = "shapes follow fast tensions sooner than the described damping lets them: it is left out of this prediction"


def motion_as_measured(
    prepared: PreparedRecording, twin: Twin, predicted: Sequence[np.ndarray], trials: Sequence[int], steps: bool = True
) -> tuple[PreparedRecording, tuple[np.ndarray, ...]]:
    """Return the recording, to be predicted as the listed trials show that it moves, and that prediction.

    `predicted` (n_k, n_output) SI, of all trials, is by statics with the body's damping. The damping of a body is seldom known, and
    steps of MuJoCo need some; a body of less follows its tensions sooner. What is later than the damping allows is no reason to
    leave it out. Where inertia shows, and there is time for `steps`, these are tried (`with_swing`).

    Nothing is calibrated yet: what an affine map of the prediction explains, a camera that is not aligned or a body too stiff, does
    not count. Trials that pull and never release hardly tell a late body from a stiff one. A model that controls drive is always
    stepped (`in_steps_that_suffice`).
    """
    if Drive.CONTROL in prepared.drives:
        return prepared, tuple(predicted)
    if any(i.damped for i in prepared.inputs):
        at_once = without_damping(prepared)
        with suppress(SolveError):
            other = _predicted(at_once, twin)
            if _closer(prepared, trials, predicted, other, _usual_noise(prepared)) > 0.0:
                prepared, predicted = replace(at_once, notices=(*at_once.notices, SOONER)), other
    found = with_swing(prepared, twin, predicted, trials) if steps else None
    return (prepared, tuple(predicted)) if found is None else found


def with_swing(
    prepared: PreparedRecording,
    twin: Twin,
    predicted: Sequence[np.ndarray],
    trials: Sequence[int],
    sigma: np.ndarray | None = None,
) -> tuple[PreparedRecording, tuple[np.ndarray, ...]] | None:
    """Return the recording with what steps of this twin add to its statics, in each output, and its prediction.

    None where that is less than can be seen, or no nearer to the listed trials than `predicted` (n_k, n_output), NaN in
    others, and where the steps are lost. Of a twin that differs, statics and this addition together err by the addition's change.
    What can be seen is judged by the noise `sigma` (n_output,) SI of the outputs, by default as declared or as is typical.
    """
    still = without_swing(prepared)
    shown = [y if i.swing is None else y - i.swing for y, i in zip(predicted, prepared.inputs, strict=True)]
    sigma = _usual_noise(prepared) if sigma is None else sigma
    if not (_may_swing(still) and swings(still, shown, sigma)):
        return None
    try:
        moving = _stepped(still, twin)
        closer = _closer(prepared, trials, predicted, moving, sigma) > 0.0
        return (_swinging(still, twin, moving), moving) if closer else None
    except SolveError:
        return None


def swings(prepared: PreparedRecording, predicted: Sequence[np.ndarray], sigma: np.ndarray) -> bool:
    """Return whether inertia may show in the outputs (n_k, n_output) of statics, of noise `sigma` (n_output,).

    A mode of circular frequency w that follows x(t) is off by x''/w^2 to first order; the lowest mode counts. Of lengths that are
    driven, damping with the time constant tau adds tau x' to the tensions that are read.
    """
    body = prepared.robot.build()
    w = 2.0 * np.pi * body.first_mode_frequency()
    pushed = Drive.DISPLACEMENT in prepared.drives
    tau = np.array([body.damping_time if pushed and o.group == "tension" else 0.0 for o in prepared.outputs])
    off = []
    for y, i in zip(predicted, prepared.inputs, strict=True):
        if len(i.time) > 2:
            rate = np.gradient(y, i.time, axis=0)
            off.append((tau * rate + np.gradient(rate, i.time, axis=0) / w**2) / sigma)
    return bool(off) and float(np.sqrt(np.nanmean(np.concatenate(off) ** 2))) > LEAST_SWING


def in_steps_that_suffice(prepared: PreparedRecording, twin: Twin) -> tuple[PreparedRecording, Twin]:
    """Return a recording whose controls drive its robot, and the twin, in steps that err by `STEP_ERROR` at most.

    Steps are halved, up to `MOST_HALVINGS` times, until steps half as long move the prediction by no more. Else effects that are
    stepped differently gain by that alone. Notices say which step was taken, what error is left, and which bodies touch.
    """
    if Drive.CONTROL not in prepared.drives:
        return prepared, twin
    first = step = float(getattr(prepared.robot.build(), "longest_step", 0.0))
    halvings, moved = 0, np.inf
    with suppress(SolveError):
        traces = simulate(twin, prepared)
        now = tuple(t.outputs(twin, prepared) for t in traces)
        prepared = replace(prepared, notices=(*prepared.notices, *_contacts(prepared, traces)))
        while True:
            finer = _in_steps(twin, 0.5 * step)
            halved = _predicted(prepared, finer)
            off = (np.concatenate(halved) - np.concatenate(now)) / _usual_noise(prepared)
            moved = float(np.sqrt(np.nanmean(off**2)))
            if moved <= STEP_ERROR or halvings == MOST_HALVINGS:
                break
            twin, now, step, halvings = finer, halved, 0.5 * step, halvings + 1
    told = []
    if halvings:
        told.append(f"steps of {1e3 * step:g} ms: those of {1e3 * first:g} ms err by more than {STEP_ERROR} sigma on these trials")
    if STEP_ERROR < moved < np.inf:
        told.append(
            f"steps half as long as {1e3 * step:g} ms move the prediction by {moved:.2g} sigma (RMS): set timestep = "
            f"{0.5 * step:g} in [structure] of robot.toml, or what is left may be the error of steps"
        )
    return replace(prepared, robot=twin.robot, notices=(*prepared.notices, *told)), twin


def _contacts(prepared: PreparedRecording, traces: Sequence[Trace]) -> tuple[str, ...]:
    """Return, in words, which bodies of the described robot touch in which trials."""
    body, met = prepared.robot.build(), dict[tuple[str, str], list[str]]()
    for inputs, trace in zip(prepared.inputs, traces, strict=True):
        if trace.solution is not None:
            for pair, row in body.touching(trace.solution.q).items():
                met.setdefault(pair, []).append(f"{inputs.name} from {inputs.time[row]:.3g} s")
    return tuple(
        f"{a} and {b} touch in the motion described ({', '.join(when[:TRIALS_NAMED])}{' ...' * (len(when) > TRIALS_NAMED)}): "
        "contacts are stepped as MuJoCo has them, and nothing is fitted through them; if the built ones do not touch, <exclude> "
        "the pair in the MJCF"
        for (a, b), when in met.items()
    )


def _in_steps(twin: Twin, step: float) -> Twin:
    return replace(twin, robot=replace(twin.robot, structure={**twin.robot.structure, "timestep": step}))


def _may_swing(prepared: PreparedRecording) -> bool:
    """Return whether the robot can be stepped through trials as long as these, and neither currents nor controls drive it."""
    lasts = sum(float(i.time[-1] - i.time[0]) for i in prepared.inputs)
    return not {Drive.CURRENT, Drive.CONTROL} & set(prepared.drives) and lasts <= LONGEST_STEPPED and can_step(prepared)


def moving_like(whole: PreparedRecording, prepared: PreparedRecording, twin: Twin) -> PreparedRecording:
    """Return all rows of a recording, to be predicted as `prepared` is, some of its rows."""
    whole = whole if any(i.damped for i in prepared.inputs) else without_damping(whole)
    if all(i.swing is None for i in prepared.inputs):
        return whole
    with suppress(SolveError):
        whole = _swinging(whole, twin, _stepped(whole, twin))
    return whole


def without_swing(prepared: PreparedRecording) -> PreparedRecording:
    """Return the recording, to be predicted by statics alone."""
    return replace(prepared, inputs=tuple(replace(i, swing=None) for i in prepared.inputs))


def without_damping(prepared: PreparedRecording) -> PreparedRecording:
    """Return the recording, its shapes to be predicted as if they followed tensions at once."""
    return replace(prepared, inputs=tuple(replace(i, damped=False) for i in prepared.inputs))


def _predicted(prepared: PreparedRecording, twin: Twin) -> tuple[np.ndarray, ...]:
    return tuple(t.outputs(twin, prepared) for t in simulate(twin, prepared))


def _stepped(prepared: PreparedRecording, twin: Twin) -> tuple[np.ndarray, ...]:
    return tuple(t.outputs(twin, prepared) for t in simulate(twin, prepared, dynamic=True))


def _swinging(prepared: PreparedRecording, twin: Twin, moving: Sequence[np.ndarray]) -> PreparedRecording:
    each = zip(prepared.inputs, moving, _predicted(prepared, twin), strict=True)
    return replace(prepared, inputs=tuple(replace(i, swing=m - s) for i, m, s in each))


def _usual_noise(prepared: PreparedRecording) -> np.ndarray:
    """Return the noise (n_output,) SI of the outputs, as declared or as is typical."""
    return np.array([o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise for o in prepared.outputs])


def _closer(
    prepared: PreparedRecording,
    trials: Sequence[int],
    first: Sequence[np.ndarray],
    second: Sequence[np.ndarray],
    sigma: np.ndarray,
) -> float:
    """Return by how much |z|^2 of the listed trials is less of the second prediction than of the first."""
    y, before, after = (np.concatenate([of[k] for k in trials]) for of in (prepared.measured, first, second))
    A, fall = np.column_stack([np.ones(len(y)), before]), 0.0
    for j in range(y.shape[1]):
        seen = np.isfinite(y[:, j])
        r = (y[:, j : j + 1] - np.column_stack([before[:, j], after[:, j]]))[seen]
        left = r - A[seen] @ np.linalg.lstsq(A[seen], r, rcond=None)[0]
        fall += float((left[:, 0] ** 2).sum() - (left[:, 1] ** 2).sum()) / sigma[j] ** 2
    return fall
