"""How far parameters may be off because of what no claim explains.

A claimed effect's numbers take part of what an effect that was not named does. What is left in smooth errors, s sigmas RMS over n
samples, tells how much of such an effect can be there, not which. With c the white patterns of an effect not claimed (n, k), J the
model's derivatives and H = J'J + P its information, c shows A = c'c - c'J H^-1 J'c and moves parameters by G = H^-1 J'c; if it were
all of what is left, along any of its directions alike,

    v = n s^2 diag(G A^-1 G') / k

and the systematic variance is the mean of v over the effects not claimed, each by the start that moves a parameter most.
"""

from dataclasses import replace

import numpy as np

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.evidence.first_order import Dictionary
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import INVISIBLE_PATTERN_SHARE
from twin.diagnosis.verdict.judge import Judgement


def with_systematic(context: FitContext, judged: Judgement, known: Dictionary) -> Judgement:
    """The judgement, the standard errors of its final twin and its claims with what unclaimed effects may have put in them;
    `known`: first-order patterns of the calibrated robot."""
    final = judged.final
    left = final.discrepancy.size * float(np.sqrt(context.objective.n))
    off = systematic(final.fit, known.beside(final.effects), left)
    fit = replace(final.fit, systematic=off)
    claims = tuple(replace(c, parameters=fit.fitted(c.effect)) for c in judged.claims)
    return replace(judged, final=replace(final, fit=fit), claims=claims)


def systematic(fit: Fit, unclaimed: Dictionary, left: float) -> np.ndarray:
    """(n_free,) SI: standard deviations of the free parameters by effects that are not in the model, where a smooth error of norm
    `left` (sigma) is left; 0 at a bound, and where no pattern shows."""
    free = ~fit.at_bound()
    J, C = fit.J[:, free], unclaimed.columns
    H = fit.information()[np.ix_(free, free)]
    G = solve(H, J.T @ C)
    raw = C.T @ C
    A = raw - (C.T @ J) @ G
    shows = np.diag(A) > INVISIBLE_PATTERN_SHARE * np.diag(raw)
    most: dict[str, np.ndarray] = {}
    for pattern in unclaimed.patterns:
        i = np.array([w for w in pattern.where if shows[w]], int)
        if i.size:
            v = np.einsum("pi,ip->p", G[:, i], solve(A[np.ix_(i, i)], G[:, i].T)) / i.size
            most[pattern.effect] = np.maximum(v, most.get(pattern.effect, 0.0))
    out = np.zeros(len(fit.model.free))
    if most:
        step = np.array([f.parameter.step for f in fit.model.free])
        out[free] = left * np.sqrt(np.mean(list(most.values()), axis=0)) * step[free]
    return out
