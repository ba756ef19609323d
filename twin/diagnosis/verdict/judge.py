"""Stage `judge`: decide on noise, explained, partly explained or unexplained; the claims, their probability, and alternatives."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.checks.fit_warnings import far_from_description, strained
from twin.diagnosis.checks.loops import loops
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
    LOOP_SIGNIFICANCE,
    RUNNERS_UP_SHOWN,
    SCORE_TEMPERATURE,
)
from twin.diagnosis.verdict.gate import Gated
from twin.prediction.evaluate import OUTPUT_GROUPS


@dataclass(frozen=True)
class VerdictInputs:
    """The inputs of a verdict.

    `before`, `after`, `unseen`: the smooth error (sigma) of the calibrated robot, with the effects, and with these on left-out
    trials; the last two without what errors of the description explain (`Discrepancy.rest`). `line`: the strongest spectral line
    left (z-score, Hz). `quick`: the error (sigma) that is neither smooth nor noise (`fast_error`).

    `halved`: the effects remove half of the error. `strange`: the error is at one place of the body, the calibrated error began in
    one step, as that of no known effect does, or an effect is at a limit (`strained`, in words). `caveats`: what keeps the data
    from being explained although little is left, in words (`find_caveats`).
    """

    before: float
    after: float
    unseen: float
    line: tuple[float, float]
    quick: float
    halved: bool
    strange: bool
    strained: tuple[str, ...]
    caveats: tuple[str, ...] = ()

    def without_effects(self, context: FitContext, base: ScoredModel) -> "VerdictInputs":
        """Return the inputs of a verdict without effects in force."""
        after, unseen = base.discrepancy.beyond(context.accuracy), left_out(context, base.fit).structure
        return replace(
            self, after=after, unseen=unseen, quick=fast_error(context, base), strained=(), caveats=find_caveats(context, base)
        )


@dataclass(frozen=True)
class Judgement:
    """The verdict and its consequences.

    The model in force, claims and runners-up (their errors on held-out trials not yet known), sets of effects that cannot be
    separated, two models between which an experiment should decide; and `doubtful`, claims less likely than not that alone keep the
    data from being explained.
    """

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
    """Return the judgement on the effects that passed the gate.

    A set that predicts left-out trials worse than the calibrated robot is dropped.
    """
    context.progress("verdict")
    base, best = found.base, gated.best
    beyond = out_of_sample(context, best, limits)
    if best is not base and beyond.worse(left_out(context, base.fit)):
        best, beyond = base, left_out(context, base.fit)
    added = tuple(e for e in best.effects if e not in base.effects)
    signs = verdict_inputs(context, base, best, limits, beyond)
    apart = mixed_robots(context.prepared, context.trials, base.fit)
    # What effects explain needs no second robot, also where two effects cannot be separated.
    alike = [w for d in (*gated.settled, *gated.doubts) for w in (d.found, d.other)]
    if apart is not None and apart.fall < base.fit.cost - min(w.fit.cost for w in (best, *alike)):
        apart = None
    decided = "unexplained" if apart else verdict(bool(added), signs, limits)
    if decided in ("noise", "unexplained") and best is not base:
        signs, best, added = signs.without_effects(context, base), base, ()
    claims = _claims(context, found, gated, best, added, signs, limits)
    small = {s.effect for s in gated.small}
    either = {e: probability(found, pair, small) for pair in ((d.effect, d.rival) for d in gated.settled) for e in pair}
    doubtful = unsure(claims, either) if decided == "explained" else ()
    decided = "partly_explained" if doubtful else decided
    runners = _runners_up(found, gated, () if decided == "unexplained" else added)
    ambiguous = tuple(dict.fromkeys((*(w.effects for w in alike), *_as_good(found, gated, best))))
    return Judgement(decided, best, claims, runners, ambiguous, _rivals(found, gated, best), signs, apart, doubtful)


def verdict_inputs(
    context: FitContext, base: ScoredModel, best: ScoredModel, limits: AcceptanceLimits, beyond: LeftOut
) -> VerdictInputs:
    """Return the inputs for the calibrated `base` and the `best` set; `beyond`: its residuals on left-out trials."""
    prepared, trials = context.prepared, context.trials
    after = best.discrepancy.beyond(context.accuracy)
    rest = best.discrepancy.rest(context.accuracy) * context.objective.whitener.noise.sigma  # SI
    predicted = [prepared.measured[k] - r for k, r in zip(trials, best.fit.evaluation.raw, strict=True)]
    bent = after > limits.left and bool(misbent_segment(prepared, trials, rest, predicted))
    at_limit = tuple(strained(best.fit))
    at_once = base.discrepancy.size > limits.left and change(prepared, trials, base.fit.z.reshape(rest.shape)) is not None
    line = Spectrum.of(prepared, trials).peak(best.fit.z.reshape(rest.shape) - best.discrepancy.mean)
    strange, half = bent or at_once or bool(at_limit), halved(context, base, best)
    against = find_caveats(context, best)
    return VerdictInputs(
        base.discrepancy.size, after, beyond.structure, line, fast_error(context, best), half, strange, at_limit, against
    )


def find_caveats(context: FitContext, model: ScoredModel) -> tuple[str, ...]:
    """Return caveats of the fitted trials against a model that leaves little.

    These are numbers of the robot that no built one is likely to have, and a loop of pull and release that the twin does not show.
    """
    prepared, sigma = context.prepared, context.objective.whitener.noise.sigma
    caveats = [words] if (words := far_from_description(model.fit)) else []
    predicted = [np.full_like(y, np.nan) for y in prepared.measured]
    for k, r in zip(context.trials, model.fit.evaluation.raw, strict=True):
        predicted[k] = prepared.measured[k] - r
    measured, own = loops(prepared), loops(prepared, predicted)
    if measured.by_trial and own.by_trial:
        off = abs(measured.lag - own.lag)
        group = OUTPUT_GROUPS[measured.group]
        noise = float(np.median([s for s, o in zip(sigma, prepared.outputs, strict=True) if o.group == measured.group]))
        if off > max(LOOP_SIGNIFICANCE * measured.noise, LEFTOVER_SHARE * abs(measured.lag), noise):
            loop, twins = (f"{round(group.factor * x, 2) + 0.0:.2f} {group.unit}" for x in (measured.lag, own.lag))
            caveats.append(f"pull and release differ by {loop} at {measured.name} as measured and by {twins} in this twin")
    return tuple(caveats)


def out_of_sample(context: FitContext, best: ScoredModel, limits: AcceptanceLimits) -> LeftOut:
    """Return the residuals of a candidate on left-out trials.

    Full fits replace first-order steps where the candidate leaves only noise on fitted trials and much on left-out ones.
    """
    first = left_out(context, best.fit)
    much = max(LARGE_STRUCTURE, limits.left)
    return proven(context, best.fit, first) if best.discrepancy.size <= much < first.structure else first


def withdraw(context: FitContext, found: Search, judged: Judgement) -> Judgement:
    """Turn the claims into runners-up, and leave the calibrated robot in force."""
    signs = judged.signs.without_effects(context, found.base)
    runners = (
        *(replace(c, beside=tuple(o.effect for o in judged.claims if o is not c)) for c in judged.claims),
        *judged.runners_up,
    )
    return replace(judged, verdict="unexplained", final=found.base, claims=(), runners_up=runners, signs=signs, doubtful=())


def verdict(added: bool, signs: VerdictInputs, limits: AcceptanceLimits) -> str:
    """Return the verdict, as in the report's contract; `added`: whether effects passed the gate."""
    s = signs
    much = max(s.after, s.unseen, s.quick) > max(LARGE_STRUCTURE, limits.left) or s.line[0] > limits.line
    if not added:
        return (
            "unexplained"
            if much or s.line[0] > limits.faint or s.after > max(LARGE_STRUCTURE_WITHOUT_EFFECT, limits.left)
            else "noise"
        )
    if not much and not (s.after > limits.slight and s.after > LEFTOVER_SHARE * s.before):
        return "partly_explained" if s.strange or s.caveats else "explained"
    return "partly_explained" if s.halved else "unexplained"


def unsure(claims: tuple[Claim, ...], either: Mapping[str, float]) -> tuple[str, ...]:
    """Return claims less likely than not: other sets explain the data better, and the true cause may be none of them.

    A lag or a delay is exempt, since `lag_or_delay` chose it among few. For a claim from `resolve_ties`, `either` is the
    probability of the claim or its rival, and that must be likely.
    """
    return tuple(c.effect for c in claims if max(c.probability, either.get(c.effect, 0.0)) < EVEN_CHANCE and c.effect not in LATE)


def probability(found: Search, effects: Collection[str], small: set[str]) -> float:
    """Return the share of the tempered weight exp(score / 20) of sets with one of the effects.

    Sets with a `small`, immaterial effect do not count, unless the effects were fitted only beside such a one.
    """
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
    """Return the claims, the largest first."""
    # What is left has a cause too, which these effects may imitate: reduce by the share of the error that they leave.
    sure = max(0.0, 1.0 - signs.after / signs.before) if signs.after > limits.slight else 1.0
    sure = min(sure, EVEN_CHANCE) if signs.strained else sure
    small = {s.effect for s in gated.small}
    claims = [
        Claim(e, best.fit.fitted(e), float("nan"), sure * probability(found, (e,), small), gated.contribution(context, e))
        for e in added
    ]
    return tuple(sorted(claims, key=lambda c: -c.contribution))


def _runners_up(found: Search, gated: Gated, claimed: tuple[str, ...]) -> tuple[Claim, ...]:
    """Return effects fitted and not claimed, each in its best set, best first."""
    small = {s.effect for s in gated.small}
    out: dict[str, Claim] = {}
    for w in found.all:
        for e in w.effects:
            if e not in claimed and e not in found.base.effects and e not in out and e not in small:
                others = tuple(o for o in w.effects if o != e)
                out[e] = Claim(e, w.fit.fitted(e), float("nan"), probability(found, (e,), small), beside=others)
    return tuple(list(out.values())[:RUNNERS_UP_SHOWN])


def _as_good(found: Search, gated: Gated, final: ScoredModel) -> tuple[tuple[str, ...], ...]:
    """Return alternative sets, neither sub- nor supersets of the claimed one, with nearly as much evidence.

    Their score is within `LEAST_EVIDENCE` and two standard deviations of the input-noise term. Sets with an effect already dropped
    as too small are skipped.

    Where one set has a tendon taut and another has it slack, their z differ by what the reading's noise adds, e with E|e|^2 = h.
    |z|^2 then differs by h in the mean, for which evidence is corrected, and by 2 sqrt(h) by chance.
    """
    claimed, small = set(final.effects), {s.effect for s in gated.small}
    others = [
        w for w in found.all if not claimed <= set(w.effects) and not set(w.effects) <= claimed and not small & set(w.effects)
    ]
    chance = [2.0 * float(np.sqrt(abs(w.unheard - final.unheard))) for w in others]
    return tuple(w.effects for w, sd in zip(others, chance, strict=True) if w.score > final.score - LEAST_EVIDENCE - 2.0 * sd)


def _rivals(found: Search, gated: Gated, final: ScoredModel) -> tuple[ScoredModel, ScoredModel] | None:
    """Return two models that explain the data by different effects; None where there are none.

    They are a resolved or open ambiguity, else the model in force and the best set that does not contain it.
    """
    for ambiguity in (*gated.settled, *gated.doubts):
        return ambiguity.found, ambiguity.other
    for w in found.all:
        if w.effects not in (final.effects, found.base.effects) and not set(final.effects) < set(w.effects):
            return final, w
    return None
