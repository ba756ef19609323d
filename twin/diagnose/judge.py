"""Stage `judge`: noise, explained, partly explained or unexplained; the claims, how sure they are, and what else it could be."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnose.choose import halved
from twin.diagnose.diagnosis import Claim
from twin.diagnose.doubts import strained
from twin.diagnose.evidence import Spectrum
from twin.diagnose.gate import Gated
from twin.diagnose.lateness import LATE
from twin.diagnose.left_out import LeftOut, left_out, proven
from twin.diagnose.null import Thresholds
from twin.diagnose.places import misbent
from twin.diagnose.quick import quick
from twin.diagnose.rigs import Rigs, rigs
from twin.diagnose.search import Search
from twin.diagnose.study import Study
from twin.diagnose.thresholds import ACCEPT, ALONE, EVEN, MUCH, RUNNERS, SHARE, TEMPER
from twin.diagnose.weigh import Weighed
from twin.diagnose.words import change


@dataclass(frozen=True)
class Signs:
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
    final: Weighed
    claims: tuple[Claim, ...]
    runners_up: tuple[Claim, ...]
    ambiguous: tuple[tuple[str, ...], ...]
    between: tuple[Weighed, Weighed] | None
    signs: Signs
    rigs: Rigs | None
    doubtful: tuple[str, ...] = ()


def judge(study: Study, found: Search, gated: Gated, bars: Thresholds) -> Judgement:
    """From what passed the gates; a set that predicts trials left out worse than the calibrated robot counts nothing."""
    study.progress("verdict")
    base, best = found.base, gated.best
    beyond = unseen(study, best, bars)
    if best is not base and beyond.worse(left_out(study, base.fit)):
        best, beyond = base, left_out(study, base.fit)
    added = tuple(e for e in best.effects if e not in base.effects)
    signs = look(study, base, best, bars, beyond)
    apart = rigs(study.bench, study.trials, base.fit)
    # What effects explain needs no second robot, also where data cannot tell which of two it is.
    alike = [w for d in (*gated.settled, *gated.doubts) for w in (d.found, d.other)]
    if apart is not None and apart.fall < base.fit.cost - min(w.fit.cost for w in (best, *alike)):
        apart = None
    said = "unexplained" if apart else verdict(bool(added), signs, bars)
    if said in ("noise", "unexplained") and best is not base:
        signs = replace(
            signs,
            after=base.discrepancy.beyond(study.accuracy),
            unseen=left_out(study, base.fit).structure,
            quick=quick(study, base),
            strained=(),
        )
        best, added = base, ()
    claims = _claims(study, found, gated, best, added, signs, bars)
    small = {s.effect for s in gated.small}
    either = {e: probability(found, pair, small) for pair in ((d.effect, d.rival) for d in gated.settled) for e in pair}
    doubtful = unsure(claims, either) if said == "explained" else ()
    said = "partly_explained" if doubtful else said
    runners = _runners_up(found, gated, () if said == "unexplained" else added)
    ambiguous = tuple(dict.fromkeys((*(w.effects for w in alike), *_as_good(found, gated, best))))
    return Judgement(said, best, claims, runners, ambiguous, _rivals(found, gated, best), signs, apart, doubtful)


def look(study: Study, base: Weighed, best: Weighed, bars: Thresholds, beyond: LeftOut) -> Signs:
    """The signs of the calibrated `base` and of the `best` set, and what it leaves of trials left out."""
    bench, trials = study.bench, study.trials
    after = best.discrepancy.beyond(study.accuracy)
    rest = best.discrepancy.rest(study.accuracy) * study.objective.whitener.noise.sigma  # SI
    predicted = [bench.measured[k] - r for k, r in zip(trials, best.fit.evaluation.raw, strict=True)]
    bent = after > bars.left and bool(misbent(bench, trials, rest, predicted))
    limits = tuple(strained(best.fit))
    at_once = base.discrepancy.size > bars.left and change(bench, trials, base.fit.z.reshape(rest.shape)) is not None
    line = Spectrum.of(bench, trials).peak(best.fit.z.reshape(rest.shape) - best.discrepancy.mean)
    strange, half = bent or at_once or bool(limits), halved(study, base, best)
    return Signs(base.discrepancy.size, after, beyond.structure, line, quick(study, best), half, strange, limits)


def unseen(study: Study, best: Weighed, bars: Thresholds) -> LeftOut:
    """A set on trials left out. Where it leaves no more than noise of those fitted, and much to first order of those left out, the
    latter are fitted to the others in truth."""
    first = left_out(study, best.fit)
    much = max(MUCH, bars.left)
    return proven(study, best.fit, first) if best.discrepancy.size <= much < first.structure else first


def verdict(added: bool, signs: Signs, bars: Thresholds) -> str:
    """In the words of the report's contract; `added`: effects passed the gates."""
    s = signs
    much = max(s.after, s.unseen, s.quick) > max(MUCH, bars.left) or s.line[0] > bars.line
    if not added:
        return "unexplained" if much or s.line[0] > bars.faint or s.after > max(ALONE, bars.left) else "noise"
    if not much and not (s.after > bars.slight and s.after > SHARE * s.before):
        return "partly_explained" if s.strange else "explained"
    return "partly_explained" if s.halved else "unexplained"


def unsure(claims: tuple[Claim, ...], either: Mapping[str, float]) -> tuple[str, ...]:
    """Claims less likely than not: other sets explain the data better, and what they all imitate may be none of them. A lag or a
    delay is one of few laws that `lateness` weighed, and the likeliest; of a claim that `settle` took, and of its rival, one or the
    other must be likely, and that is `either`."""
    return tuple(c.effect for c in claims if max(c.probability, either.get(c.effect, 0.0)) < EVEN and c.effect not in LATE)


def probability(found: Search, effects: Collection[str], small: set[str]) -> float:
    """Share of the tempered weight exp(score / 20) of sets with one of the effects; sets with a `small`, immaterial one do not
    count, unless they were weighed beside such a one only."""
    wanted = set(effects)
    material = [w for w in found.all if not small & set(w.effects)]
    if not any(wanted & set(w.effects) for w in material):
        material = list(found.all)
    top = max(w.score for w in material)
    weights = np.array([np.exp((w.score - top) / TEMPER) for w in material])
    inside = np.array([bool(wanted & set(w.effects)) for w in material])
    return float(weights[inside].sum() / weights.sum())


def _claims(
    study: Study, found: Search, gated: Gated, best: Weighed, added: tuple[str, ...], signs: Signs, bars: Thresholds
) -> tuple[Claim, ...]:
    """The largest first."""
    # What is left over has a cause too, and that cause may be what these effects imitate: by the share of the error they take.
    sure = max(0.0, 1.0 - signs.after / signs.before) if signs.after > bars.slight else 1.0
    sure = min(sure, EVEN) if signs.strained else sure
    small = {s.effect for s in gated.small}
    claims = [
        Claim(e, best.fit.fitted(e), float("nan"), sure * probability(found, (e,), small), gated.contribution(study, e))
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
    return tuple(list(out.values())[:RUNNERS])


def _as_good(found: Search, gated: Gated, final: Weighed) -> tuple[tuple[str, ...], ...]:
    """Other sets, not just the claimed one with something added or dropped, whose evidence comes within `ACCEPT` of it, and two
    standard deviations of what only one of them hears. What was too small to claim was dropped from the claimed set, and lends no
    other its evidence.

    In a row whose tendon one law has taut and another slack the one's z is the other's less what the reading's noise adds to it,
    e with E|e|^2 = h: |z|^2 differs by h in the mean, which evidence is corrected for, and by 2 sqrt(h) of chance.
    """
    claimed, small = set(final.effects), {s.effect for s in gated.small}
    others = [
        w for w in found.all if not claimed <= set(w.effects) and not set(w.effects) <= claimed and not small & set(w.effects)
    ]
    chance = [2.0 * float(np.sqrt(abs(w.unheard - final.unheard))) for w in others]
    return tuple(w.effects for w, sd in zip(others, chance, strict=True) if w.score > final.score - ACCEPT - 2.0 * sd)


def _rivals(found: Search, gated: Gated, final: Weighed) -> tuple[Weighed, Weighed] | None:
    """Two models that tell different stories: an effect and what these data cannot tell it from, else the model in force and the
    best set that does not contain it."""
    for doubt in (*gated.settled, *gated.doubts):
        return doubt.found, doubt.other
    for w in found.all:
        if w.effects not in (final.effects, found.base.effects) and not set(final.effects) < set(w.effects):
            return final, w
    return None
