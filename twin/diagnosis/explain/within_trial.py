"""Effects within trials: which effect explains what is left there, where the declared noise is that between repeated trials.

Noise that is constant throughout a trial hides nothing that happens within it. In units of the scatter of rows,

    z = C a + J b + what is left,

C an effect's first-order pattern, J the model's derivatives, all less the mean of each trial. The prior of b is its posterior from
the fit to all data.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.evidence.first_order import Dictionary, dictionary
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.diagnosis.thresholds import EVEN_CHANCE, LARGE_STRUCTURE_WITHOUT_EFFECT, RIVAL_SHARE

Share = tuple[str, float]


@dataclass(frozen=True)
class WithinTrial:
    """The error within trials that the robot's own parameters do not explain, and what effects explain of it.

    `size`: RMS in units of the scatter of rows. `shares`: of its square beyond that scatter, by effect, on trials left out in turn;
    the largest first, without those that explain nothing.
    """

    size: float
    shares: tuple[Share, ...]

    def words(self) -> str:
        if self.size < np.hypot(1.0, LARGE_STRUCTURE_WITHOUT_EFFECT):
            return "no more than rows scatter by"
        if not self.shares or self.shares[0][1] < EVEN_CHANCE:
            return "of which no known effect explains half"
        (first, most), *others = self.shares
        rivals = [f"{e.replace('_', ' ')} {100 * s:.0f} %" for e, s in others if s > RIVAL_SHARE * most]
        similar = f"; these data cannot separate it from {', '.join(rivals)}" if rivals else ""
        return f"of whose square {first.replace('_', ' ')} explains {100 * most:.0f} % on left-out trials{similar}"


class Moving(Whitener):
    """A whitener by the noise of a trial's rows, of outputs less their mean over the trial."""

    def trial(self, k: int, r: np.ndarray) -> np.ndarray:
        present = self.present[k]
        mean = np.where(present, r, 0.0).sum(axis=0) / np.maximum(present.sum(axis=0), 1)
        return super().trial(k, r - mean)

    @property
    def free(self) -> float:
        """Degrees of freedom of the scatter: the measured samples less a mean of each output and trial."""
        return float(sum(np.maximum(p.sum(axis=0) - 1, 0).sum() for p in self.present))


def within_trial(context: FitContext, found: Fit, rows: Noise, sensitivity: Sequence[np.ndarray], asked: np.ndarray) -> WithinTrial:
    """Return the error within trials of the model in force.

    `rows`: the noise model of rows. `sensitivity` (n_k, n_output, n_tendon): responses to the drives. `asked` (n_output,): the
    outputs to use.
    """
    prepared, trials = context.prepared, context.trials
    measured = [np.where(asked, prepared.measured[k], np.nan) for k in trials]
    moving = Moving(rows, measured, sensitivity, [prepared.inputs[k].command for k in trials])
    objective = Objective(prepared, trials, moving, context.objective.jobs)
    known, free = dictionary(objective, found), [int(i) for i in np.flatnonzero(~found.at_bound())]
    z = objective.white(found.evaluation.raw)
    white = np.hstack([objective.jacobian(found.evaluation, free), known.columns, z[:, None]])
    S = np.stack([x.T @ x for x in np.split(white, np.cumsum([y.size for y in measured])[:-1])])
    believed = found.information()[np.ix_(free, free)]
    return _judged(S, believed, known, prepared.n_tendon, moving.free)


def _judged(S: np.ndarray, believed: np.ndarray, known: Dictionary, n_tendon: int, count: float) -> WithinTrial:
    """Return the result from each trial's products S (n_trial, p, p) of [J, C, z].

    `believed` (k, k): the information on the model's own parameters.
    """
    own = np.arange(len(believed))
    alone, _ = _unseen(S, own, believed)
    best: dict[str, float] = {}
    for pattern in known.patterns:
        where = len(own) + np.array(pattern.where)
        used = S[:, where, where].sum(axis=0) > 0.0
        least, left = pattern.least(n_tendon), alone
        while used.any():  # without those that would be below their least value
            left, amplitudes = _unseen(S, np.append(own, where[used]), believed)
            low = amplitudes[len(own) :] < least[used]
            if not low.any():
                break
            used[np.flatnonzero(used)[low]] = False
        if used.any() and alone > count:
            best[pattern.effect] = max((alone - left) / (alone - count), best.get(pattern.effect, 0.0))
    shares = sorted(((e, min(s, 1.0)) for e, s in best.items() if s > 0.0), key=lambda x: -x[1])
    return WithinTrial(float(np.sqrt(alone / count)), tuple(shares))


def _unseen(S: np.ndarray, which: np.ndarray, believed: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the squares left on every trial by numbers fitted to the others, and the numbers fitted to all.

    z falls by column * number.
    """
    prior = np.zeros((len(which), len(which)))
    prior[: len(believed), : len(believed)] = believed
    H, g, square = S[:, which[:, None], which], S[:, which, -1], S[:, -1, -1]
    left = 0.0
    for k in range(len(S)):
        others = np.delete(np.arange(len(S)), k)
        d = -solve(H[others].sum(axis=0) + prior, g[others].sum(axis=0))
        left += float(square[k] + 2.0 * g[k] @ d + d @ H[k] @ d)
    return left, -solve(H.sum(axis=0) + prior, g.sum(axis=0))
