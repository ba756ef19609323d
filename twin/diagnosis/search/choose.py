"""Stage `choose`: choose among the fitted candidates, by their predictions of left-out trials where evidence does not decide."""

from dataclasses import replace
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
from twin.diagnosis.thresholds import BEAM_WIDTH, LARGEST_SCORE_GAP, LEFT_BY_EACH_EFFECT, LEFT_BY_EFFECTS, SETS_FITTED_TO_HALVES
from twin.foundation.errors import SolveError
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin


def choose(context: FitContext, found: Search, limits: AcceptanceLimits) -> Search:
    """Return the search with its chosen candidate.

    That is the best candidate by evidence if it halves the smooth error; else the one that predicts best, and one effect more if
    the data support it. Where effects and robot are far from the data, much of the error is smooth, and evidence penalises a large
    smooth error no more than a small one, so that it hardly separates the effects. Prediction errors do not have this flaw.
    """
    best = predicting(context, found, limits.accept)
    core = None if _smaller(context, found.base, best) else most_predictive(context, found)
    if core is None:
        if context.objective.bends and best is not found.base:
            return _with_last_steps(context, found, best)
        return Search(found.base, best, _with(found, best))
    core = converged(context, core)
    alone = len(core.effects) == len(found.base.effects) + 1
    if alone and context.budget.allows(f"what there is beside {' + '.join(core.effects)}"):
        core = add_one_effect(context, core, found, limits)
    return Search(found.base, core, _with(found, core), predicted=True)


def _with_last_steps(context: FitContext, found: Search, best: ScoredModel) -> Search:
    """Return the search of a motion with the best candidate, and the nearest with as many others, fitted to their minima.

    Fits of motion end up to tens of |z|^2 above these, each by another amount, so that of two near each other the worse may lead.
    """
    others = [w for w in found.all if len(w.effects) == len(best.effects) and w.effects != best.effects]
    near = [w for w in others if w.score > best.score - LARGEST_SCORE_GAP]
    for rough in (best, *near[: BEAM_WIDTH - 1]):
        name = f"the last steps of {' + '.join(rough.effects)}"
        if not context.budget.allows(name):
            break
        context.progress(name)
        closer = converged(context, rough)
        found = replace(found, all=_with(found, closer))
        if rough is best or (closer.score > best.score and solves(context, closer.fit.model.twin)):
            best = closer
    return Search(found.base, best, _with(found, best))


def _with(found: Search, chosen: ScoredModel) -> tuple[ScoredModel, ...]:
    """Return all candidates with the chosen one as it is, best first."""
    known = {w.forms: w for w in (*found.all, chosen)}
    return tuple(sorted(known.values(), key=lambda w: -w.score))


def predicting(context: FitContext, found: Search, accept: float) -> ScoredModel:
    """Return the best candidate under which every fitted trial has an equilibrium."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if solves(context, w.fit.model.twin)), found.base)


def most_predictive(context: FitContext, found: Search) -> ScoredModel | None:
    """Return the candidate with the least error on left-out data; None if none qualifies.

    A candidate must halve the squared error on left-out trials and halves of the session (`PredictiveErrors`), and each of its
    effects must remove a quarter. Halves are fitted only for the few candidates that are best on single trials.
    """
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
    """Return a squared error with the penalty that every effect of a set must make up for."""
    return square / LEFT_BY_EACH_EFFECT ** len(laws)


def add_one_effect(context: FitContext, core: ScoredModel, found: Search, limits: AcceptanceLimits) -> ScoredModel:
    """Return the candidate with the effect added that has the most evidence, if enough; else the candidate itself.

    The effect must remove a quarter of the squared error on left-out trials. An effect that harms beyond the fitted trials is named
    in the report (`extrapolation`).
    """
    context.progress(f"beside {' + '.join(core.effects)}")
    fresh: Known = {}
    extend(context, found.base, core, dictionary(context.objective, core.fit), limits, fresh)
    limit = LEFT_BY_EACH_EFFECT * left_out(context, core.fit).square
    helpful = [w for w in fresh.values() if left_out(context, w.fit).square <= limit and solves(context, w.fit.model.twin)]
    best = max(helpful, key=lambda w: w.score, default=core)
    return converged(context, best) if best.score >= core.score + limits.accept else core


def converged(context: FitContext, rough: ScoredModel) -> ScoredModel:
    """Return a candidate fitted to its minimum; of motion by derivatives in short steps alone."""
    objective = context.objective.precise() if context.objective.bends else context.objective
    return score_model(context, fit(objective, rough.fit.model, near=rough.fit.evaluation, refresh=True))


def halved(context: FitContext, base: ScoredModel, best: ScoredModel) -> bool:
    """Return whether effects halve the error.

    That is the smooth error, or the squared error on left-out data, of all outputs and of the headline.
    """
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
    """Return whether every fitted trial has an equilibrium when solved from rest, not only from its neighbours in the fit."""
    try:
        simulate(twin, context.prepared, trials=context.trials)
    except SolveError:
        return False
    return True
