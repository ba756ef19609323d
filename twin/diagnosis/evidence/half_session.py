"""Predictions of each half of the session by a fit to the other: a longer extrapolation than one left-out trial."""

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
    """Errors on data that a model was not fitted to: left-out trials (`near`), and halves of the session (`far`)."""

    near: LeftOut
    far: LeftOut

    @property
    def square(self) -> float:
        """Geometric mean of the two mean squares (sigma^2).

        An effect that halves the one may not double the other.
        """
        return sqrt(self.near.square * self.far.square)

    @property
    def headline(self) -> float:
        return sqrt(self.near.headline * self.far.headline)


def predictive_errors(context: FitContext, weighed: ScoredModel) -> PredictiveErrors:
    """Return the errors near and far.

    With fewer than `FEWEST_TRIALS_TO_HALVE` fitted trials a half is hardly more than a trial, and far is near.
    """
    near = left_out(context, weighed.fit)
    return PredictiveErrors(near, halves(context, weighed) if len(context.trials) >= FEWEST_TRIALS_TO_HALVE else near)


def halves(context: FitContext, weighed: ScoredModel) -> LeftOut:
    """Return the residuals of each half of the session under a fit to the other half.

    Both fits are made in full, since a first-order step is accurate for one trial and not for half of them. Residuals are infinite
    where a half has no equilibrium under the other's fit. A wrong effect adapts to the poses that were fitted; neighbours in time
    mostly share these, halves do not.
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
