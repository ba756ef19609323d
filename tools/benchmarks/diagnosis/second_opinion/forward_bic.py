"""Greedy forward selection by BIC: the textbook answer.

Level by level the effects that promise most to first order are refitted together with everything already in force, and the one
with the lowest BIC = |z|^2 + prior terms + k log n stays (k: free parameters of effects, n: measured values) while that lowers it.
No unnamed discrepancy competes with the effects, none is dropped again and none is too small; at most as many as in the diagnosis.
"""

from __future__ import annotations

import math

from tools.benchmarks.diagnosis.second_opinion.start import Calibrated, Opinion
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.evidence.ranking import Candidate
from twin.diagnosis.thresholds import MOST_EFFECTS
from twin.foundation.errors import SolveError

REFITS = 3  # a level, at most
PROMISING_SHARE = 0.5  # of the largest promise: a candidate that promises less is not refitted


def forward_bic(start: Calibrated) -> Opinion:
    best, own = start.fit, len(start.fit.model.twin.effects)
    for _ in range(MOST_EFFECTS):
        promising = start.screened(best)[:REFITS]
        close = [c for c in promising if c.gain > PROMISING_SHARE * promising[0].gain]
        grown = [g for c in close if (g := _with(start, best, c)) is not None]
        winner = min(grown, key=lambda f: _bic(start, f), default=best)
        if _bic(start, winner) >= _bic(start, best):
            break
        best = winner
    named = tuple(e.id for e in best.model.twin.effects[own:])
    return Opinion(bool(named), named, best.model.twin)


def _with(start: Calibrated, at: Fit, candidate: Candidate) -> Fit | None:
    model = at.model.with_effect(candidate.effect, candidate.start.values, candidate.start.free, start.prepared.n_tendon)
    try:
        return fit(start.objective, model, near=at.evaluation, J=at.J)
    except SolveError:
        return None


def _bic(start: Calibrated, fitted: Fit) -> float:
    k = sum(f.effect is not None for f in fitted.model.free)
    return fitted.cost + k * math.log(start.objective.n)
