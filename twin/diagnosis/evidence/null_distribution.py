"""Acceptance limits for the user's own design, from simulated data without any effect.

With the robot's own parameters fitted, data without an effect leave white noise less what the parameters absorb: z = (1 - J (J'J +
P)^-1 J') e, e ~ N(0, 1) where something was measured. Each draw is searched as the data are. An effect must exceed the 99 %
quantile of the largest statistic over all effects, regressors and frequencies (of a Gumbel distribution fitted by its moments, for
which few draws suffice). Fixed lower limits allow for the errors of the model, which no simulation from it shows.

Every diagnosis draws again: the limits depend on the data and the seed only.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import prior_weight
from twin.diagnosis.evidence.discrepancy import Spectrum
from twin.diagnosis.evidence.first_order import Dictionary
from twin.diagnosis.evidence.ranking import projected
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import (
    FAINT_LINE_SHARE,
    GUMBEL_99_QUANTILE,
    LARGE_STRUCTURE_WITHOUT_EFFECT,
    LARGEST_SPECTRAL_LINE,
    LEAST_CONTRIBUTION,
    LEAST_EVIDENCE,
    NO_EFFECT_DRAWS,
    STRUCTURE_AS_BUILT,
)


@dataclass(frozen=True)
class AcceptanceLimits:
    """The limits on this design: evidence of an effect, its contribution (sigma), structure left (sigma), a spectral line (z).

    `accuracy` (sigma) is that of the twin's description. Its errors are functions of the pose: they limit contributions
    (`visible`), but not the part of them that depends on how a pose was reached (`material`).
    """

    accept: float = LEAST_EVIDENCE
    material: float = LEAST_CONTRIBUTION
    accuracy: float = 0.0
    left: float = STRUCTURE_AS_BUILT
    line: float = LARGEST_SPECTRAL_LINE

    @property
    def visible(self) -> float:
        """The least contribution (sigma) worth claiming, of an effect that is a function of the pose."""
        return max(self.material, self.accuracy)

    @property
    def slight(self) -> float:
        """Residual structure (sigma) that the accuracy of the description can explain, with or without effects."""
        return max(self.left, min(LARGE_STRUCTURE_WITHOUT_EFFECT, self.accuracy))

    @property
    def faint(self) -> float:
        """The limit of a line where no effect was found that could leave one."""
        return FAINT_LINE_SHARE * self.line


@dataclass(frozen=True)
class NullDraws:
    """The statistics of each simulated set without an effect, (NO_EFFECT_DRAWS,) each.

    Evidence and contribution (sigma) of the effect that imitates it best, structure (sigma), and its strongest spectral line (z).
    """

    gain: np.ndarray
    moved: np.ndarray
    left: np.ndarray
    line: np.ndarray


def acceptance_limits(context: FitContext, base: Fit, known: Dictionary, seed: int) -> AcceptanceLimits:
    """Return the larger of the fixed limit and the null quantile, for each statistic."""
    d = draws(context, base, known, seed)
    return AcceptanceLimits(
        accept=max(LEAST_EVIDENCE, quantile(d.gain)),
        material=max(LEAST_CONTRIBUTION, quantile(d.moved)),
        left=max(STRUCTURE_AS_BUILT, quantile(d.left)),
        line=max(LARGEST_SPECTRAL_LINE, quantile(d.line)),
    )


def draws(context: FitContext, base: Fit, known: Dictionary, seed: int) -> NullDraws:
    """Draw sets without an effect and return their statistics."""
    objective, evidence = context.objective, context.evidence
    n, k = base.z.size, base.J.shape[1]
    present = evidence.present.ravel()[:, None]
    e = np.random.default_rng(seed).normal(size=(n, NO_EFFECT_DRAWS)) * present
    H = base.J.T @ base.J + np.diag(prior_weight(base.model) ** 2) + 1e-9 * np.eye(k)
    z = (e - base.J @ solve(H, base.J.T @ e)) * present
    X = np.concatenate([base.J, known.columns], axis=1)
    A = projected(X, X, base)[k:, k:]
    u = known.columns.T @ z
    gain, fall = np.full(NO_EFFECT_DRAWS, -np.inf), np.zeros(NO_EFFECT_DRAWS)
    for pattern in known.patterns:
        i = np.array(pattern.where)
        inner = A[np.ix_(i, i)]
        falls = np.einsum("id,id->d", u[i], solve(inner + 1e-9 * max(np.trace(inner), 1e-12) * np.eye(len(i)), u[i]))
        gain = np.maximum(gain, falls - len(i) * np.log(objective.n))
        fall = np.maximum(fall, falls)
    spectrum = Spectrum.of(objective.prepared, objective.trials)

    def left(of: np.ndarray) -> tuple[float, float]:
        smooth = evidence.discrepancy(of)
        return smooth.size, spectrum.peak(of.reshape(smooth.mean.shape) - smooth.mean)[0]

    found: Any = Parallel(n_jobs=objective.jobs, prefer="threads", require="sharedmem")(delayed(left)(column) for column in z.T)
    size, line = np.array(list(found)).T
    return NullDraws(gain, np.sqrt(fall / objective.n), size, line)


def quantile(x: np.ndarray) -> float:
    """Return the 99 % quantile of a Gumbel distribution with the moments of x."""
    return float(np.mean(x) + GUMBEL_99_QUANTILE * np.std(x, ddof=1))
