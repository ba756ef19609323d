"""What every fit of a diagnosis minimises: the residual of the fitted trials made white by a noise found from the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from twin.bench import Bench
from twin.calibrate import Evaluation, Model, Objective, fit
from twin.diagnose.diagnosis import Settings
from twin.diagnose.thresholds import PUSHED
from twin.effects import Drive
from twin.evaluate import TYPICAL
from twin.noise import Noise
from twin.residual import estimate_noise
from twin.springs.heat import memory
from twin.twin import Trace, Twin, Way, readings, report, simulate
from twin.whitener import Whitener


def objective_of(bench: Bench, twin: Twin, fitted: list[int], settings: Settings) -> tuple[Model, Objective, list[str]]:
    """A first calibration under a guessed noise, and the objective every later fit uses."""
    measured = [bench.measured[k] for k in fitted]
    command = [bench.inputs[k].command for k in fitted]
    rough = np.array([o.channel.noise or TYPICAL[o.group] for o in bench.outputs])
    first = Noise(rough, np.zeros(bench.n_tendon), np.zeros(len(rough)), "start")
    none = [np.zeros((*y.shape, bench.n_tendon)) for y in measured]
    rough_fit = Objective(bench, fitted, Whitener(first, measured, none, command), settings.jobs)
    start = fit(rough_fit, Model.base(twin.robot, twin), tolerance=1e-3)
    unmeasured = rough_fit.predict(start.model.twin, start.evaluation.traces)[1]
    taut = sensitivity(_unslackened(bench), fitted, start.model.twin, unmeasured, start.evaluation.traces)
    G = [g * _felt(bench, k)[:, None, :] for g, k in zip(taut, fitted, strict=True)]
    noise, notes = estimate_noise(bench, fitted, start.evaluation.raw, G)
    return start.model, Objective(bench, fitted, Whitener(noise, measured, G, command, taut), settings.jobs), notes


def _unslackened(bench: Bench) -> Bench:
    """With no reading of a tension below zero: every tendon answers to more of it."""
    pulled = bench.driven_by(Drive.TENSION)
    return replace(
        bench, inputs=tuple(replace(i, command=np.where(pulled, np.maximum(i.command, 0.0), i.command)) for i in bench.inputs)
    )


def _felt(bench: Bench, k: int) -> np.ndarray:
    """(n_k, n_tendon) of a step in a reading, that of `sensitivity`, the share that makes a tendon pull: none far below zero."""
    below = np.clip(1.0 + bench.inputs[k].command / (PUSHED * bench.reading), 0.0, 1.0)
    return np.where(bench.driven_by(Drive.TENSION), below, 1.0)


def noise_under(objective: Objective, found: Evaluation) -> Noise:
    """The noise of the fitted trials, found anew under a model with its effects. Raises SolveError as `sensitivity`.

    The first calibration knows no effect: what ages, or remembers, between two repeats of a trial is noise to it.
    """
    return estimate_noise(objective.bench, objective.trials, found.raw, sensitivity_at(objective, found))[0]


def sensitivity_at(objective: Objective, found: Evaluation) -> list[np.ndarray]:
    """`sensitivity` of a model that was evaluated."""
    bench, trials, twin = objective.bench, objective.trials, found.model.twin
    predicted = [readings(bench, report(twin.effects, found.traces[k].true)) for k in trials]
    return sensitivity(bench, trials, twin, predicted, found.traces)


def sensitivity(
    bench: Bench, trials: Sequence[int], twin: Twin, predicted: Sequence[np.ndarray], near: Mapping[int, Trace] | None = None
) -> list[np.ndarray]:
    """dy/du (n_k, n_output, n_tendon) SI: the prediction's answer to a constant change of each driving reading.

    A spring averages the errors of its current over its time constant tau: of white ones from row to row, dt apart, it feels
    sqrt(dt / (2 tau)) of a constant one.
    """
    out = [np.zeros((*y.shape, bench.n_tendon)) for y in predicted]
    felt = np.ones((len(out), bench.n_tendon))
    if Drive.CURRENT in bench.drives:
        rows = np.array([[np.median(np.diff(bench.inputs[k].time))] for k in trials])
        averaged = np.sqrt(np.minimum(1.0, rows / (2.0 * memory(bench.robot.springs(bench.n_tendon)))))
        felt = np.where(bench.driven_by(Drive.CURRENT), averaged, felt)
    for t in range(bench.n_tendon):
        step = PUSHED * bench.reading[t]
        push = step * np.eye(bench.n_tendon)[t]
        moved = replace(bench, inputs=tuple(replace(i, command=i.command + push) for i in bench.inputs))
        traces = simulate(twin, moved, trials=trials, way=Way(near or {}))
        for G, y, trace, share in zip(out, predicted, traces, felt[:, t], strict=True):
            G[:, :, t] = share * (readings(bench, report(twin.effects, trace.true)) - y) / step
    return out
