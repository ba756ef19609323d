"""Stage `calibrate`: estimate the noise of the fitted trials and fit the robot's own uncertain parameters to them."""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.checks.jump_detection import may_be_clamp, next_jump, stands
from twin.diagnosis.checks.spikes import without_spikes
from twin.diagnosis.checks.zero_jumps import Jump, with_zero_jumps
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.evidence.scored_model import ScoredModel, score_model
from twin.diagnosis.fit_context import FitContext, Progress
from twin.diagnosis.split import blind
from twin.diagnosis.thresholds import MOST_JUMPS
from twin.foundation.errors import SolveError
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin


def calibrate(
    prepared: PreparedRecording,
    twin: Twin,
    held_out: Sequence[int],
    nominal: Sequence[np.ndarray],
    settings: Settings,
    progress: Progress,
) -> tuple[FitContext, ScoredModel, list[str]]:
    """Return the fit context of the fitted trials, the calibrated robot, and assumptions and omissions in words.

    `nominal` (n_k, n_output) is the prediction before calibration. From here on the measurements of the `held_out` trials are
    absent.
    """
    budget = Budget(settings.budget)
    fitted = [k for k in range(len(prepared.inputs)) if k not in held_out]
    prepared, alone = without_spikes(blind(prepared, held_out), nominal)
    progress("noise")
    start, objective, notes = objective_of(prepared, twin, fitted, settings)
    context = FitContext(objective, Evidence(prepared, fitted, objective.whitener.noise.drive), progress, budget)
    progress("calibration")
    return context, score_model(context, _with_jumps(context, fit(objective, start, refresh=True))), [*alone, *notes]


def _with_jumps(context: FitContext, base: Fit) -> Fit:
    """Return the calibrated robot, fitted again with each zero that jumps, one after the other.

    With more than `MOST_JUMPS` of them they are no jumps of a zero, and none is fitted.
    """
    jumps: list[Jump] = []
    found = base
    while (jump := next_jump(context, found, jumps)) is not None:
        if len(jumps) == MOST_JUMPS:
            return base
        context.progress(f"zeros that jump, {len(jumps) + 1}")
        more = sorted([*jumps, jump], key=lambda j: j.since)
        try:
            fitted = fit(context.objective, with_zero_jumps(base.model, more), near=base.evaluation, refresh=True)
        except SolveError:  # a false jump bent the robot: a neighbouring one has no equilibrium
            break
        if not stands(context, fitted, jump) or may_be_clamp(context, found, fitted, jump):
            break
        jumps, found = more, fitted
    return found
