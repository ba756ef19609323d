"""The ranking of effects for a refit: the part of the residual that each first-order pattern explains and the model cannot."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import prior_weight
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.evidence.discrepancy import Discrepancy, Evidence
from twin.diagnosis.evidence.first_order import Dictionary
from twin.diagnosis.thresholds import CANDIDATES_REFITTED, STARTS_PER_EFFECT
from twin.effects import FitStart, catalogue


@dataclass(frozen=True)
class Candidate:
    """An effect, its start, and the fall of |z|^2 that its pattern promises less p log n: white, and beside the discrepancy."""

    effect: str
    start: FitStart
    gain_white: float
    gain_beside: float

    @property
    def law(self) -> tuple[str, str]:
        """The effect and its form."""
        return self.effect, catalogue()[self.effect].form(self.start.free)

    @property
    def gain(self) -> float:
        return max(self.gain_white, self.gain_beside)


def rank(
    objective: Objective, evidence: Evidence, fit: Fit, discrepancy: Discrepancy, known: Dictionary, top: int = CANDIDATES_REFITTED
) -> list[Candidate]:
    """Return the `top` candidates by either measure, best first, a few starts of each effect's forms.

    With c the effect's white pattern (per free parameter), J the model's derivatives with their priors P and V the residual's
    covariance (I, or I + Phi D Phi'): A = c' V^-1 c - c' V^-1 J (J' V^-1 J + P)^-1 J' V^-1 c, u = c' V^-1 z less the same
    projection, gain = u' A^-1 u - p log n. One-sided amplitudes that would be negative stay OFF and cost nothing; an effect with no
    amplitude left gains nothing.
    """
    both = np.concatenate([fit.J, known.columns, fit.z[:, None]], axis=1)
    white, beside = (gains(both, X, fit, known, objective) for X in (both, evidence.whiten(discrepancy, both)))
    found = [Candidate(p.effect, p.start, a, b) for p, a, b in zip(known.patterns, white, beside, strict=True)]
    chosen: list[Candidate] = []
    for key in ("gain_white", "gain_beside"):
        taken = 0
        for c in sorted(found, key=lambda c: -getattr(c, key)):
            if taken == top or getattr(c, key) <= 0.0:
                break
            if c in chosen:
                taken += 1
            elif sum(o.law == c.law for o in chosen) < STARTS_PER_EFFECT:
                chosen.append(c)
                taken += 1
    return sorted(chosen, key=lambda c: -c.gain)


def promised_change(objective: Objective, fit: Fit, known: Dictionary, candidate: Candidate) -> np.ndarray:
    """Return the change of z (n * m,) that a candidate's white pattern promises, the model's own parameters fitted along."""
    pattern = next(p for p in known.patterns if p.effect == candidate.effect and p.start == candidate.start)
    C = known.columns[:, list(pattern.where)]
    own, imitation = _imitated(fit.J.T @ np.concatenate([fit.J, C], axis=1), fit)
    left = C - fit.J[:, own] @ imitation[:, fit.J.shape[1] :]
    return left @ _amplitudes(C.T @ left, left.T @ fit.z, pattern.least(objective.prepared.n_tendon))


def projected(X: np.ndarray, VX: np.ndarray, fit: Fit) -> np.ndarray:
    """Return X' V^-1 X less what the model's own parameters, held by their priors, can imitate; X = [J, ...], VX = V^-1 X.

    A parameter at an end of its range imitates nothing.
    """
    S = X.T @ VX
    own, imitation = _imitated(S, fit)
    return S - S[:, own] @ imitation


def _imitated(S: np.ndarray, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return which of the model's own parameters are free, and the changes of these that imitate each column; S = J' V^-1 [J, ...].

    Rows of S after those of J are not looked at.
    """
    own = np.flatnonzero(~fit.at_bound())
    JJ = S[np.ix_(own, own)] + np.diag(prior_weight(fit.model)[own] ** 2) + 1e-9 * np.eye(len(own))
    return own, solve(JJ, S[own, :])


def gains(X: np.ndarray, VX: np.ndarray, fit: Fit, known: Dictionary, objective: Objective) -> list[float]:
    """Return the gain of every pattern; X = [J, columns, z] and VX = V^-1 X."""
    k = fit.J.shape[1]
    left = projected(X, VX, fit)
    raw = np.einsum("ni,ni->i", X, VX)
    out = []
    for pattern in known.patterns:
        index = k + np.array(pattern.where)
        A, u = left[np.ix_(index, index)], left[index, -1]
        keep = np.diag(A) > 1e-6 * np.maximum(raw[index], 1e-12)
        if not keep.any():
            out.append(-np.inf)
            continue
        A, u = A[np.ix_(keep, keep)], u[keep]
        amplitude = _amplitudes(A, u, pattern.least(objective.prepared.n_tendon)[keep])
        used = np.count_nonzero(amplitude)
        fall = float(-2.0 * u @ amplitude - amplitude @ A @ amplitude)
        out.append(fall - used * float(np.log(objective.n)) if used else -np.inf)
    return out


def _amplitudes(A: np.ndarray, u: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Return the amplitudes that reduce |z|^2 most, none below its `least`.

    z falls by column * amplitude, the columns being changes of the residual, so that without bounds the solution is -A^-1 u. Of an
    effect with one amplitude a tendon, some stay at 0 where one tendon has it. Of joints that an equality couples two columns are
    the same, and A has eigenvalues of zero, by rounding below it, which are lifted well above that rounding.
    """
    rounding = max(0.0, -float(np.linalg.eigvalsh(A)[0]))
    held = A + (1e-9 * np.trace(A) + 10.0 * rounding) * np.eye(len(A))
    amplitude = -solve(held, u)
    if np.all(amplitude >= least):
        return amplitude
    L = np.linalg.cholesky(held)
    return lsq_linear(L.T, -np.linalg.solve(L, u), bounds=(least, np.inf), method="bvls").x
