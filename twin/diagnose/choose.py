"""Stage `choose`: of the sets weighed, the one to go on with, by what it would predict of trials that no fit has seen."""

from __future__ import annotations

from itertools import combinations
from math import isfinite

from twin.calibrate import fit
from twin.diagnose.halves import Unseen, unseen
from twin.diagnose.left_out import left_out
from twin.diagnose.null import Thresholds
from twin.diagnose.patterns import dictionary
from twin.diagnose.search import Known, Search, extend
from twin.diagnose.study import Study
from twin.diagnose.thresholds import BESIDE, FAR, HALF
from twin.diagnose.weigh import Laws, Weighed, weigh
from twin.errors import SolveError
from twin.twin import Twin, simulate


def choose(study: Study, found: Search, bars: Thresholds) -> Search:
    """The best set by evidence where it halves the smooth error; else the one that predicts best, and what else there is beside it.

    Where laws and robot are far from the data, what no law follows is smooth, and to the evidence a smooth error costs the same
    small or large: its names are worth little. What an effect predicts does not depend on that.
    """
    best = predicting(study, found, bars.accept)
    if _smaller(study, found.base, best):
        return Search(found.base, best, found.all)
    core = most_predictive(study, found)
    if core is None:
        return Search(found.base, best, found.all)
    core = _converged(study, core)
    alone = len(core.effects) == len(found.base.effects) + 1
    if alone and study.budget.allows(f"what there is beside {' + '.join(core.effects)}"):
        core = beside(study, core, found, bars)
    known = {w.laws: w for w in (*found.all, core)}
    return Search(found.base, core, tuple(sorted(known.values(), key=lambda w: -w.score)), predicted=True)


def predicting(study: Study, found: Search, accept: float) -> Weighed:
    """The best set that every fitted trial can be predicted with."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if solves(study, w.fit.model.twin)), found.base)


def most_predictive(study: Study, found: Search) -> Weighed | None:
    """Of the sets that halve the squared error on what was not fitted, near and far (`unseen`), and whose every effect takes a
    quarter of it, the one that errs least there. Halves of the session are fitted for the few that err least on single trials."""
    base, sets, seen = found.base, {w.laws: w for w in found.all}, dict[Laws, Unseen]()

    def error(laws: Laws) -> Unseen:
        if laws not in seen:
            seen[laws] = unseen(study, sets[laws])
        return seen[laws]

    near = {e: _each(e, left_out(study, w.fit).square) for e, w in sets.items()}
    few = sorted((e for e in sets if near[e] < near[base.laws]), key=lambda e: near[e])[:FAR]
    for laws in sorted(few, key=lambda e: _each(e, error(e).square)):
        fewer = [e for e in combinations(laws, len(laws) - 1) if e in sets]
        if _half(error(laws), error(base.laws)) and all(_quarter(error(laws), error(e)) for e in fewer):
            return sets[laws]
    return None


def _each(laws: Laws, square: float) -> float:
    """A squared error that every effect of a set must pay for."""
    return square / BESIDE ** len(laws)


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
    return _smaller(study, base, best) or _half(unseen(study, best), unseen(study, base))


def _half(after: Unseen, before: Unseen) -> bool:
    return isfinite(after.square) and after.square <= HALF * before.square and after.headline <= HALF * before.headline


def _quarter(after: Unseen, before: Unseen) -> bool:
    return after.square <= BESIDE * before.square


def _smaller(study: Study, base: Weighed, best: Weighed) -> bool:
    return best.discrepancy.beyond(study.accuracy) <= HALF * base.discrepancy.beyond(study.accuracy)


def solves(study: Study, twin: Twin) -> bool:
    """Whether every fitted trial has an equilibrium that not only its neighbours in the fit lead to."""
    try:
        simulate(twin, study.bench, trials=study.trials)
    except SolveError:
        return False
    return True
