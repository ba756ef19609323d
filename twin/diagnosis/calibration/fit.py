"""The fit of the robot's own uncertain parameters, and those of effects in force, to the fitted trials.

Minimise sum |W (y - f(x))|^2 + sum ((x_i - prior_i) / std_i)^2 over x, the parameters in units of their `step`, within bounds, by
Gauss-Newton steps on finite-difference derivatives. A difference costs a fraction of a prediction, because a changed twin is solved
from the equilibria and tangents of the unchanged one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import lsq_linear

from twin.body import SOLVE_TOLERANCE, Drive
from twin.diagnosis.calibration.fisher_information import scatter, solve, unidentifiable
from twin.diagnosis.noise.whitening import Whitener
from twin.effects import Effect, effect_class
from twin.effects.base.scaling import scaled_effect, scaled_parameters
from twin.foundation.errors import SolveError
from twin.foundation.parameters import FittedValue, Parameter
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import SolveOptions, Trace, iterate_traces
from twin.prediction.twin import Twin
from twin.robots import Robot

DERIVATIVE_TOLERANCE = 1e-6  # rad, for derivatives: 1e-4 mm against a change of some 1e-2 mm
PARAMETER_DIFFERENCE = 0.02  # of a parameter's step: small against curvature, large against the solver's tolerance
AT_BOUND_SHARE = 1e-3  # of a parameter's range: closer to an end, a parameter is at its bound
# The same of motion. Where a joint comes to rest by friction jumps by hundredths of a sigma with any change of any number; half a
# step moves predictions by about a sigma, and bends little.
MOTION_DIFFERENCE = 0.5
SLOW_FALL_SHARE = 0.5  # of the fall that derivatives predicted: where less came of motion, they are renewed
MOST_MOTION_STEPS = 24  # at most, of a fit of motion
MOST_RENEWALS = 3  # of the derivatives for the robot's own parameters in a fit of motion, where they bend
LARGEST_LAST_FALL = 3.0  # of |z|^2, by which a fit of motion ends: fast logs have so many rows that a share of them is a lot
MOST_FIT_STEPS = 12  # at most, of a fit
TRUSTED_FALL_SHARE = 0.75  # of the fall that derivatives predicted: after as much, steps may be longer (Marquardt, Fletcher)
# Of an effect's amplitude: the difference between two programs of one equation. On 69 sets of
# `tools.benchmarks.diagnosis.attribution` it was 0.5 to 2 %, where noise and disagreement of trials gave errors of 0.2 to 0.7 %.
LAW_ACCURACY = 0.02
UNFIXED_SPREAD_SHARE = 0.9  # a parameter whose standard error stays above this share of its prior's is not fixed by the data

Unsolved = Literal["raise", "zeros"]


@dataclass(frozen=True)
class Free:
    """One free parameter of a fit: of the robot (`effect` None) or of an effect."""

    effect: str | None
    parameter: Parameter

    @property
    def label(self) -> str:
        return self.parameter.name if self.effect is None else f"{self.effect}.{self.parameter.name}"


@dataclass(frozen=True)
class Model:
    """A twin and its free parameters."""

    twin: Twin
    free: tuple[Free, ...]

    @staticmethod
    def base(robot: Robot, twin: Twin | None = None) -> Model:
        """Return the robot as described, with its nuisance parameters and the uncertain ones of its known effects free."""
        twin = twin or Twin.of(robot)
        known = {e.id for e in twin.effects}
        free = (*(Free(None, p) for p in robot.nuisance), *(Free(e, p) for e, p in robot.uncertain if e in known))
        return Model(twin, free)

    def value(self, free: Free) -> float:
        if free.effect is None:
            return float(self.twin.values.get(free.parameter.name, free.parameter.value))
        return next(e for e in self.twin.effects if e.id == free.effect)[free.parameter.name]

    def vector(self) -> np.ndarray:
        """Return the free parameters (n_free,) in units of their steps."""
        return np.array([self.value(f) / f.parameter.step for f in self.free])

    def at(self, x: np.ndarray) -> Model:
        """Return the same model with its free parameters at x (in steps)."""
        values = dict(self.twin.values)
        effects: dict[str, dict[str, float]] = {e.id: dict(e.values) for e in self.twin.effects}
        for f, v in zip(self.free, x, strict=True):
            target = values if f.effect is None else effects[f.effect]
            target[f.parameter.name] = float(np.clip(v * f.parameter.step, f.parameter.low, f.parameter.high))
        built = tuple(type(e)(effects[e.id], e.n_tendon) for e in self.twin.effects)
        return Model(replace(self.twin, values=values, effects=built), self.free)

    def with_effect(self, identifier: str, values: Mapping[str, float], names: Sequence[str], n_tendon: int) -> Model:
        """Return this model with one effect more, its named parameters free."""
        law = effect_class(identifier)
        table = {p.name: p for p in scaled_parameters(law, n_tendon, self.twin.robot.size)}
        effects = (*self.twin.effects, scaled_effect(law, values, n_tendon, self.twin.robot.size))
        return Model(replace(self.twin, effects=effects), (*self.free, *(Free(identifier, table[n]) for n in names)))

    def without_effect(self, identifier: str) -> Model:
        effects = tuple(e for e in self.twin.effects if e.id != identifier)
        return Model(replace(self.twin, effects=effects), tuple(f for f in self.free if f.effect != identifier))


@dataclass(frozen=True)
class Evaluation:
    """A model's prediction of the fitted trials: traces by trial, raw residuals (n_k, n_output) SI, whitened residual flat (n,)."""

    model: Model
    traces: Mapping[int, Trace]
    raw: list[np.ndarray]
    z: np.ndarray


class Objective:
    """The residuals, whitened by `whitener`, and derivatives of models on the listed trials of a prepared recording."""

    def __init__(self, prepared: PreparedRecording, trials: Sequence[int], whitener: Whitener, jobs: int) -> None:
        self.prepared, self.trials, self.whitener, self.jobs = prepared, list(trials), whitener, jobs
        self.n = int(sum(np.isfinite(prepared.measured[k]).sum() for k in trials))

    @property
    def bends(self) -> bool:
        """Whether derivatives for the robot's own parameters change so much with them that fits must renew them: of motion."""
        return Drive.CONTROL in getattr(self.prepared, "drives", ())

    def smallest_fall(self, fall: float) -> float:
        """Return the fall of |z|^2 at which a fit may end, for one that is a share of it."""
        return min(fall, LARGEST_LAST_FALL) if self.bends else fall

    def of(self, which: Sequence[int]) -> Objective:
        """Return the objective of some of its trials, given by their positions."""
        return Objective(self.prepared, [self.trials[k] for k in which], self.whitener.of(which), self.jobs)

    def predict(
        self, twin: Twin, near: Mapping[int, Trace] | None = None, keep: bool = False, once: bool = False
    ) -> tuple[dict[int, Trace], list[np.ndarray]]:
        way = SolveOptions(near or {}, keep, once, SOLVE_TOLERANCE if keep else DERIVATIVE_TOLERANCE)
        traces = dict(iterate_traces(twin, self.prepared, self.trials, way))
        return traces, [traces[k].outputs(twin, self.prepared) for k in self.trials]

    def evaluate(self, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation:
        found = self.within(np.inf, model, near)
        assert found is not None
        return found

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        """Return the evaluation of a model whose |z|^2 is `most` at most, else None.

        The prediction ends with the trial that exceeds `most`.
        """
        at, traces = {k: i for i, k in enumerate(self.trials)}, {}
        raw, z = [np.empty(0)] * len(at), [np.empty(0)] * len(at)
        # A body that creeps has a memory of the trials before.
        n = 1 if model.twin.effect_chain.creep.amplitude else min(self.jobs, len(at))
        shares = [self.trials[i::n] for i in range(n)]
        total = np.zeros(n)

        def solve(share: int) -> None:
            for k, trace in iterate_traces(model.twin, self.prepared, shares[share], SolveOptions(near or {}, keep=True)):
                traces[k] = trace
                if (i := at.get(k)) is not None:
                    raw[i] = self.prepared.measured[k] - trace.outputs(model.twin, self.prepared)
                    z[i] = self.whitener.trial(i, raw[i]).ravel()
                    total[share] += float(z[i] @ z[i])
                    if total.sum() > most:
                        return

        Parallel(n_jobs=n, prefer="threads", require="sharedmem")(delayed(solve)(s) for s in range(n))
        return None if total.sum() > most else Evaluation(model, dict(sorted(traces.items())), raw, np.concatenate(z))

    def cut_off(self, twin: Twin) -> np.ndarray:
        """Return the root of the input noise that effects clip near zero tension, flat (n_row n_tendon,).

        Its square is `Whitener.clipped_input_noise`.
        """
        pulled, cut = self.prepared.driven_by(Drive.TENSION), []
        for i, k in enumerate(self.trials):
            tension = np.where(pulled, twin.effect_chain.command(self.prepared.inputs[k].signals).tension, np.inf)
            cut.append(np.sqrt(self.whitener.clipped_input_noise(i, tension)).ravel())
        return np.concatenate(cut)

    def white(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        return np.concatenate([self.whitener.trial(k, r).ravel() for k, r in enumerate(raw)])

    def columns(
        self, at: Evaluation, models: Sequence[tuple[Model, float]], *, once: bool = False, unsolved: Unsolved = "raise"
    ) -> np.ndarray:
        """Return the whitened change of the residual per unit (n, n_model), for neighbouring models and the difference of each.

        `once` solves to first order in the difference. A model without an equilibrium raises SolveError, or has a column of zeros
        with `unsolved` "zeros".
        """

        def column(model: Model, size: float) -> np.ndarray:
            if _same_simulation(at.model.twin, model.twin):
                predicted = [at.traces[k].outputs(model.twin, self.prepared) for k in self.trials]
            else:
                try:
                    predicted = self.predict(model.twin, at.traces, once=once)[1]
                except SolveError:
                    if unsolved == "raise":
                        raise
                    return np.zeros(at.z.size)
            raw = [self.prepared.measured[k] - y - r for k, y, r in zip(self.trials, predicted, at.raw, strict=True)]
            return self.white(raw) / size

        with Parallel(n_jobs=self.jobs, prefer="threads", require="sharedmem") as parallel:
            done: Any = parallel(delayed(column)(m, s) for m, s in models)
        return np.stack(list(done), axis=1) if models else np.zeros((at.z.size, 0))

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        """Return dz/dx (n, len(which)) for the listed free parameters, x in steps."""
        x, difference = at.model.vector(), MOTION_DIFFERENCE if self.bends else PARAMETER_DIFFERENCE
        neighbours = []
        for i in which:
            p = at.model.free[i].parameter
            size = difference if (x[i] + difference) * p.step <= p.high else -difference
            moved = x.copy()
            moved[i] += size
            neighbours.append((at.model.at(moved), size))
        return self.columns(at, neighbours, once=True)


def _same_simulation(a: Twin, b: Twin) -> bool:
    """Return whether two twins differ only in what sensors report, so that one simulation serves both."""

    def acting(t: Twin) -> list[Effect]:
        return [e for e in t.effects if e.acts_on_robot]

    return a.values == b.values and acting(a) == acting(b)


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    `J` (n, n_free): whitened derivatives at the solution, x in steps. `cost` = |z|^2 + prior terms. `systematic` (n_free,) SI:
    possible errors of the parameters from effects that the model lacks, where estimated.
    """

    evaluation: Evaluation
    J: np.ndarray
    cost: float
    systematic: np.ndarray | None = None

    @property
    def model(self) -> Model:
        return self.evaluation.model

    @property
    def z(self) -> np.ndarray:
        return self.evaluation.z

    def information(self) -> np.ndarray:
        """Return the posterior information (n_free, n_free) in steps: J'J plus that of the priors."""
        return self.J.T @ self.J + np.diag(prior_weight(self.model) ** 2)

    def std(self) -> np.ndarray:
        """Return standard errors (n_free,) in SI: by the noise, or by the disagreement of trials, whichever is larger.

        An equation that is slightly wrong errs alike throughout a trial and differently from trial to trial.
        """
        noise, free = self._by_noise(), ~self.at_bound()
        step = np.array([f.parameter.step for f in self.model.free])
        J, each = self.J[:, free], list(pairwise(np.cumsum([0, *(r.size for r in self.evaluation.raw)])))
        if len(each) > 1 and free.any():
            parts = [(J[a:b].T @ J[a:b], J[a:b].T @ self.z[a:b]) for a, b in each]
            noise[free] = np.maximum(noise[free], np.sqrt(scatter(parts, self.information()[np.ix_(free, free)])) * step[free])
        return noise

    def _by_noise(self) -> np.ndarray:
        """Return standard errors (n_free,) in SI by the noise, enlarged where the residual exceeds that noise."""
        inflation = max(1.0, float(self.z @ self.z) / max(self.z.size - len(self.model.free), 1))
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
        data = self.J.T @ self.J
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
        return np.array([min(x - p.low, p.high - x) < AT_BOUND_SHARE * (p.high - p.low) for x, p in at], bool)

    def unfixed(self) -> list[str]:
        """Return the labels of the parameters that the data do not fix.

        Their standard error stays near their prior's, or nothing determines them, or nothing separates them from each other.
        """
        out = []
        for f, s, b in zip(self.model.free, self._by_noise(), unidentifiable(self.information()), strict=True):
            if b or (f.parameter.std is not None and s > UNFIXED_SPREAD_SHARE * f.parameter.std):
                out.append(f.label)
        return out


def prior_weight(model: Model) -> np.ndarray:
    """Return 1 / std (n_free,) in steps, zero where there is no prior."""
    return np.array([0.0 if f.parameter.std is None else f.parameter.step / f.parameter.std for f in model.free])


def prior_pull(model: Model) -> np.ndarray:
    """Return half the gradient (n_free,) of the prior terms, per step."""
    prior = np.array([f.parameter.value / f.parameter.step for f in model.free])
    return prior_weight(model) ** 2 * (model.vector() - prior)


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

    Derivatives for the robot's own parameters, nearly linear, are computed once, or given as `J`, the whitened columns (n, m) of
    the first m free parameters from a neighbouring fit. Those for effects are computed at every step. `refresh` computes all again
    at the solution, for standard errors and screening. Raise SolveError where the model cannot be solved at its start.
    """
    penalty = _Penalty.of(objective, model)
    at = objective.evaluate(model, near.traces if near else None)
    renewals = MOST_RENEWALS if objective.bends else 0
    fixed = [i for i, f in enumerate(model.free) if f.effect is None and (J is None or i >= J.shape[1])]
    moving = [i for i, f in enumerate(model.free) if f.effect is not None]
    columns = np.zeros((at.z.size, len(model.free)))
    if J is not None:
        columns[:, : J.shape[1]] = J
    columns[:, fixed] = objective.jacobian(at, fixed)
    now, damping, own, moved = penalty.cost(at), 1e-4, [i for i, f in enumerate(model.free) if f.effect is None], J is not None
    for left in range((MOST_MOTION_STEPS if objective.bends else MOST_FIT_STEPS) - 1, -1, -1):
        columns[:, moving] = objective.jacobian(at, moving)
        x = at.model.vector()
        H, g = penalty.normal_equations(x, columns, at.z)
        better, whole, enough = None, damping, max(objective.smallest_fall(stop.tolerance * now), stop.worth)
        while better is None and damping < 1e4:
            d = _bounded_step(H + damping * np.diag(np.diag(H) + 1e-9), g, penalty.low - x, penalty.high - x)
            predicted_fall = -float(2.0 * g @ d + d @ H @ d)
            if damping > whole and predicted_fall < enough:  # a failed step is shortened while it still gains enough
                break
            better = _improved(objective, at, x + d, now - penalty.besides(x + d))
            damping *= 1.0 if better else 10.0
        fall = 0.0 if better is None else now - penalty.cost(better)
        if better is not None:
            at, now, moved = better, penalty.cost(better), True
            if fall > TRUSTED_FALL_SHARE * predicted_fall:
                damping = max(0.1 * damping, 1e-6)
            if now - left * fall > stop.beat:
                break
        slow = objective.bends and fall < SLOW_FALL_SHARE * predicted_fall
        if better is None or fall < enough or slow:
            if not (renewals and moved and left):
                if slow and better is not None and fall >= enough:
                    continue
                break
            columns[:, own], moved, renewals, damping = objective.jacobian(at, own), False, renewals - 1, 1e-4
    if refresh:
        columns = objective.jacobian(at, range(len(model.free)))
    return Fit(at, columns, float(at.z @ at.z) + penalty.believed(at.model.vector()))


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

    def believed(self, x: np.ndarray) -> float:
        return float(self.weight @ (x - self.prior) ** 2)

    def cut_off(self, x: np.ndarray) -> np.ndarray:
        return self.objective.cut_off(self.model.at(x).twin) if self.silencing else np.zeros(0)

    def besides(self, x: np.ndarray) -> float:
        return self.believed(x) + float(np.sum(self.cut_off(x) ** 2))

    def cost(self, e: Evaluation) -> float:
        return float(e.z @ e.z) + self.besides(e.model.vector())

    def normal_equations(self, x: np.ndarray, columns: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return half the Gauss-Newton Hessian (n_free, n_free) of the cost, and half its gradient (n_free,)."""
        cut = self.cut_off(x)
        D = np.zeros((cut.size, x.size))
        for i in self.silencing:
            D[:, i] = (self.cut_off(x + PARAMETER_DIFFERENCE * (np.arange(x.size) == i)) - cut) / PARAMETER_DIFFERENCE
        H = columns.T @ columns + D.T @ D + np.diag(self.weight)
        return H, columns.T @ z + D.T @ cut + self.weight * (x - self.prior)


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
