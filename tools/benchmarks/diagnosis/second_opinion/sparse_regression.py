"""Sparse regression of the residual with pysindy: ensemble SINDy (bagged, sequentially thresholded least squares).

The library is the catalogue itself: the first-order patterns of every screened effect at its best start, one term a parameter. So
every term has a name, sensors, hysteresis and creep are in it, and it knows what the diagnosis knows; polynomials of the tensions
would not map to effects. Terms and residual are taken beside what the robot's own parameters can absorb, and terms are scaled to
unit RMS: a coefficient is then the term's contribution in sigmas, and the threshold is the diagnosis's own materiality. An effect
is named if one of its terms is in at least `INCLUDED` of the bootstraps, the one that would be missed most first; the effects
named are then fitted together, as the diagnosis fits.
"""

from __future__ import annotations

import numpy as np
import pysindy

from tools.benchmarks.diagnosis.second_opinion.start import Calibrated, Opinion, amplitudes
from twin.diagnosis.calibration.fit import Model, fit, prior_weight
from twin.diagnosis.evidence.ranking import Candidate
from twin.diagnosis.thresholds import LEAST_CONTRIBUTION
from twin.effects import catalogue
from twin.foundation.errors import SolveError

INCLUDED = 0.8  # of the bootstraps, as usual with E-SINDy
BOOTSTRAPS = 20


def sparse_regression(start: Calibrated) -> Opinion:
    candidates = start.screened(start.fit)
    if not candidates:
        return Opinion(False, (), start.fit.model.twin)
    owner, patterns = _library(start, candidates)
    beside = _beside_robot(start, np.column_stack([patterns, start.fit.z]))
    terms, z = beside[:, :-1], beside[:, -1:]
    size = np.sqrt(np.mean(terms**2, axis=0))
    seen = size > 1e-6 * size.max()  # a tilt about the vertical shows in nothing
    owner, terms = owner[seen], terms[:, seen] / size[seen]
    np.random.seed(0)  # noqa: NPY002  pysindy draws its bootstraps from the global stream
    ensemble = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=LEAST_CONTRIBUTION), bagging=True, n_models=BOOTSTRAPS)
    ensemble.fit(terms, -z)
    included = np.mean([c[0] != 0.0 for c in ensemble.coef_list], axis=0) >= INCLUDED
    used, terms = owner[included], terms[:, included]
    rise = {e: _left(terms[:, used != e], z) - _left(terms, z) for e in set(used)}
    named = sorted((c for c in candidates if c.effect in rise), key=lambda c: -rise[c.effect])
    return Opinion(bool(named), tuple(c.effect for c in named), _fitted(start, named).twin)


def _library(start: Calibrated, candidates: list[Candidate]) -> tuple[np.ndarray, np.ndarray]:
    """The effect of each term (p,), and how the whitened residual moves with it (n, p)."""
    owner, neighbours = [], []
    for c in candidates:
        law = catalogue()[c.effect]
        off = {p.name: p.value for p in law.all_parameters(start.prepared.n_tendon)}
        shape = {k: v for k, v in c.start.values.items() if k in law.inactive_when_off}
        for name in amplitudes(c):
            value = c.start.values[name]
            owner.append(c.effect)
            neighbours.append(
                (start.fit.model.with_effect(c.effect, {**shape, name: value}, (), start.prepared.n_tendon), value - off[name])
            )
    return np.array(owner), start.objective.columns(start.fit.evaluation, neighbours)


def _beside_robot(start: Calibrated, X: np.ndarray) -> np.ndarray:
    """Columns X less what a change of the robot's own parameters, held by their priors, would absorb."""
    J, P = start.fit.J, np.diag(prior_weight(start.fit.model) ** 2 + 1e-9)
    return X - J @ np.linalg.solve(J.T @ J + P, J.T @ X)


def _fitted(start: Calibrated, named: list[Candidate]) -> Model:
    """The robot with all named effects, fitted together; the last ones are left out where that has no equilibrium."""
    model = start.fit.model
    for c in named:
        model = model.with_effect(c.effect, c.start.values, c.start.free, start.prepared.n_tendon)
    try:
        return fit(start.objective, model, J=start.fit.J).model if named else model
    except SolveError:
        return _fitted(start, named[:-1])


def _left(terms: np.ndarray, z: np.ndarray) -> float:
    """|z|^2 that the terms, all fitted, leave."""
    return float(np.sum((z - terms @ np.linalg.lstsq(terms, z, rcond=None)[0]) ** 2))
