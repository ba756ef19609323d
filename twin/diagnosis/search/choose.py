"""Stage `choose`: of the sets weighed, the one to go on with, by what it would predict of trials that no fit has seen."""

from itertools import combinations
from math import isfinite

from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.evidence.first_order import dictionary
from twin.diagnosis.evidence.half_session import PredictiveErrors, predictive_errors
from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import EffectForms, ScoredModel, score_model
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.search import Known, Search, extend
from twin.diagnosis.thresholds import LEFT_BY_EACH_EFFECT, LEFT_BY_EFFECTS, SETS_FITTED_TO_HALVES
from twin.foundation.errors import SolveError
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin


def choose(context: FitContext, found: Search, limits: AcceptanceLimits) -> Search:
    """The best set by evidence where it halves the smooth error; else the one that predicts best, and what else there is beside it.

    Where laws and robot are far from the data, what no law follows is smooth, and to the evidence a smooth error costs the same
    small or large: its names are worth little. What an effect predicts does not depend on that.
    """
    best = predicting(context, found, limits.accept)
    if _smaller(context, found.base, best):
        return Search(found.base, best, found.all)
    core = most_predictive(context, found)
    if core is None:
        return Search(found.base, best, found.all)
    core = _converged(context, core)
    alone = len(core.effects) == len(found.base.effects) + 1
    if alone and context.budget.allows(f"what there is beside {' + '.join(core.effects)}"):
        core = add_one_effect(context, core, found, limits)
    known = {w.forms: w for w in (*found.all, core)}
    return Search(found.base, core, tuple(sorted(known.values(), key=lambda w: -w.score)), predicted=True)


def predicting(context: FitContext, found: Search, accept: float) -> ScoredModel:
    """The best set that every fitted trial can be predicted with."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if solves(context, w.fit.model.twin)), found.base)


def most_predictive(context: FitContext, found: Search) -> ScoredModel | None:
    """Of the sets that halve the squared error on what was not fitted, near and far (`unseen`), and whose every effect takes a
    quarter of it, the one that errs least there. Halves of the session are fitted for the few that err least on single trials."""
    base, sets, seen = found.base, {w.forms: w for w in found.all}, dict[EffectForms, PredictiveErrors]()

    def error(laws: EffectForms) -> PredictiveErrors:
        if laws not in seen:
            seen[laws] = predictive_errors(context, sets[laws])
        return seen[laws]

    near = {e: _each(e, left_out(context, w.fit).square) for e, w in sets.items()}
    few = sorted((e for e in sets if near[e] < near[base.forms]), key=lambda e: near[e])[:SETS_FITTED_TO_HALVES]
    for laws in sorted(few, key=lambda e: _each(e, error(e).square)):
        fewer = [e for e in combinations(laws, len(laws) - 1) if e in sets]
        if _half(error(laws), error(base.forms)) and all(_quarter(error(laws), error(e)) for e in fewer):
            return sets[laws]
    return None


def _each(laws: EffectForms, square: float) -> float:
    """A squared error that every effect of a set must pay for."""
    return square / LEFT_BY_EACH_EFFECT ** len(laws)


def add_one_effect(context: FitContext, core: ScoredModel, found: Search, limits: AcceptanceLimits) -> ScoredModel:
    """The set with one effect more that has the most evidence, if that is enough to be accepted, of those that take a quarter of
    the squared error on trials left out. What harms beyond the trials fitted is named in the report (`beyond`)."""
    context.progress(f"beside {' + '.join(core.effects)}")
    fresh: Known = {}
    extend(context, found.base, core, dictionary(context.objective, core.fit), limits, fresh)
    bar = LEFT_BY_EACH_EFFECT * left_out(context, core.fit).square
    helpful = [w for w in fresh.values() if left_out(context, w.fit).square <= bar and solves(context, w.fit.model.twin)]
    best = max(helpful, key=lambda w: w.score, default=core)
    return _converged(context, best) if best.score >= core.score + limits.accept else core


def _converged(context: FitContext, rough: ScoredModel) -> ScoredModel:
    return score_model(context, fit(context.objective, rough.fit.model, near=rough.fit.evaluation, refresh=True))


def halved(context: FitContext, base: ScoredModel, best: ScoredModel) -> bool:
    """Whether effects halve the smooth error; or the squared error on what was not fitted, of all outputs and of the headline."""
    return _smaller(context, base, best) or _half(predictive_errors(context, best), predictive_errors(context, base))


def _half(after: PredictiveErrors, before: PredictiveErrors) -> bool:
    return (
        isfinite(after.square)
        and after.square <= LEFT_BY_EFFECTS * before.square
        and after.headline <= LEFT_BY_EFFECTS * before.headline
    )


def _quarter(after: PredictiveErrors, before: PredictiveErrors) -> bool:
    return after.square <= LEFT_BY_EACH_EFFECT * before.square


def _smaller(context: FitContext, base: ScoredModel, best: ScoredModel) -> bool:
    return best.discrepancy.beyond(context.accuracy) <= LEFT_BY_EFFECTS * base.discrepancy.beyond(context.accuracy)


def solves(context: FitContext, twin: Twin) -> bool:
    """Whether every fitted trial has an equilibrium that not only its neighbours in the fit lead to."""
    try:
        simulate(twin, context.prepared, trials=context.trials)
    except SolveError:
        return False
    return True
