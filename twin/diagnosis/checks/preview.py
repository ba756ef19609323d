"""Stage `preview`: compare the robot as described with the data, and look for mistakes in the files, before any fit."""

from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.checks.loops import Loops, loops
from twin.diagnosis.checks.suspicions import Suspicion, suspicions
from twin.diagnosis.checks.suspicions.case import beginnings
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.fit_context import Progress, silent
from twin.diagnosis.split import blind, split
from twin.diagnosis.thresholds import FEWEST_TRIALS_FOR_HELD_OUT
from twin.foundation.errors import SolveError
from twin.prediction.motion import motion_as_measured, without_swing
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import simulate, unstable_starts
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class DataPreview:
    """What is known before the first fit.

    The prepared recording with notices of unstable starts, the held-out trials (none with fewer than `FEWEST_TRIALS_FOR_HELD_OUT`
    trials), the prediction (n_k, n_output) of the twin as described, the suspicions, and the loops of pulling and releasing in the
    fitted trials.
    """

    prepared: PreparedRecording
    held_out: tuple[int, ...]
    nominal: tuple[np.ndarray, ...]
    suspicions: tuple[Suspicion, ...]
    loops: Loops


def preview_data(prepared: PreparedRecording, twin: Twin, settings: Settings, progress: Progress = silent) -> DataPreview:
    """Return the preview.

    Raise SolveError, with possible mistakes in the files, where the twin as described has no equilibrium.
    """
    held_out = split(prepared, settings.seed)[1] if len(prepared.inputs) >= FEWEST_TRIALS_FOR_HELD_OUT else []
    progress("nominal prediction")
    try:
        simulate(twin, beginnings(prepared))
        traces = simulate(twin, prepared)
    except SolveError as error:
        found = suspicions(prepared, twin, held_out, None)
        raise SolveError("\n".join([str(error), *(f"Suspicion: {s.words}. Change: {s.change}." for s in found)])) from None
    as_described = [t.outputs(twin, prepared) for t in traces]
    fitted = [k for k in range(len(prepared.inputs)) if k not in held_out]
    prepared, nominal = motion_as_measured(prepared, twin, as_described, fitted, settings.budget is None)
    unstable = tuple(f"{name}: unstable start, its shape is one of several" for name in unstable_starts(prepared, traces))
    progress("possible mistakes in the files")
    found = suspicions(without_swing(prepared), twin, held_out, nominal)
    return DataPreview(
        replace(prepared, notices=(*prepared.notices, *unstable)), tuple(held_out), nominal, found, loops(blind(prepared, held_out))
    )
