"""A fit with `mujoco.sysid` and its own rule: a parameter driven to its bound says that the model lacks something.

First the robot's own parameters alone, within bounds. The tool has no priors, but without them pitches and marker offsets, which
data hardly fix, end at a bound on every set; so the fit is regularised, as the tool advises, by the priors the diagnosis has too.
If a parameter ends within 0.1 % of its range of a bound (the rule of the tool's report), an effect is missing; otherwise nothing
is, and the twin is this fit.

To name it, the parameters of all screened effects are freed at once, from OFF, as a user of the tool frees friction, delay, gain
and bias together (what has no meaning at OFF, such as a time constant, stays at the screen's best start). Named are the effects of
which a parameter moved from OFF by more than its confidence interval (the tool's, 95 % over all of them), the one that moved by
most intervals first. The twin is then this second fit.
"""

from __future__ import annotations

import io

import numpy as np
from mujoco import sysid

from tools.benchmarks.diagnosis.second_opinion.start import Calibrated, Opinion, amplitudes
from twin.diagnosis.calibration.fit import Evaluation, Model, prior_weight
from twin.effects import catalogue
from twin.foundation.errors import SolveError

AT_BOUND = 1e-3  # of a parameter's range: at its bound, mujoco.sysid.report.sections.insights
FIT_STEPS = 8  # of Gauss-Newton at most
SMALLEST_STEP = 1e-3  # relative step at which a fit stops


def bound_hit(start: Calibrated) -> Opinion:
    own, _ = _least_squares(start, start.fit.evaluation)
    if not _at_bound(own.model):
        return Opinion(False, (), own.model.twin)
    freed, interval = _least_squares(start, start.objective.evaluate(_freed(start, own.model), own.traces))
    moved: dict[str, float] = {}
    for free, x, width in zip(freed.model.free, freed.model.vector(), interval, strict=True):
        if free.effect is not None:
            by = abs(x - free.parameter.value / free.parameter.step) / width
            moved[free.effect] = max(by, moved.get(free.effect, 0.0))
    named = sorted((e for e, by in moved.items() if by > 1.0), key=lambda e: -moved[e])
    return Opinion(True, tuple(named), freed.model.twin)


def _at_bound(model: Model) -> bool:
    def close(value: float, low: float, high: float) -> bool:
        return min(value - low, high - value) < AT_BOUND * (high - low)

    return any(close(model.value(f), f.parameter.low, f.parameter.high) for f in model.free)


def _freed(start: Calibrated, model: Model) -> Model:
    """The model with all screened effects in force at OFF and their parameters free."""
    for c in start.screened(start.fit):
        shape = {k: v for k, v in c.start.values.items() if k in catalogue()[c.effect].inactive_when_off}
        model = model.with_effect(c.effect, shape, amplitudes(c), start.prepared.n_tendon)
    return model


def _least_squares(start: Calibrated, at: Evaluation) -> tuple[Evaluation, np.ndarray]:
    """The fit of mujoco.sysid from `at`, parameters in steps, and the confidence half-width of each (in steps)."""
    free, weight = at.model.free, np.diag(prior_weight(at.model))
    prior = np.array([f.parameter.value / f.parameter.step for f in free])
    robot = start.fit.J  # nearly constant, so taken once, as in twin.diagnosis.calibration.fit
    parameters = sysid.ParameterDict()
    for f, x in zip(free, at.model.vector(), strict=True):
        p = f.parameter
        parameters.add(sysid.Parameter(f.label, x, p.low / p.step, p.high / p.step))
    seen = {at.model.vector().tobytes(): at}

    def evaluation(x: np.ndarray) -> Evaluation:
        if x.tobytes() not in seen:
            seen[x.tobytes()] = start.objective.evaluate(at.model.at(x.ravel()), at.traces)
        return seen[x.tobytes()]

    def residual(x: np.ndarray, _: sysid.ParameterDict) -> tuple[list[np.ndarray], None, None]:
        try:
            z = evaluation(x).z
        except SolveError:  # no equilibrium there: the optimiser turns back from what is not finite
            z = np.full(at.z.size, np.inf)
        return [np.concatenate([z, weight @ (x.ravel() - prior)])[:, None]], None, None

    def jacobian(x: np.ndarray, _: np.ndarray) -> np.ndarray:
        effects = start.objective.jacobian(evaluation(x), range(robot.shape[1], x.size))
        return np.vstack([np.hstack([robot, effects]), weight])

    parameters, found = sysid.optimize(
        parameters, residual, verbose=False, jacobian=jacobian, max_iters=FIT_STEPS, xtol=SMALLEST_STEP, x_scale="jac",
        output=io.StringIO(),
    )  # fmt: skip
    interval = sysid.calculate_intervals([np.ravel(residual(found.x, parameters)[0])], found.jac, alpha=0.05 / found.x.size)[1]
    return evaluation(found.x), interval
