"""Stage `judge`: noise, explained, partly explained or unexplained; the claims, how sure they are, and what else it could be."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.checks.fit_warnings import strained
from twin.diagnosis.checks.mixed_robots import MixedRobots, mixed_robots
from twin.diagnosis.diagnosis import Claim
from twin.diagnosis.evidence.discrepancy import Spectrum
from twin.diagnosis.evidence.fast_error import fast_error
from twin.diagnosis.evidence.left_out import LeftOut, left_out, proven
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.explain.error_location import misbent_segment
from twin.diagnosis.explain.words import change
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.choose import halved
from twin.diagnosis.search.lag_or_delay import LATE
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import (
    EVEN_CHANCE,
    LARGE_STRUCTURE,
    LARGE_STRUCTURE_WITHOUT_EFFECT,
    LEAST_EVIDENCE,
    LEFTOVER_SHARE,
    RUNNERS_UP_SHOWN,
    SCORE_TEMPERATURE,
)
from twin.diagnosis.verdict.gate import Gated


@dataclass(frozen=True)
class VerdictInputs:
    """What a verdict is read from: the smooth error (sigma) of the calibrated robot and with the effects, and of these on trials
    left out, the last two but for what the description gets wrong of a pose (`Discrepancy.rest`); the strongest line left (z-score,
    Hz); what is left beside it all that is no noise either (`quick`, sigma).

    `halved`: the effects take half of the error. `strange`: what is left sits at one place of the body, the calibrated error began
    at once, as that of no known effect does, or a law is at its limit (`strained`, in words).
    """

    before: float
    after: float
    unseen: float
    line: tuple[float, float]
    quick: float
    halved: bool
    strange: bool
    strained: tuple[str, ...]


@dataclass(frozen=True)
class Judgement:
    """The verdict, the model it leaves in force, claims and runners-up (their errors on sealed trials yet unknown), sets of effects
    that tell the same, two models between which an experiment should decide; and the claims that alone keep the day from being
    explained, being less likely than not."""

    verdict: str
    final: ScoredModel
    claims: tuple[Claim, ...]
    runners_up: tuple[Claim, ...]
    ambiguous: tuple[tuple[str, ...], ...]
    between: tuple[ScoredModel, ScoredModel] | None
    signs: VerdictInputs
    rigs: MixedRobots | None
    doubtful: tuple[str, ...] = ()


def judge(context: FitContext, found: Search, gated: Gated, limits: AcceptanceLimits) -> Judgement:
    """From what passed the gates; a set that predicts trials left out worse than the calibrated robot counts nothing."""
    context.progress("verdict")
    base, best = found.base, gated.best
    beyond = out_of_sample(context, best, limits)
    if best is not base and beyond.worse(left_out(context, base.fit)):
        best, beyond = base, left_out(context, base.fit)
    added = tuple(e for e in best.effects if e not in base.effects)
    signs = verdict_inputs(context, base, best, limits, beyond)
    apart = mixed_robots(context.prepared, context.trials, base.fit)
    # What effects explain needs no second robot, also where data cannot tell which of two it is.
    alike = [w for d in (*gated.settled, *gated.doubts) for w in (d.found, d.other)]
    if apart is not None and apart.fall < base.fit.cost - min(w.fit.cost for w in (best, *alike)):
        apart = None
    said = "unexplained" if apart else verdict(bool(added), signs, limits)
    if said in ("noise", "unexplained") and best is not base:
        signs = replace(
            signs,
            after=base.discrepancy.beyond(context.accuracy),
            unseen=left_out(context, base.fit).structure,
            quick=fast_error(context, base),
            strained=(),
        )
        best, added = base, ()
    claims = _claims(context, found, gated, best, added, signs, limits)
    small = {s.effect for s in gated.small}
    either = {e: probability(found, pair, small) for pair in ((d.effect, d.rival) for d in gated.settled) for e in pair}
    doubtful = unsure(claims, either) if said == "explained" else ()
    said = "partly_explained" if doubtful else said
    runners = _runners_up(found, gated, () if said == "unexplained" else added)
    ambiguous = tuple(dict.fromkeys((*(w.effects for w in alike), *_as_good(found, gated, best))))
    return Judgement(said, best, claims, runners, ambiguous, _rivals(found, gated, best), signs, apart, doubtful)


def verdict_inputs(
    context: FitContext, base: ScoredModel, best: ScoredModel, limits: AcceptanceLimits, beyond: LeftOut
) -> VerdictInputs:
    """The signs of the calibrated `base` and of the `best` set, and what it leaves of trials left out."""
    prepared, trials = context.prepared, context.trials
    after = best.discrepancy.beyond(context.accuracy)
    rest = best.discrepancy.rest(context.accuracy) * context.objective.whitener.noise.sigma  # SI
    predicted = [prepared.measured[k] - r for k, r in zip(trials, best.fit.evaluation.raw, strict=True)]
    bent = after > limits.left and bool(misbent_segment(prepared, trials, rest, predicted))
    at_limit = tuple(strained(best.fit))
    at_once = base.discrepancy.size > limits.left and change(prepared, trials, base.fit.z.reshape(rest.shape)) is not None
    line = Spectrum.of(prepared, trials).peak(best.fit.z.reshape(rest.shape) - best.discrepancy.mean)
    strange, half = bent or at_once or bool(at_limit), halved(context, base, best)
    return VerdictInputs(base.discrepancy.size, after, beyond.structure, line, fast_error(context, best), half, strange, at_limit)


def out_of_sample(context: FitContext, best: ScoredModel, limits: AcceptanceLimits) -> LeftOut:
    """A set on trials left out. Where it leaves no more than noise of those fitted, and much to first order of those left out, the
    latter are fitted to the others in truth."""
    first = left_out(context, best.fit)
    much = max(LARGE_STRUCTURE, limits.left)
    return proven(context, best.fit, first) if best.discrepancy.size <= much < first.structure else first


def verdict(added: bool, signs: VerdictInputs, limits: AcceptanceLimits) -> str:
    """In the words of the report's contract; `added`: effects passed the gates."""
    s = signs
    much = max(s.after, s.unseen, s.quick) > max(LARGE_STRUCTURE, limits.left) or s.line[0] > limits.line
    if not added:
        return (
            "unexplained"
            if much or s.line[0] > limits.faint or s.after > max(LARGE_STRUCTURE_WITHOUT_EFFECT, limits.left)
            else "noise"
        )
    if not much and not (s.after > limits.slight and s.after > LEFTOVER_SHARE * s.before):
        return "partly_explained" if s.strange else "explained"
    return "partly_explained" if s.halved else "unexplained"


def unsure(claims: tuple[Claim, ...], either: Mapping[str, float]) -> tuple[str, ...]:
    """Claims less likely than not: other sets explain the data better, and what they all imitate may be none of them. A lag or a
    delay is one of few laws that `lateness` weighed, and the likeliest; of a claim that `settle` took, and of its rival, one or the
    other must be likely, and that is `either`."""
    return tuple(c.effect for c in claims if max(c.probability, either.get(c.effect, 0.0)) < EVEN_CHANCE and c.effect not in LATE)


def probability(found: Search, effects: Collection[str], small: set[str]) -> float:
    """Share of the tempered weight exp(score / 20) of sets with one of the effects; sets with a `small`, immaterial one do not
    count, unless they were weighed beside such a one only."""
    wanted = set(effects)
    material = [w for w in found.all if not small & set(w.effects)]
    if not any(wanted & set(w.effects) for w in material):
        material = list(found.all)
    top = max(w.score for w in material)
    weights = np.array([np.exp((w.score - top) / SCORE_TEMPERATURE) for w in material])
    inside = np.array([bool(wanted & set(w.effects)) for w in material])
    return float(weights[inside].sum() / weights.sum())


def _claims(
    context: FitContext,
    found: Search,
    gated: Gated,
    best: ScoredModel,
    added: tuple[str, ...],
    signs: VerdictInputs,
    limits: AcceptanceLimits,
) -> tuple[Claim, ...]:
    """The largest first."""
    # What is left over has a cause too, and that cause may be what these effects imitate: by the share of the error they take.
    sure = max(0.0, 1.0 - signs.after / signs.before) if signs.after > limits.slight else 1.0
    sure = min(sure, EVEN_CHANCE) if signs.strained else sure
    small = {s.effect for s in gated.small}
    claims = [
        Claim(e, best.fit.fitted(e), float("nan"), sure * probability(found, (e,), small), gated.contribution(context, e))
        for e in added
    ]
    return tuple(sorted(claims, key=lambda c: -c.contribution))


def _runners_up(found: Search, gated: Gated, claimed: tuple[str, ...]) -> tuple[Claim, ...]:
    """Effects weighed and not claimed, each in its best set, best first."""
    small = {s.effect for s in gated.small}
    out: dict[str, Claim] = {}
    for w in found.all:
        for e in w.effects:
            if e not in claimed and e not in found.base.effects and e not in out and e not in small:
                others = tuple(o for o in w.effects if o != e)
                out[e] = Claim(e, w.fit.fitted(e), float("nan"), probability(found, (e,), small), beside=others)
    return tuple(list(out.values())[:RUNNERS_UP_SHOWN])


def _as_good(found: Search, gated: Gated, final: ScoredModel) -> tuple[tuple[str, ...], ...]:
    """Other sets, not just the claimed one with something added or dropped, whose evidence comes within `LEAST_EVIDENCE` of it, and
    two standard deviations of what only one of them hears. What was too small to claim was dropped from the claimed set, and lends
    no other its evidence.

    In a row whose tendon one law has taut and another slack the one's z is the other's less what the reading's noise adds to it,
    e with E|e|^2 = h: |z|^2 differs by h in the mean, which evidence is corrected for, and by 2 sqrt(h) of chance.
    """
    claimed, small = set(final.effects), {s.effect for s in gated.small}
    others = [
        w for w in found.all if not claimed <= set(w.effects) and not set(w.effects) <= claimed and not small & set(w.effects)
    ]
    chance = [2.0 * float(np.sqrt(abs(w.unheard - final.unheard))) for w in others]
    return tuple(w.effects for w, sd in zip(others, chance, strict=True) if w.score > final.score - LEAST_EVIDENCE - 2.0 * sd)


def _rivals(found: Search, gated: Gated, final: ScoredModel) -> tuple[ScoredModel, ScoredModel] | None:
    """Two models that tell different stories: an effect and what these data cannot tell it from, else the model in force and the
    best set that does not contain it."""
    for doubt in (*gated.settled, *gated.doubts):
        return doubt.found, doubt.other
    for w in found.all:
        if w.effects not in (final.effects, found.base.effects) and not set(final.effects) < set(w.effects):
            return final, w
    return None
