"""An error that is neither smooth nor noise: the robot rings, or a law is right on average and wrong in every row.

Smooth errors are sought among what moves with the pose, the past and the time; what swings faster leaves them alone. It shows in
how large residuals are at all, where trials repeat: two of them agree to the noise, and the twin is off by more.
"""

import numpy as np

from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.estimate import repeats
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE


def fast_error(context: FitContext, found: ScoredModel) -> float:
    """What is left (sigma, RMS) beside the smooth error, in squares beyond what noise makes and may make: five standard errors of
    the n differences between repeated trials that it was read off,

        q^2 = mean (z - m)^2 - 1 - 5 sqrt(2 / n).

    Zero where no trial repeats another: then white noise may be larger than declared, and who would tell?
    """
    prepared = context.prepared
    pairs = [(a, b) for a, b in repeats(prepared) if {a, b} <= set(context.trials)]
    differences = sum(int(np.isfinite(prepared.measured[a] - prepared.measured[b]).sum()) for a, b in pairs)
    if not differences:
        return 0.0
    present = context.evidence.present
    square = float(np.mean((found.fit.z.reshape(present.shape) - found.discrepancy.mean)[present] ** 2))
    return float(np.sqrt(max(0.0, square - 1.0 - np.sqrt(2.0 * CLEAR_CHI_SQUARE / differences))))


def words(size: float) -> str:
    return (
        f" Beside that {size:.2f} sigma are left that are neither smooth nor noise, since repeated trials agree better: something "
        "rings or chatters, or logs and commands are not of the same moments."
    )
