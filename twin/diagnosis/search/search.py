"""Stage `search`: beam search over sets of effects.

Rank effects by their first-order patterns, refit the best, score by evidence, add effects while the score rises enough, then drop
those whose removal costs little.
"""

from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.evidence.first_order import Dictionary, dictionary
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.ranking import Candidate, promised_change, rank
from twin.diagnosis.evidence.scored_model import (
    EffectForms,
    ScoredModel,
    better,
    described,
    refit_without,
    with_effect_added,
    with_extended_law,
    without_idle_numbers,
)
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.friction import noise_credit
from twin.diagnosis.thresholds import (
    BEAM_WIDTH,
    CANDIDATES_REFITTED,
    HOPELESS_COST_RATIO,
    LARGEST_SCORE_GAP,
    LAW_FORM_SHARE,
    MOST_EFFECTS,
    PROMISED_SHARE,
    REUSED_PROMISE_SHARE,
    UNEXPLAINED_RATIO,
    WHITER_MODEL_LEAVES,
)
from twin.effects import FitStart, catalogue

Known = dict[EffectForms, ScoredModel]


@dataclass(frozen=True)
class Search:
    """The base model, the best candidate, and every candidate fitted (with the best start of each effect), best first.

    `predicted`: whether the best was chosen for its predictions, and not by evidence.
    """

    base: ScoredModel
    best: ScoredModel
    all: tuple[ScoredModel, ...]
    predicted: bool = False


def search(context: FitContext, base: ScoredModel, patterns: Dictionary, limits: AcceptanceLimits) -> Search:
    """Return the best set of effects, starting from the calibrated base and first-order patterns of its missing effects."""
    known: Known = {base.forms: base}
    beam, step = [base], []
    for level in range(1, MOST_EFFECTS + 1):
        best_before = max(w.score for w in known.values())
        fresh: Known = {}
        for member in (*beam, *step):
            lacks = patterns.beside(member.effects)
            # Patterns depend little on what is already fitted (gains by some per cent). Only the leading set's are computed again,
            # of effects that promise something by the base's patterns; the others use the base's.
            if member is (*beam, *step)[0] and member is not base:
                least = REUSED_PROMISE_SHARE * _asked(context, base, member, limits, limits.material)
                promise = rank(context.objective, context.evidence, member.fit, member.discrepancy, lacks, top=len(lacks.patterns))
                lacks = dictionary(context.objective, member.fit, {c.effect for c in promise if c.gain >= least})
            context.progress(f"effects, {level} at once")
            before = dict(fresh)
            extend(context, base, member, lacks, limits, fresh)
            if any(member is s for s in step):
                more, half = best_before + limits.accept, WHITER_MODEL_LEAVES * _leaves(context, base, member)
                fresh = before | {k: w for k, w in fresh.items() if w.score >= more and _leaves(context, base, w) < half}
        leading = max((w.score for w in fresh.values()), default=0.0) - LARGEST_SCORE_GAP
        fresh = {k: _whole(context, w, limits.accept) if w.score > max(best_before, leading) else w for k, w in fresh.items()}
        known |= {k: w for k, w in fresh.items() if k not in known or w.score > known[k].score}
        beam, step = carried(context, base, [*beam, *step], list(fresh.values()), best_before + limits.accept)
        if not (beam or step):
            break
    if context.objective.bends and min(float(w.fit.z @ w.fit.z) for w in known.values()) > UNEXPLAINED_RATIO * context.objective.n:
        known |= _all_others(context, base, limits, known)
    best = max(known.values(), key=lambda w: w.score - limits.accept * len(w.effects))
    best = exchanged(context, best, known)
    best = _leaner(context, base, best, known, limits.accept)
    return Search(base, best, tuple(sorted(known.values(), key=lambda w: -w.score)))


def _all_others(context: FitContext, base: ScoredModel, limits: AcceptanceLimits, known: Known) -> Known:
    """Return, of a motion that nothing known explains, each effect not yet tried alone that promises anything.

    First-order patterns of a large effect may promise less than those of others. Calibration bends numbers of the robot for want of
    it (a damper for friction); beside these it may promise nothing, so that patterns are those of the robot as described.
    """
    fresh, seen = Known(), described(context, base) or base
    untried = set(catalogue()) - {e for w in known.values() if len(w.effects) == 1 for e in w.effects}
    context.progress("all other effects")
    extend(context, base, base, dictionary(context.objective, seen.fit, untried), limits, fresh, seen)
    return {k: _whole(context, w, limits.accept) for k, w in fresh.items()}


def _whole(context: FitContext, found: ScoredModel, accept: float) -> ScoredModel:
    """Return the model with the extended laws that the data support, and without numbers of its effects that do nothing."""
    return without_idle_numbers(context, with_extended_law(context, without_idle_numbers(context, found), accept))


def carried(
    context: FitContext, base: ScoredModel, beam: list[ScoredModel], fresh: list[ScoredModel], limit: float
) -> tuple[list[ScoredModel], list[ScoredModel]]:
    """Return the models to which one effect more is added next: the best by evidence, and at most one exception.

    Those by evidence are up to `BEAM_WIDTH` models above `limit`, none far behind the best. The exception is the model that leaves
    least of |z|^2, where that is less than `WHITER_MODEL_LEAVES` of what the others leave (of the `beam`'s where there are none).
    Its extensions count only if they pass the limit and halve the error again.

    Evidence does not penalise a smooth error by its size. When two effects bend the robot alike, neither alone may look better, and
    so neither has evidence until the other is added.
    """
    best = max((w.score for w in fresh), default=-np.inf)
    ahead = sorted((w for w in fresh if best >= limit and w.score >= best - LARGEST_SCORE_GAP), key=lambda w: -w.score)[:BEAM_WIDTH]
    least = min(_leaves(context, base, w) for w in ahead or beam)
    whitest = min(fresh, key=lambda w: _leaves(context, base, w), default=base)
    return ahead, [whitest] if _leaves(context, base, whitest) < WHITER_MODEL_LEAVES * least else []


def extend(
    context: FitContext,
    base: ScoredModel,
    member: ScoredModel,
    lacks: Dictionary,
    limits: AcceptanceLimits,
    fresh: Known,
    seen: ScoredModel | None = None,
) -> None:
    """Add to `fresh` `member` with each of the effects whose pattern promises most beside it, or anything beside `seen`.

    Fits start from `member` as `described`, where that is another; its derivatives, of motion dear, serve all of them.
    """
    start: ScoredModel | None = None
    top, seen = CANDIDATES_REFITTED if seen is None else len(lacks.patterns), seen or member
    for candidate in rank(context.objective, context.evidence, seen.fit, seen.discrepancy, lacks, top):
        if not _worth_a_fit(context, base, seen, lacks, limits, candidate):
            continue
        name = " + ".join((*member.effects, candidate.effect))
        if not context.budget.allows(name):
            continue
        context.progress(name)
        beat = HOPELESS_COST_RATIO * min((w.fit.cost for w in fresh.values()), default=np.inf)
        start = start or described(context, member) or member
        found = with_effect_added(context, start, candidate.effect, candidate.start, beat)
        if found is not None and (found.forms not in fresh or better(found, fresh[found.forms])):
            fresh[found.forms] = found


def _leaves(context: FitContext, base: ScoredModel, member: ScoredModel) -> float:
    """Return the share of the base's |z|^2 above the noise that a candidate leaves."""
    noise = float(context.objective.n)
    return max(float(member.fit.z @ member.fit.z) - noise, 0.0) / max(float(base.fit.z @ base.fit.z) - noise, 1.0)


def _worth_a_fit(
    context: FitContext, base: ScoredModel, member: ScoredModel, lacks: Dictionary, limits: AcceptanceLimits, candidate: Candidate
) -> bool:
    """Return whether a candidate's pattern promises enough, as the gate will ask of the fitted effect.

    Less than the description's accuracy is enough where it is no function of the pose, as of a lag or of friction.
    """
    if candidate.gain >= _asked(context, base, member, limits, limits.visible):
        return True
    least = _asked(context, base, member, limits, limits.material)
    if candidate.gain < least:
        return False
    change = promised_change(context.objective, member.fit, lacks, candidate)
    return context.objective.n * context.evidence.beyond_pose(change) ** 2 >= least


def _asked(context: FitContext, base: ScoredModel, member: ScoredModel, limits: AcceptanceLimits, size: float) -> float:
    """Return the gain that a pattern must promise beside `member`, of an effect that must move the outputs by `size` sigmas."""
    return PROMISED_SHARE * max(limits.accept, _material(context, base, member, size))


def _material(context: FitContext, base: ScoredModel, member: ScoredModel, limit: float) -> float:
    """Return the fall of |z|^2 below which an effect added to `member` would be immaterial.

    It counts in the group of outputs that `member` explains least, where errors of its equations show least.
    """
    explained = max(0.0, float(context.fall_by_group(base.fit, member.fit).min()))
    return max(limit**2 * context.objective.n, LAW_FORM_SHARE**2 * explained)


def exchanged(context: FitContext, best: ScoredModel, known: Known) -> ScoredModel:
    """Return the best candidate, or one with an effect exchanged, where that has more evidence.

    Tried are effects that did better than one of the candidate's own in a smaller set, and were not fitted in the full set. An
    effect too small to be sought beside the true one may help a false one to imitate it.
    """
    for weaker in list(known.values()):
        company = set(weaker.forms)
        if not company or not company < set(best.forms):
            continue
        for stronger in list(known.values()):
            own, new = company - set(stronger.forms), set(stronger.forms) - company
            if len(own) != 1 or len(new) != 1 or new <= set(best.forms) or stronger.score <= weaker.score:
                continue
            found = _in_company(context, stronger, best, {e for e, _ in set(best.forms) - company}, known)
            if found is not None and found.score > best.score:
                return exchanged(context, found, known)
    return best


def _in_company(context: FitContext, member: ScoredModel, best: ScoredModel, effects: set[str], known: Known) -> ScoredModel | None:
    """Return `member` with these effects of the best candidate, as they were fitted there.

    None where they exclude each other, or were fitted already.
    """
    together = {*member.effects, *effects}
    laws = (*member.forms, *(law for law in best.forms if law[0] in effects))
    if (
        len(together) < len(laws)
        or tuple(sorted(laws)) in known
        or any(together & set(catalogue()[e].confusable_with) for e in together)
    ):
        return None
    for effect in sorted(effects):
        if not context.budget.allows(f"{effect} beside {' + '.join(member.effects)}"):
            return None
        context.progress(f"{effect} beside {' + '.join(member.effects)}")
        law = next(e for e in best.fit.model.twin.effects if e.id == effect)
        free = tuple(f.parameter.name for f in best.fit.model.free if f.effect == effect)
        beat = HOPELESS_COST_RATIO * best.fit.cost if context.objective.bends else np.inf  # fits of motion are dear
        found = with_effect_added(context, member, effect, FitStart(law.values, free), beat)
        if found is None:
            return None
        member = found
    known[member.forms] = member
    return member


def _leaner(context: FitContext, base: ScoredModel, best: ScoredModel, known: Known, accept: float) -> ScoredModel:
    """Drop every effect, except the last, whose removal costs less evidence than `accept` and its friction credit.

    The credit (`noise_credit`) is also subtracted from larger sets that still lead.
    """
    while len(added := [e for e in best.effects if e not in base.effects]) > 1:
        reduced = []
        for effect in added:
            rest = best.forms_without(effect)
            if rest not in known:
                known[rest] = refit_without(context, base, best, effect)
            reduced.append((known[rest], noise_credit(context, best, known[rest])))
        lean, due = max(reduced, key=lambda r: r[0].score + r[1])
        if lean.score < best.score - due - accept:
            break
        best = lean
    for laws, more in list(known.items()):
        if more.score > best.score and set(laws) > set(best.forms) and (due := noise_credit(context, more, best)) > 0.0:
            known[laws] = replace(more, score=more.score - due, unheard=more.unheard + due)
    return best
