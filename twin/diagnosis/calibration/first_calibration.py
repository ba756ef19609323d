"""The first calibration, under a rough noise model; what it leaves gives the noise by which later fits are whitened."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from twin.body import Drive
from twin.diagnosis.calibration.fit import StopRule, fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import Evaluation, Objective
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.noise.estimate import estimate_noise
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.diagnosis.thresholds import READING_STEP
from twin.mechanics.springs.heat import thermal_time_constant
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import SolveOptions, Trace, simulate
from twin.prediction.twin import Twin


def objective_of(
    prepared: PreparedRecording, twin: Twin, fitted: list[int], settings: Settings
) -> tuple[Model, Objective, list[str]]:
    """Return a first calibration under a rough noise model, the objective of every later fit, and notices."""
    measured = [prepared.measured[k] for k in fitted]
    command = [prepared.inputs[k].command for k in fitted]
    rough = np.array([o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise for o in prepared.outputs])
    first = Noise(rough, np.zeros(prepared.n_tendon), np.zeros(len(rough)), "start")
    none = [np.zeros((*y.shape, prepared.n_tendon)) for y in measured]
    rough_fit = Objective(prepared, fitted, Whitener(first, measured, none, command), settings.jobs)
    start = fit(rough_fit, Model.base(twin.robot, twin), stop=StopRule(tolerance=1e-3))
    unmeasured = rough_fit.predict(start.model.twin, start.evaluation.traces)[1]
    taut = sensitivity(_unslackened(prepared), fitted, start.model.twin, unmeasured, start.evaluation.traces)
    G = [g * _taut_share(prepared, k)[:, None, :] for g, k in zip(taut, fitted, strict=True)]
    noise, notes = estimate_noise(prepared, fitted, start.evaluation.raw, G)
    return start.model, Objective(prepared, fitted, Whitener(noise, measured, G, command, taut), settings.jobs), notes


def _unslackened(prepared: PreparedRecording) -> PreparedRecording:
    """Return the recording with no tension reading below zero, so that every tendon responds to more tension."""
    pulled = prepared.silenced_below_zero
    return replace(
        prepared, inputs=tuple(replace(i, command=np.where(pulled, np.maximum(i.command, 0.0), i.command)) for i in prepared.inputs)
    )


def _taut_share(prepared: PreparedRecording, k: int) -> np.ndarray:
    """Return the share (n_k, n_tendon) of `sensitivity`'s step that makes a tendon pull; zero far below zero tension."""
    below = np.clip(1.0 + prepared.inputs[k].command / (READING_STEP * prepared.reading), 0.0, 1.0)
    return np.where(prepared.silenced_below_zero, below, 1.0)


def noise_under(objective: Objective, found: Evaluation) -> Noise:
    """Estimate the noise of the fitted trials again, under a model with its effects. Raise SolveError as `sensitivity`.

    The first calibration has no effects, and takes ageing or memory between two repeats of a trial for noise.
    """
    return estimate_noise(objective.prepared, objective.trials, found.raw, sensitivity_at(objective, found))[0]


def sensitivity_at(objective: Objective, found: Evaluation) -> list[np.ndarray]:
    """Return the `sensitivity` of an evaluated model."""
    prepared, trials, twin = objective.prepared, objective.trials, found.model.twin
    predicted = [found.traces[k].outputs(twin, prepared) for k in trials]
    return sensitivity(prepared, trials, twin, predicted, found.traces)


def sensitivity(
    prepared: PreparedRecording,
    trials: Sequence[int],
    twin: Twin,
    predicted: Sequence[np.ndarray],
    near: Mapping[int, Trace] | None = None,
) -> list[np.ndarray]:
    """Return dy/du (n_k, n_output, n_tendon) SI: the prediction's response to a constant change of each driving reading.

    A spring averages the errors of its current over its time constant tau. White errors from row to row, dt apart, have sqrt(dt /
    (2 tau)) of the influence of a constant one.
    """
    out = [np.zeros((*y.shape, prepared.n_tendon)) for y in predicted]
    share_of_constant = np.ones((len(out), prepared.n_tendon))
    if Drive.CURRENT in prepared.drives:
        rows = np.array([[np.median(np.diff(prepared.inputs[k].time))] for k in trials])
        averaged = np.sqrt(np.minimum(1.0, rows / (2.0 * thermal_time_constant(prepared.robot.springs(prepared.n_tendon)))))
        share_of_constant = np.where(prepared.driven_by(Drive.CURRENT), averaged, share_of_constant)
    for t in np.flatnonzero(~prepared.driven_by(Drive.CONTROL)):  # controls are known exactly
        step = READING_STEP * prepared.reading[t]
        push = step * np.eye(prepared.n_tendon)[t]
        moved = replace(prepared, inputs=tuple(replace(i, command=i.command + push) for i in prepared.inputs))
        traces = simulate(twin, moved, trials=trials, options=SolveOptions(near or {}))
        for G, y, trace, share in zip(out, predicted, traces, share_of_constant[:, t], strict=True):
            G[:, :, t] = share * (trace.outputs(twin, prepared) - y) / step
    return out
