"""Stage `calibrate`: the noise of the fitted trials, and the robot's own uncertain parameters fitted to them."""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.calibration.objective import objective_of
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
    """The study of all trials but the `sealed` ones, the calibrated robot, and what had to be assumed or left out, in words.

    `nominal` (n_k, n_output) is the uncalibrated prediction. From here on what was measured on sealed trials is not there.
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
    """The calibrated robot, fitted again beside the zeros that jump, one after the other; where there are more than `MOST_JUMPS`,
    they are no zeros and none is taken."""
    jumps: list[Jump] = []
    found = base
    while (jump := next_jump(context, found, jumps)) is not None:
        if len(jumps) == MOST_JUMPS:
            return base
        context.progress(f"zeros that jump, {len(jumps) + 1}")
        more = sorted([*jumps, jump], key=lambda j: j.since)
        try:
            fitted = fit(context.objective, with_zero_jumps(base.model, more), near=base.evaluation, refresh=True)
        except SolveError:  # a robot bent by a jump that is none: a neighbour of it has no equilibrium
            break
        if not stands(context, fitted, jump) or may_be_clamp(context, found, fitted, jump):
            break
        jumps, found = more, fitted
    return found
