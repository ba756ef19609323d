"""The fit of the robot's own uncertain parameters, and those of effects in force, to the fitted trials.

Minimise C(|z|^2) + sum ((x_i - prior_i) / std_i)^2 over x, the parameters in units of their `step`, z = W (y - f(x)), within
bounds, by Gauss-Newton steps on finite-difference derivatives. C is |z|^2 itself; of n readings of motion it is
n (1 + ln |z|^2 / n) above n, as for noise of unknown size: motion that is far from the data, or lacks an effect, is no evidence
against descriptions to within its noise, and its derivatives are known to a tenth at best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import lsq_linear

from twin.diagnosis.calibration.fisher_information import scatter, solve, unidentifiable
from twin.diagnosis.calibration.model import Free, Model, prior_weight
from twin.diagnosis.calibration.objective import PARAMETER_DIFFERENCE, Evaluation, Objective
from twin.foundation.errors import SolveError
from twin.foundation.parameters import FittedValue

FAR_SHARE = 0.05  # of the cost: a fit whose derivatives promise a larger fall is far from its minimum
AT_BOUND_SHARE = 1e-3  # of a parameter's range: closer to an end, and than its step, a parameter is at its bound
SLOW_FALL_SHARE = 0.5  # of the fall that derivatives predicted: where less came, they are renewed
MOST_RENEWALS = 4  # of the derivatives for the robot's own parameters in a fit
MOTION_RENEWALS = 2  # the same of motion, whose derivatives learn from each step
MOST_FIT_STEPS = 24  # at most, of a fit of motion or one that renewed them
MOST_STEPS_WITH_KEPT = 12  # at most, of one that kept them
FIRST_DAMPING = 1e-4  # of the Hessian's diagonal
# The same of motion: of directions that only descriptions hold (a servo's strength against its gain) it is a millionth.
MOTION_DAMPING = 1e-7
LEAST_DAMPING = 1e-2  # of the first
TRUSTED_FALL_SHARE = 0.75  # of the fall that derivatives predicted: after as much, steps may be longer (Marquardt, Fletcher)
# Of an effect's amplitude: the difference between two programs of one equation. On 69 sets (`diagnosis.days.attribution`)
# it was 0.5 to 2 %, where noise and disagreement of trials gave errors of 0.2 to 0.7 %.
LAW_ACCURACY = 0.02
UNFIXED_SPREAD_SHARE = 0.9  # a parameter whose standard error stays above this share of its prior's is not fixed by the data


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    `J` (n, n_free): whitened derivatives at the solution, x in steps. `cost` = |z|^2 + prior terms. `systematic` (n_free,) SI:
    possible errors of the parameters from effects that the model lacks, where estimated. `trust`: dC / d|z|^2 at the solution.
    """

    evaluation: Evaluation
    J: np.ndarray
    cost: float
    systematic: np.ndarray | None = None
    trust: float = 1.0

    @property
    def model(self) -> Model:
        return self.evaluation.model

    @property
    def z(self) -> np.ndarray:
        return self.evaluation.z

    def information(self) -> np.ndarray:
        """Return the posterior information (n_free, n_free) in steps: J'J as far as it is trusted, plus that of the priors."""
        return self.trust * (self.J.T @ self.J) + np.diag(prior_weight(self.model) ** 2)

    def std(self) -> np.ndarray:
        """Return standard errors (n_free,) in SI: by the noise, or by the disagreement of trials, whichever is larger.

        An equation that is slightly wrong errs alike throughout a trial and differently from trial to trial.
        """
        noise, free = self._by_noise(), ~self.at_bound()
        step = np.array([f.parameter.step for f in self.model.free])
        J, each = self.trust * self.J[:, free], list(pairwise(np.cumsum([0, *(r.size for r in self.evaluation.raw)])))
        if len(each) > 1 and free.any():
            parts = [(J[a:b].T @ self.J[a:b, free], J[a:b].T @ self.z[a:b]) for a, b in each]
            noise[free] = np.maximum(noise[free], np.sqrt(scatter(parts, self.information()[np.ix_(free, free)])) * step[free])
        return noise

    def _by_noise(self) -> np.ndarray:
        """Return standard errors (n_free,) in SI by the noise, enlarged where the residual exceeds that noise."""
        inflation = max(1.0, self.trust * float(self.z @ self.z) / max(self.z.size - len(self.model.free), 1))
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(self.information())), 0.0) * inflation)
        return spread * np.array([f.parameter.step for f in self.model.free])

    def correlation(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Return the labels of the free parameters that data or priors determine, and the correlation (p, p) of their errors.

        The correlation is the inverse information, scaled to a unit diagonal.
        """
        covariance, identified = np.linalg.pinv(self.information()), ~unidentifiable(self.information())
        size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        labels = tuple(f.label for f, t in zip(self.model.free, identified, strict=True) if t)
        return labels, (covariance / np.outer(size, size))[np.ix_(identified, identified)]

    def effective_parameters(self) -> float:
        """Return the number of parameters that the data, not the priors, determine: trace of J'J (J'J + P)^-1."""
        data = self.trust * (self.J.T @ self.J)
        return float(np.trace(solve(self.information(), data)))

    def fitted(self, effect: str | None) -> dict[str, FittedValue]:
        """Return the values and standard errors of the free parameters of the robot (None) or of an effect.

        A parameter that nothing determines has no standard error. An amplitude is known no better than its equation,
        `LAW_ACCURACY`, which no data of one robot reveal.
        """
        blind = unidentifiable(self.information())
        spread = self.std() if self.systematic is None else np.hypot(self.std(), self.systematic)
        return {
            f.parameter.name: FittedValue(self.model.value(f), None if b else float(np.hypot(s, self._form(f))), f.parameter.unit)
            for f, s, b in zip(self.model.free, spread, blind, strict=True)
            if f.effect == effect
        }

    def _form(self, free: Free) -> float:
        """Return the error (SI) of an amplitude from the form of its effect's equation; zero for other parameters.

        The amplitude counts from OFF or from zero, whichever is nearer: a limit that is never reached is OFF. Parameters that say
        where and when an effect acts, and the robot's own, have no such error.
        """
        law = next((e for e in self.model.twin.effects if e.id == free.effect), None)
        if law is None or free.parameter.name in law.inactive_when_off:
            return 0.0
        value = self.model.value(free)
        return LAW_ACCURACY * min(abs(value - free.parameter.value), abs(value))

    def at_bound(self) -> np.ndarray:
        """Return which free parameters (n_free,) are at an end of their range."""
        at = [(self.model.value(f), f.parameter) for f in self.model.free]
        return np.array([min(x - p.low, p.high - x) < min(AT_BOUND_SHARE * (p.high - p.low), p.step) for x, p in at], bool)

    def unfixed(self) -> list[str]:
        """Return the labels of the parameters that the data do not fix.

        Their standard error stays near their prior's, or nothing determines them, or nothing separates them from each other.
        """
        out = []
        for f, s, b in zip(self.model.free, self._by_noise(), unidentifiable(self.information()), strict=True):
            if b or (f.parameter.std is not None and s > UNFIXED_SPREAD_SHARE * f.parameter.std):
                out.append(f.label)
        return out


@dataclass(frozen=True)
class StopRule:
    """The rule that ends a fit before its last step.

    A fit ends where a step reduces its cost by less than `tolerance` of it or by less than `worth`, and where it would not `beat` a
    cost even if all further steps gained as much as the last.
    """

    tolerance: float = 1e-5
    worth: float = 0.0
    beat: float = np.inf


USUAL_STOP = StopRule()


def fit(
    objective: Objective, model: Model, *, near: Evaluation | None = None, J: np.ndarray | None = None, refresh: bool = False,
    stop: StopRule = USUAL_STOP,
) -> Fit:  # fmt: skip
    """Fit a model's free parameters by damped Gauss-Newton steps within bounds (each a bounded linear least-squares problem).

    Derivatives for the robot's own parameters, nearly linear where these are known well, are renewed where the cost falls less than
    they say, or where they go on to promise as much; or they are given as `J`, the whitened columns (n, m) of the first m free
    parameters from a neighbouring fit, and kept, but of motion. Those for effects are computed at every step. `refresh` computes
    all again at the solution, for standard errors and screening. Raise SolveError where the model cannot be solved at its start.
    """
    penalty = _Penalty.of(objective, model)
    at = objective.evaluate(model, near.traces if near else None)
    # Derivatives of the same model, of more trials than these, are near enough.
    kept = J is not None and (not objective.bends or (near is not None and near.model is model))
    own = [i for i, f in enumerate(model.free) if f.effect is None]
    renewals = allowed = penalty.most_renewals if own and not (kept or np.isinf(stop.worth)) else 0
    fixed = [i for i in own if J is None or i >= J.shape[1]]
    moving = [i for i, f in enumerate(model.free) if f.effect is not None]
    columns = np.zeros((at.z.size, len(model.free)))
    if J is not None:
        columns[:, : J.shape[1]] = J
    columns[:, fixed] = objective.jacobian(at, fixed)
    now, damping = penalty.cost(at), penalty.first_damping
    beat, before = penalty.scaled(stop.beat), np.inf  # `before`: what derivatives promised a step earlier
    since = np.inf if J is not None else now  # the cost when derivatives for the robot's own parameters were computed
    for left in range(MOST_FIT_STEPS - 1, -1, -1):
        if not objective.bends and renewals == allowed and left < MOST_FIT_STEPS - MOST_STEPS_WITH_KEPT:
            break
        columns[:, moving] = objective.jacobian(at, moving)
        step = _Step.of(penalty, at, columns)
        promised = step.to(penalty.first_damping)[1] if renewals or objective.bends else 0.0
        ahead = promised / penalty.trust(at.z)  # in |z|^2, of which a cost far from the data says the share
        least, near_least = objective.smallest_fall(stop.tolerance, now)
        far = renewals and promised > FAR_SHARE * now
        enough = max(least if far else near_least, stop.tolerance * now if kept else 0.0, stop.worth)
        better, damping, predicted = step.taken(now, damping, enough)
        if better is None and own and moving:  # an effect may have a kink here; the robot need not
            better, damping, predicted = step.holding(moving).taken(now, penalty.first_damping, enough)
        fall = 0.0 if better is None else now - penalty.cost(better)
        if better is not None:
            columns, at, now = step.learned(better), better, penalty.cost(better)
            if fall > TRUSTED_FALL_SHARE * predicted:
                damping = max(0.1 * damping, LEAST_DAMPING * penalty.first_damping)
            if now - left * fall > beat:
                break
        slow = fall < SLOW_FALL_SHARE * promised or ahead > SLOW_FALL_SHARE * before  # one good step leaves little to promise
        before = ahead
        if better is not None and fall >= enough and not slow:
            continue
        worth_it = since > now and since - now >= enough and (objective.bends or now <= beat)
        if renewals and left and worth_it and (objective.bends or (slow and promised >= enough)):
            columns[:, own], renewals, damping = objective.renewed(at, own, columns[:, own]), renewals - 1, penalty.first_damping
            since, before = now, np.inf
        elif fall < enough or now > beat:
            break
    if refresh:
        which = moving if objective.bends and since - now <= objective.smallest_fall(1.0, now)[1] else range(len(model.free))
        columns[:, which] = objective.jacobian(at, which)
    return Fit(at, columns, float(at.z @ at.z) + penalty.believed(at.model.vector()), trust=penalty.trust(at.z))


@dataclass(frozen=True)
class _Step:
    """A step from an evaluated model: derivatives `columns` (n, n_free) of its z, half the cost's Hessian and half its gradient."""

    penalty: _Penalty
    at: Evaluation
    columns: np.ndarray
    x: np.ndarray
    H: np.ndarray
    g: np.ndarray
    held: tuple[int, ...] = ()  # free parameters that do not move

    @staticmethod
    def of(penalty: _Penalty, at: Evaluation, columns: np.ndarray) -> _Step:
        x = at.model.vector()
        return _Step(penalty, at, columns, x, *penalty.normal_equations(x, columns, at.z))

    def holding(self, which: Sequence[int]) -> _Step:
        """Return the step in which these free parameters do not move."""
        return replace(self, held=tuple(which))

    def to(self, damping: float) -> tuple[np.ndarray, float]:
        """Return the step (n_free,) with a damping, within bounds, and the fall of the cost that derivatives predict."""
        low, high = self.penalty.low - self.x, self.penalty.high - self.x
        low[list(self.held)] = high[list(self.held)] = 0.0
        d = _bounded_step(self.H + damping * np.diag(np.diag(self.H) + 1e-9), self.g, low, high)
        return d, -float(2.0 * self.g @ d + d @ self.H @ d)

    def learned(self, better: Evaluation) -> np.ndarray:
        """Return the derivatives (n, n_free), those of motion with the least change that gives the change of z just seen.

        J + (dz - J d) w' / (w'd), w = d / std^2 with std in steps, so that the change is the least in widths of descriptions.

        Source: Broyden (1965), a class of methods for solving nonlinear simultaneous equations.
        """
        d = better.model.vector() - self.x
        weighed = d * self.penalty.weight
        if not (self.penalty.objective.bends and weighed.any()):
            return self.columns
        return self.columns + np.outer(better.z - self.at.z - self.columns @ d, weighed / (weighed @ d))

    def taken(self, now: float, damping: float, enough: float) -> tuple[Evaluation | None, float, float]:
        """Return the evaluation that lowers the cost from `now`, if any, its damping, and the fall that was predicted.

        A failed step is shortened while it still promises `enough`.
        """
        whole, predicted = damping, 0.0
        while damping < 1e4:
            d, predicted = self.to(damping)
            if damping > whole and predicted < enough:
                break
            x = self.penalty.moved(self.x, d)
            better = _improved(self.penalty.objective, self.at, x, self.penalty.square(now - self.penalty.besides(x)))
            if better is not None:
                return better, damping, predicted
            damping *= 10.0
        return None, damping, predicted


@dataclass(frozen=True)
class _Penalty:
    """The terms of the cost besides |z|^2, of free parameters x (n_free,) in steps.

    The prior terms and, for load-cell effects (`silencing`, positions), the input noise that they clip near zero tension. Without
    the latter the fit drifts to values that make resting tendons slack.
    """

    objective: Objective
    model: Model
    low: np.ndarray
    high: np.ndarray
    prior: np.ndarray
    weight: np.ndarray
    silencing: list[int]

    @staticmethod
    def of(objective: Objective, model: Model) -> _Penalty:
        steps = np.array([f.parameter.step for f in model.free])
        low = np.array([f.parameter.low for f in model.free]) / steps
        high = np.array([f.parameter.high for f in model.free]) / steps
        prior = np.array([f.parameter.value for f in model.free]) / steps
        cells = {e.id for e in model.twin.effects if "load cells" in e.needs}
        silencing = [i for i, f in enumerate(model.free) if f.effect in cells]
        return _Penalty(objective, model, low, high, prior, prior_weight(model) ** 2, silencing)

    @property
    def most_renewals(self) -> int:
        """How often derivatives for the robot's own parameters may be renewed."""
        return MOTION_RENEWALS if self.objective.bends else MOST_RENEWALS

    @property
    def first_damping(self) -> float:
        """The damping with which steps begin."""
        return MOTION_DAMPING if self.objective.bends else FIRST_DAMPING

    def moved(self, x: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return where a step d from x leads: numbers of motion that are positive by their range fall by the factor others rise by.

        So products of numbers (a servo's strength and its gain) that the data alone determine keep their value.
        """
        if not self.objective.bends:
            return x + d
        share = np.divide(d, x, out=np.zeros_like(d), where=(self.low > 0.0) & (x + d > self.low))
        return np.where(share < 0.0, np.maximum(x / (1.0 - np.minimum(share, 0.0)), self.low), x + d)

    def believed(self, x: np.ndarray) -> float:
        return float(self.weight @ (x - self.prior) ** 2)

    def cut_off(self, x: np.ndarray) -> np.ndarray:
        return self.objective.cut_off(self.model.at(x).twin) if self.silencing else np.zeros(0)

    def besides(self, x: np.ndarray) -> float:
        return self.believed(x) + float(np.sum(self.cut_off(x) ** 2))

    def cost(self, e: Evaluation) -> float:
        return self.scaled(float(e.z @ e.z)) + self.besides(e.model.vector())

    def scaled(self, square: float) -> float:
        """Return what |z|^2 costs: itself, and of motion above the noise n (1 + ln |z|^2 / n), as for noise of unknown size.

        Where a fit is far from the data, or lacks an effect, it claims no more against the description than its error allows.
        """
        n = float(self.objective.n)
        return square if square <= n or not self.objective.bends else n * (1.0 + float(np.log(square / n)))

    def square(self, scaled: float) -> float:
        """Return the |z|^2 that costs so much."""
        n = float(self.objective.n)
        return scaled if scaled <= n or not self.objective.bends else n * float(np.exp(scaled / n - 1.0))

    def trust(self, z: np.ndarray) -> float:
        """Return the derivative of what |z|^2 costs: n / |z|^2 where it is more than the noise."""
        return min(1.0, float(self.objective.n) / max(float(z @ z), 1.0)) if self.objective.bends else 1.0

    def normal_equations(self, x: np.ndarray, columns: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return half the Gauss-Newton Hessian (n_free, n_free) of the cost, and half its gradient (n_free,)."""
        cut = self.cut_off(x)
        D = np.zeros((cut.size, x.size))
        for i in self.silencing:
            D[:, i] = (self.cut_off(x + PARAMETER_DIFFERENCE * (np.arange(x.size) == i)) - cut) / PARAMETER_DIFFERENCE
        trust = self.trust(z)
        H = trust * (columns.T @ columns) + D.T @ D + np.diag(self.weight)
        return H, trust * (columns.T @ z) + D.T @ cut + self.weight * (x - self.prior)


def _bounded_step(H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return argmin 1/2 d'Hd + g'd within low <= d <= high."""
    L = np.linalg.cholesky(H + 1e-12 * np.trace(H) * np.eye(len(g)))
    d = -solve(H, g)
    if np.all((d >= low) & (d <= high)):
        return d
    room = np.maximum(high - low, 1e-9)
    return lsq_linear(L.T, -np.linalg.solve(L, g), bounds=(low, low + room), method="bvls").x


def _improved(objective: Objective, at: Evaluation, x: np.ndarray, now: float) -> Evaluation | None:
    """Return the evaluation at x if its |z|^2 is below `now`, else None, as for a model without an equilibrium."""
    try:
        moved = objective.within(now, at.model.at(x), at.traces)
    except SolveError:
        return None
    return moved if moved is not None and float(moved.z @ moved.z) < now else None
