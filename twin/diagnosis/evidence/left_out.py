"""Predictions of each fitted trial by a fit to the others (cross-validation): the basis of every choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit, StopRule, fit
from twin.diagnosis.calibration.model import prior_pull, prior_weight
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import (
    FIRST_ORDER_LIMIT,
    HALF_SESSION_TOLERANCE,
    PARTS_OF_ONE_TRIAL,
    REFIT_SCORE_TOLERANCE,
    WORSE_ERROR_RATIO,
)
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import headline_group


@dataclass(frozen=True)
class LeftOut:
    """White residuals z (n, m) sigmas, each trial's under a fit to the others."""

    context: FitContext
    z: np.ndarray

    @property
    def square(self) -> float:
        """Mean square (sigma^2) over all that was measured."""
        return float((self.z**2).sum()) / self.context.objective.n

    @property
    def headline(self) -> float:
        """Mean square (sigma^2) of the headline outputs."""
        return float((self.z[:, self._own] ** 2).sum() / self.context.evidence.present[:, self._own].sum())

    @property
    def excused(self) -> float:
        """The part of `headline` that errors of the description may explain (sigma^2)."""
        present = self.context.evidence.present[:, self._own]
        return float((present * self.context.accuracy[self._own] ** 2).sum() / present.sum())

    @property
    def _own(self) -> np.ndarray:
        groups = [o.group for o in self.context.prepared.outputs]
        return np.array([g == headline_group(groups) for g in groups])

    @cached_property
    def structure(self) -> float:
        """RMS of the smooth error (sigma) beyond what errors of the description explain."""
        return self.context.evidence.discrepancy(self.z).beyond(self.context.accuracy)

    def worse(self, than: LeftOut) -> bool:
        """Return whether these errors are larger `than` others.

        Compare the sum over all channels, each in its own noise, or the headline alone. The latter must exceed the possible errors
        of the description, which add to the error of one effect and subtract from another's. An effect that shows only in tendon
        displacements leaves the markers' error nearly unchanged.
        """
        return self.square > than.square or self.headline > WORSE_ERROR_RATIO**2 * than.headline + self.excused


def left_out(context: FitContext, fitted: Fit, groups: Sequence[Sequence[int]] | None = None) -> LeftOut:
    """Return the residuals of trials left out in turn, to first order; a single trial is left out by quarters.

    With `groups`, a partition of the trials by position, the trials of a group are left out together.

    With g_k = J_k'z_k and p the priors' gradient, one step from the fit leads the others of trial k to d_k = -(sum_(j != k) J_j'J_j
    + P)^-1 (sum_(j != k) g_j + p), less the step that all together would still take; z_k becomes z_k + J_k d_k and no fit is
    repeated. J'J and g count as far as the fit trusts them. What trial k alone determines stays unchanged, as do parameters at an
    end of their range. Allen (1974), PRESS, by trials.
    """
    moving = np.flatnonzero(~fitted.at_bound())
    J, z = fitted.J[:, moving], fitted.z.ravel()
    prior = np.diag(prior_weight(fitted.model)[moving] ** 2) + 1e-9 * np.eye(len(moving))
    pull = prior_pull(fitted.model)[moving]
    parts = list(pairwise(_ends(context)))
    H = fitted.trust * np.stack([J[a:b].T @ J[a:b] for a, b in parts])
    g = fitted.trust * np.stack([J[a:b].T @ z[a:b] for a, b in parts])
    together = solve(H.sum(axis=0) + prior, g.sum(axis=0) + pull)
    out = z.copy()
    for group in groups or [[k] for k in range(len(parts))]:
        others = np.delete(H, group, axis=0).sum(axis=0) + prior  # summed, not subtracted: a trial may alone determine something
        without = solve(others, np.delete(g, group, axis=0).sum(axis=0) + pull)
        for a, b in (parts[k] for k in group):
            out[a:b] += J[a:b] @ (together - without)
    return LeftOut(context, out.reshape(context.evidence.present.shape))


def proven(context: FitContext, fitted: Fit, known: LeftOut) -> LeftOut:
    """Return `known` with full fits for the trials at which a first-order step is not accurate.

    These are the trials whose square the step makes more than `FIRST_ORDER_LIMIT` times as large; each is predicted by a fit to the
    others, or unchanged where that has no equilibrium. A first-order step fails for what few trials show, in a way nonlinear in a
    parameter, as an obstacle's position.
    """
    objective, out, before = context.objective, known.z.ravel().copy(), fitted.z.ravel()
    own = [i for i, f in enumerate(fitted.model.free) if f.effect is None]
    for k, (a, b) in enumerate(pairwise(_ends(context)) if len(context.trials) > 1 else ()):
        if float(out[a:b] @ out[a:b]) <= FIRST_ORDER_LIMIT * float(before[a:b] @ before[a:b]):
            continue
        context.progress(f"without {context.prepared.inputs[context.trials[k]].name}")
        J = np.delete(fitted.J[:, own], slice(a, b), axis=0)
        try:
            others = [j for j in range(len(context.trials)) if j != k]
            stop = StopRule(HALF_SESSION_TOLERANCE, REFIT_SCORE_TOLERANCE)
            rest = fit(objective.of(others), fitted.model, near=fitted.evaluation, J=J, stop=stop)
            out[a:b] = objective.of([k]).evaluate(rest.model, fitted.evaluation.traces).z
        except SolveError:
            continue
    return LeftOut(context, out.reshape(known.z.shape))


def _ends(context: FitContext) -> np.ndarray:
    """Return where each part begins in the flat residual, and where the last ends."""
    rows = [len(context.prepared.inputs[k].time) for k in context.trials]
    if len(rows) == 1:
        rows = [len(part) for part in np.array_split(np.arange(rows[0]), PARTS_OF_ONE_TRIAL)]
    return np.cumsum([0, *rows]) * len(context.prepared.outputs)
