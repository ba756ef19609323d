"""What a model would do on each half of the session, had it been fitted to the other: how it predicts farther than one trial."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from twin.diagnosis.calibration.fit import StopRule, fit
from twin.diagnosis.evidence.left_out import LeftOut, left_out
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import FEWEST_TRIALS_TO_HALVE, HALF_SESSION_TOLERANCE, REFIT_SCORE_TOLERANCE
from twin.foundation.errors import SolveError


@dataclass(frozen=True)
class PredictiveErrors:
    """Errors on what a model was not fitted to: on trials left out in turn (`near`), and on halves of the session (`far`)."""

    near: LeftOut
    far: LeftOut

    @property
    def square(self) -> float:
        """Geometric mean of the two mean squares (sigma^2): a law that halves the one may not double the other."""
        return sqrt(self.near.square * self.far.square)

    @property
    def headline(self) -> float:
        return sqrt(self.near.headline * self.far.headline)


def predictive_errors(context: FitContext, weighed: ScoredModel) -> PredictiveErrors:
    """Near and far; of fewer than `FEWEST_TRIALS_TO_HALVE` fitted trials a half is hardly more than a trial, and far is near."""
    near = left_out(context, weighed.fit)
    return PredictiveErrors(near, halves(context, weighed) if len(context.trials) >= FEWEST_TRIALS_TO_HALVE else near)


def halves(context: FitContext, weighed: ScoredModel) -> LeftOut:
    """Each half of the session as a fit to the other leaves it: two fits in truth, for a step to first order reaches one trial, not
    half of them. Infinite where a half has no equilibrium under what the other one says.

    A law that is not the robot's own bends to the poses that were fitted. Neighbours in time mostly share them; halves do not.
    """
    objective, found = context.objective, weighed.fit
    own = [i for i, f in enumerate(found.model.free) if f.effect is None]
    rows = np.cumsum([0, *(r.size for r in found.evaluation.raw)])
    n = len(context.trials)
    parts = (range(n // 2), range(n // 2, n))
    out = np.full(found.z.size, np.inf)
    for fitted, rest in (parts, parts[::-1]):
        J = found.J[rows[fitted[0]] : rows[fitted[-1] + 1], own]
        try:
            stop = StopRule(HALF_SESSION_TOLERANCE, REFIT_SCORE_TOLERANCE)
            half = fit(objective.of(fitted), found.model, near=found.evaluation, J=J, stop=stop)
            predicted = objective.of(rest).evaluate(half.model, half.evaluation.traces)
        except SolveError:
            continue
        out[rows[rest[0]] : rows[rest[-1] + 1]] = predicted.z
    return LeftOut(context, out.reshape(context.evidence.present.shape))
