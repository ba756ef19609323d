"""Stage `search`: beam search over sets of effects: rank, refit, weigh by evidence, add while it pays, then drop what does not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.diagnose.null import Thresholds
from twin.diagnose.patterns import Dictionary, dictionary
from twin.diagnose.ranking import rank
from twin.diagnose.stilled import paid
from twin.diagnose.study import Study
from twin.diagnose.thresholds import BEHIND, DEEPER, DEEPEST, FORM, HOPELESS, PROMISE, STALE, WHITER, WIDTH
from twin.diagnose.weigh import Laws, Weighed, better, extended, fuller, refit_without
from twin.effects import Start, catalogue

Known = dict[Laws, Weighed]


@dataclass(frozen=True)
class Search:
    """The base model, the best set found, and every set that was weighed (the best start of its laws), best first; whether the best
    is that for what it predicts, and not by evidence."""

    base: Weighed
    best: Weighed
    all: tuple[Weighed, ...]
    predicted: bool = False


def search(study: Study, base: Weighed, patterns: Dictionary, bars: Thresholds) -> Search:
    """From the calibrated base, whose missing effects have these first-order patterns, to the best set of effects."""
    known: Known = {base.laws: base}
    beam, step = [base], []
    for level in range(1, DEEPEST + 1):
        best_before = max(w.score for w in known.values())
        fresh: Known = {}
        for member in (*beam, *step):
            lacks = patterns.beside(member.effects)
            # Patterns depend little on what is already fitted (gains by some per cent): the leading set's alone are taken anew, of
            # effects that promise something by the base's; the others' are the base's.
            if member is (*beam, *step)[0] and member is not base:
                least = STALE * _asked(study, base, member, bars)
                promise = rank(study.objective, study.evidence, member.fit, member.discrepancy, lacks, top=len(lacks.patterns))
                lacks = dictionary(study.objective, member.fit, {c.effect for c in promise if c.gain >= least})
            study.progress(f"effects, {level} at once")
            before = dict(fresh)
            extend(study, base, member, lacks, bars, fresh)
            if any(member is s for s in step):
                more, half = best_before + bars.accept, WHITER * _leaves(study, base, member)
                fresh = before | {k: w for k, w in fresh.items() if w.score >= more and _leaves(study, base, w) < half}
        leading = max((w.score for w in fresh.values()), default=0.0) - BEHIND
        fresh = {k: fuller(study, w, bars.accept) if w.score > max(best_before, leading) else w for k, w in fresh.items()}
        known |= {k: w for k, w in fresh.items() if k not in known or w.score > known[k].score}
        beam, step = carried(study, base, [*beam, *step], list(fresh.values()), best_before + bars.accept)
        if not (beam or step) or (level > 1 and _leaves(study, base, (*beam, *step)[0]) > DEEPER):
            break
    best = max(known.values(), key=lambda w: w.score - bars.accept * len(w.effects))
    best = exchanged(study, best, known)
    best = _leaner(study, base, best, known, bars.accept)
    return Search(base, best, tuple(sorted(known.values(), key=lambda w: -w.score)))


def carried(
    study: Study, base: Weighed, beam: list[Weighed], fresh: list[Weighed], bar: float
) -> tuple[list[Weighed], list[Weighed]]:
    """The models of the `beam` and one effect to which one more is added next: where evidence passes the `bar` the best by it,
    `WIDTH` of them, none far behind; and, as a step only, the one that leaves least of |z|^2, where that is less than `WHITER` of
    what these leave, or where there are none the beam. What is built on a step counts where it passes the bar and halves the error
    once more: it explains what lay under the smooth one.

    Evidence forgives a smooth error whatever its size: of two effects that bend alike either may leave it as smooth as none, and
    so have no evidence until the other is there.
    """
    best = max((w.score for w in fresh), default=-np.inf)
    ahead = sorted((w for w in fresh if best >= bar and w.score >= best - BEHIND), key=lambda w: -w.score)[:WIDTH]
    least = min(_leaves(study, base, w) for w in ahead or beam)
    whitest = min(fresh, key=lambda w: _leaves(study, base, w), default=base)
    return ahead, [whitest] if _leaves(study, base, whitest) < WHITER * least else []


def extend(study: Study, base: Weighed, member: Weighed, lacks: Dictionary, bars: Thresholds, fresh: Known) -> None:
    """Into `fresh`: `member` with each of the effects whose pattern promises most."""
    for candidate in rank(study.objective, study.evidence, member.fit, member.discrepancy, lacks):
        if candidate.gain < _asked(study, base, member, bars):
            continue
        name = " + ".join((*member.effects, candidate.effect))
        if not study.budget.allows(name):
            continue
        study.progress(name)
        beat = HOPELESS * min((w.fit.cost for w in fresh.values()), default=np.inf)
        found = extended(study, member, candidate.effect, candidate.start, beat)
        if found is not None and (found.laws not in fresh or better(found, fresh[found.laws])):
            fresh[found.laws] = found


def _leaves(study: Study, base: Weighed, member: Weighed) -> float:
    """The share of the base's |z|^2 above the noise that a set leaves."""
    noise = float(study.objective.n)
    return max(float(member.fit.z @ member.fit.z) - noise, 0.0) / max(float(base.fit.z @ base.fit.z) - noise, 1.0)


def _asked(study: Study, base: Weighed, member: Weighed, bars: Thresholds) -> float:
    """The gain an effect's pattern must promise beside `member` to be fitted there."""
    return PROMISE * max(bars.accept, _material(study, base, member, bars.visible))


def _material(study: Study, base: Weighed, member: Weighed, bar: float) -> float:
    """The fall of |z|^2 below which an effect added to `member` would be immaterial: in the group of outputs in which `member`
    explains least, where its laws' faults show least."""
    explained = max(0.0, float(study.fall(base.fit, member.fit).min()))
    return max(bar**2 * study.objective.n, FORM**2 * explained)


def exchanged(study: Study, best: Weighed, known: Known) -> Weighed:
    """The best set, or one with another effect in the place of one of its own, where that has more evidence.

    Tried is what was better than an effect of the set where both were weighed in the same company, and was not seen in the set's:
    what is too small to be sought beside the true effect may be worth more beside a false one, which it helps to imitate it.
    """
    for weaker in list(known.values()):
        company = set(weaker.laws)
        if not company or not company < set(best.laws):
            continue
        for stronger in list(known.values()):
            own, new = company - set(stronger.laws), set(stronger.laws) - company
            if len(own) != 1 or len(new) != 1 or new <= set(best.laws) or stronger.score <= weaker.score:
                continue
            found = _in_company(study, stronger, best, {e for e, _ in set(best.laws) - company}, known)
            if found is not None and found.score > best.score:
                return exchanged(study, found, known)
    return best


def _in_company(study: Study, member: Weighed, best: Weighed, effects: set[str], known: Known) -> Weighed | None:
    """`member` and these effects of the best set beside, as they were fitted there; None where they are not to be had together or
    were weighed already."""
    together = {*member.effects, *effects}
    laws = (*member.laws, *(law for law in best.laws if law[0] in effects))
    if len(together) < len(laws) or tuple(sorted(laws)) in known or any(together & set(catalogue()[e].akin) for e in together):
        return None
    for effect in sorted(effects):
        if not study.budget.allows(f"{effect} beside {' + '.join(member.effects)}"):
            return None
        study.progress(f"{effect} beside {' + '.join(member.effects)}")
        law = next(e for e in best.fit.model.twin.effects if e.id == effect)
        free = tuple(f.parameter.name for f in best.fit.model.free if f.effect == effect)
        found = extended(study, member, effect, Start(law.values, free))
        if found is None:
            return None
        member = found
    known[member.laws] = member
    return member


def _leaner(study: Study, base: Weighed, best: Weighed, known: Known, accept: float) -> Weighed:
    """Drop every effect beside the base's whose removal costs less evidence than `accept`, less what friction pays it (`paid`); the
    last one stays. Of sets that lead the one left by effects more, too, what friction pays them is taken off."""
    while len(added := [e for e in best.effects if e not in base.effects]) > 1:
        reduced = []
        for effect in added:
            rest = best.laws_without(effect)
            if rest not in known:
                known[rest] = refit_without(study, base, best, effect)
            reduced.append((known[rest], paid(study, best, known[rest])))
        lean, due = max(reduced, key=lambda r: r[0].score + r[1])
        if lean.score < best.score - due - accept:
            break
        best = lean
    for laws, more in list(known.items()):
        if more.score > best.score and set(laws) > set(best.laws) and (due := paid(study, more, best)) > 0.0:
            known[laws] = replace(more, score=more.score - due, unheard=more.unheard + due)
    return best
