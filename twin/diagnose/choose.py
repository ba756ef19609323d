"""Stage `choose`: of the sets weighed, the one to go on with, by what it would predict of trials left out in turn."""

from __future__ import annotations

from twin.calibrate import fit
from twin.diagnose.left_out import left_out
from twin.diagnose.null import Thresholds
from twin.diagnose.patterns import dictionary
from twin.diagnose.search import Search, search
from twin.diagnose.study import Study
from twin.diagnose.thresholds import HALF
from twin.diagnose.weigh import Weighed, weigh
from twin.errors import SolveError
from twin.twin import Twin, simulate


def choose(study: Study, found: Search, bars: Thresholds) -> Search:
    """The best set by evidence where it halves the error; else the one that predicts best, and what else there is beside it."""
    best = predicting(study, found, bars.accept)
    if halved(study, found.base, best):
        return Search(found.base, best, found.all)
    core = most_predictive(study, found)
    if core is None:
        return Search(found.base, best, found.all)
    if not study.budget.allows(f"what there is beside {' + '.join(core.effects)}"):
        return Search(found.base, core, found.all)
    return beside(study, core, found, bars)


def predicting(study: Study, found: Search, accept: float) -> Weighed:
    """The best set that every fitted trial can be predicted with."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if solves(study, w.fit.model.twin)), found.base)


def most_predictive(study: Study, found: Search) -> Weighed | None:
    """Of the sets whose every effect halves the squared error on trials left out in turn, the one that errs least there.

    Where laws and robot are far from the data, what no law follows is smooth, and to the evidence a smooth error costs the same
    small or large: its names are worth little. What an effect predicts does not depend on that.
    """
    errors = {w.effects: left_out(study, w.fit).square / HALF ** len(w.effects) for w in (found.base, *found.all)}
    better = [w for w in found.all if errors[w.effects] < errors[found.base.effects]]
    ranked = sorted(better, key=lambda w: errors[w.effects])
    return next((w for w in ranked if halved(study, found.base, w)), None)


def beside(study: Study, core: Weighed, found: Search, bars: Thresholds) -> Search:
    """What else there is, sought as beside any base: converged first, and nothing of it is dropped."""
    converged = fit(study.objective, core.fit.model, near=core.fit.evaluation, refresh=True)
    core = weigh(study, converged)
    around = search(study, core, dictionary(study.objective, converged), bars)
    best = around.best if solves(study, around.best.fit.model.twin) else core
    known = {w.effects: w for w in (*found.all, *around.all)}
    return Search(found.base, best, tuple(sorted(known.values(), key=lambda w: -w.score)))


def halved(study: Study, base: Weighed, best: Weighed) -> bool:
    """Whether effects halve the smooth error; or the squared error on trials left out, of all outputs and of the headline."""
    if best.discrepancy.size <= HALF * base.discrepancy.size:
        return True
    after, before = (left_out(study, w.fit) for w in (best, base))
    return after.square <= HALF * before.square and after.headline <= HALF * before.headline


def solves(study: Study, twin: Twin) -> bool:
    """Whether every fitted trial has an equilibrium that not only its neighbours in the fit lead to."""
    try:
        simulate(twin, study.bench, trials=study.trials)
    except SolveError:
        return False
    return True
