"""Stage `calibrate`: the noise of the fitted trials, and the robot's own uncertain parameters fitted to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.bench import Bench
from twin.calibrate import Fit, fit
from twin.diagnose.budget import Budget
from twin.diagnose.diagnosis import Settings
from twin.diagnose.evidence import Evidence
from twin.diagnose.jumps import may_be_clamp, next_jump, stands
from twin.diagnose.objective import objective_of
from twin.diagnose.spikes import without_spikes
from twin.diagnose.split import blind
from twin.diagnose.study import Progress, Study
from twin.diagnose.thresholds import JUMPS
from twin.diagnose.weigh import Weighed, weigh
from twin.diagnose.zeros import Jump, jumping
from twin.errors import SolveError
from twin.twin import Twin


def calibrate(
    bench: Bench, twin: Twin, sealed: Sequence[int], nominal: Sequence[np.ndarray], settings: Settings, progress: Progress
) -> tuple[Study, Weighed, list[str]]:
    """The study of all trials but the `sealed` ones, the calibrated robot, and what had to be assumed or left out, in words.

    `nominal` (n_k, n_output) is the uncalibrated prediction. From here on what was measured on sealed trials is not there.
    """
    budget = Budget(settings.budget)
    fitted = [k for k in range(len(bench.inputs)) if k not in sealed]
    bench, alone = without_spikes(blind(bench, sealed), nominal)
    progress("noise")
    start, objective, notes = objective_of(bench, twin, fitted, settings)
    study = Study(objective, Evidence(bench, fitted, objective.whitener.noise.drive), progress, budget)
    progress("calibration")
    return study, weigh(study, _with_jumps(study, fit(objective, start, refresh=True))), [*alone, *notes]


def _with_jumps(study: Study, base: Fit) -> Fit:
    """The calibrated robot, fitted again beside the zeros that jump, one after the other; where there are more than `JUMPS`, they
    are no zeros and none is taken."""
    jumps: list[Jump] = []
    found = base
    while (jump := next_jump(study, found, jumps)) is not None:
        if len(jumps) == JUMPS:
            return base
        study.progress(f"zeros that jump, {len(jumps) + 1}")
        more = sorted([*jumps, jump], key=lambda j: j.since)
        try:
            fitted = fit(study.objective, jumping(base.model, more), near=base.evaluation, refresh=True)
        except SolveError:  # a robot bent by a jump that is none: a neighbour of it has no equilibrium
            break
        if not stands(study, fitted, jump) or may_be_clamp(study, found, fitted, jump):
            break
        jumps, found = more, fitted
    return found
