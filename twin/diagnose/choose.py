"""Stage `choose`: of the sets weighed, the one to go on with, by what it would predict of trials that no fit has seen."""

from __future__ import annotations

from math import isfinite

from twin.calibrate import fit
from twin.diagnose.halves import unseen
from twin.diagnose.left_out import left_out
from twin.diagnose.null import Thresholds
from twin.diagnose.patterns import dictionary
from twin.diagnose.search import Known, Search, extend
from twin.diagnose.study import Study
from twin.diagnose.thresholds import BESIDE, FAR, HALF
from twin.diagnose.weigh import Weighed, weigh
from twin.errors import SolveError
from twin.twin import Twin, simulate


def choose(study: Study, found: Search, bars: Thresholds) -> Search:
    """The best set by evidence where it halves the smooth error; else the one that predicts best, and what else there is beside it.

    Where laws and robot are far from the data, what no law follows is smooth, and to the evidence a smooth error costs the same
    small or large: its names are worth little. What an effect predicts does not depend on that.
    """
    best = predicting(study, found, bars.accept)
    if _smaller(found.base, best):
        return Search(found.base, best, found.all)
    core = most_predictive(study, found)
    if core is None:
        return Search(found.base, best, found.all)
    core = _converged(study, core)
    if study.budget.allows(f"what there is beside {' + '.join(core.effects)}"):
        core = beside(study, core, found, bars)
    known = {w.effects: w for w in (*found.all, core)}
    return Search(found.base, core, tuple(sorted(known.values(), key=lambda w: -w.score)))


def predicting(study: Study, found: Search, accept: float) -> Weighed:
    """The best set that every fitted trial can be predicted with."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if solves(study, w.fit.model.twin)), found.base)


def most_predictive(study: Study, found: Search) -> Weighed | None:
    """Of the sets whose every effect halves the squared error on what was not fitted, near and far (`unseen`), the one that errs
    least there. Halves of the session are fitted for the few that err least on single trials."""
    near = {w.effects: left_out(study, w.fit).square for w in found.all}
    helpful = [w for w in found.all if near[w.effects] < left_out(study, found.base.fit).square]
    few = sorted(helpful, key=lambda w: _each(w, near[w.effects]))[:FAR]
    errors = {w.effects: _each(w, unseen(study, w).square) for w in (found.base, *few)}
    ranked = sorted((w for w in few if errors[w.effects] < errors[found.base.effects]), key=lambda w: errors[w.effects])
    return next((w for w in ranked if halved(study, found.base, w)), None)


def _each(weighed: Weighed, square: float) -> float:
    """A squared error that every effect of the set must pay for by halving it."""
    return square / HALF ** len(weighed.effects)


def beside(study: Study, core: Weighed, found: Search, bars: Thresholds) -> Weighed:
    """The set with one effect more that has the most evidence, if that is enough to be accepted, of those that take a quarter of
    the squared error on trials left out. What harms beyond the trials fitted is named in the report (`beyond`)."""
    study.progress(f"beside {' + '.join(core.effects)}")
    fresh: Known = {}
    extend(study, found.base, core, dictionary(study.objective, core.fit), bars, fresh)
    bar = BESIDE * left_out(study, core.fit).square
    helpful = [w for w in fresh.values() if left_out(study, w.fit).square <= bar and solves(study, w.fit.model.twin)]
    best = max(helpful, key=lambda w: w.score, default=core)
    return _converged(study, best) if best.score >= core.score + bars.accept else core


def _converged(study: Study, rough: Weighed) -> Weighed:
    return weigh(study, fit(study.objective, rough.fit.model, near=rough.fit.evaluation, refresh=True))


def halved(study: Study, base: Weighed, best: Weighed) -> bool:
    """Whether effects halve the smooth error; or the squared error on what was not fitted, of all outputs and of the headline."""
    if _smaller(base, best):
        return True
    after, before = unseen(study, best), unseen(study, base)
    return isfinite(after.square) and after.square <= HALF * before.square and after.headline <= HALF * before.headline


def _smaller(base: Weighed, best: Weighed) -> bool:
    return best.discrepancy.size <= HALF * base.discrepancy.size


def solves(study: Study, twin: Twin) -> bool:
    """Whether every fitted trial has an equilibrium that not only its neighbours in the fit lead to."""
    try:
        simulate(twin, study.bench, trials=study.trials)
    except SolveError:
        return False
    return True
