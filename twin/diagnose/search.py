"""Beam search over sets of effects: screen, refit, weigh by evidence, add while it pays, then drop what does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from twin.calibrate import Fit, Model, Objective, fit
from twin.diagnose.evidence import Discrepancy, Evidence
from twin.diagnose.null import Thresholds
from twin.diagnose.screen import Dictionary, dictionary, screen
from twin.effects import catalogue
from twin.errors import SolveError

WIDTH = 3  # models carried from level to level
BEHIND = 400.0  # a model this far behind the best is not extended
DEEPEST = 3  # effects at once
FORM = 0.15  # of the largest contribution: a smaller one may be what the large one's law gets wrong, unless it takes most of that
PROMISE = 0.25  # of a material gain: what a first-order pattern must promise to be worth a refit
ROUGHLY = 2e-4  # of the cost: the last step's fall at which a refit is weighed; what is left is second order in it

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Weighed:
    """A fitted model and its evidence: `score` = 2 max log N(z; 0, I + Phi D Phi') - prior terms - k log n, up to a constant."""

    fit: Fit
    score: float
    discrepancy: Discrepancy

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(sorted(e.id for e in self.fit.model.twin.effects))


@dataclass(frozen=True)
class Search:
    """The base model, the best set found, and every set that was weighed (best start each), best first."""

    base: Weighed
    best: Weighed
    all: tuple[Weighed, ...]


def weigh(objective: Objective, evidence: Evidence, fitted: Fit) -> Weighed:
    gain, discrepancy = evidence.log_likelihood_gain(fitted.z)
    prior = fitted.cost - float(fitted.z @ fitted.z)
    return Weighed(fitted, gain - prior - fitted.effective_parameters() * float(np.log(objective.n)), discrepancy)


def search(
    objective: Objective, evidence: Evidence, base: Weighed, patterns: Dictionary, bars: Thresholds, progress: Progress
) -> Search:
    """From the calibrated base, whose missing effects have these first-order patterns, to the best set of effects."""
    known: dict[tuple[str, ...], Weighed] = {base.effects: base}
    beam = [base]
    for level in range(1, DEEPEST + 1):
        best_before = max(w.score for w in known.values())
        fresh: dict[tuple[str, ...], Weighed] = {}
        for member in beam:
            if member.score < best_before - BEHIND:
                continue
            # Patterns depend little on what is already fitted: the leading set's are taken anew, the others' are the base's.
            anew = member is beam[0] and member is not base
            lacks = dictionary(objective, member.fit) if anew else patterns.beside(member.effects)
            for candidate in screen(objective, evidence, member.fit, member.discrepancy, lacks):
                if candidate.gain < max(bars.accept, PROMISE * _material(objective, base, member, bars.material)):
                    continue
                progress(f"level {level}: {' + '.join((*member.effects, candidate.effect))}")
                found = _extended(objective, evidence, member, candidate.effect, dict(candidate.start.values), candidate.start.free)
                if found is not None and (found.effects not in fresh or _better(found, fresh[found.effects])):
                    fresh[found.effects] = found
        leading = max((w.score for w in fresh.values()), default=0.0) - BEHIND
        fresh = {
            k: _fuller(objective, evidence, w, k, bars.accept, progress) if w.score > max(best_before, leading) else w
            for k, w in fresh.items()
        }
        known |= {k: w for k, w in fresh.items() if k not in known or w.score > known[k].score}
        beam = sorted(fresh.values(), key=lambda w: -w.score)[:WIDTH]
        if not beam or beam[0].score < best_before + bars.accept:
            break
    best = max(known.values(), key=lambda w: w.score - bars.accept * len(w.effects))
    best = _leaner(objective, evidence, base, best, known, bars.accept, progress)
    return Search(base, best, tuple(sorted(known.values(), key=lambda w: -w.score)))


def _material(objective: Objective, base: Weighed, member: Weighed, bar: float) -> float:
    """The fall of |z|^2 below which an effect added to `member` would be immaterial."""
    explained = max(0.0, float(base.fit.z @ base.fit.z - member.fit.z @ member.fit.z))
    return max(bar**2 * objective.n, FORM**2 * explained)


def _extended(
    objective: Objective, evidence: Evidence, member: Weighed, effect: str, values: dict[str, float], free: tuple[str, ...]
) -> Weighed | None:
    model = member.fit.model.with_effect(effect, values, free, objective.bench.n_tendon)
    try:
        found = fit(objective, model, near=member.fit.evaluation, J=member.fit.J, tolerance=ROUGHLY)
        return weigh(objective, evidence, found)
    except SolveError:
        return None


def _fuller(
    objective: Objective, evidence: Evidence, found: Weighed, effects: tuple[str, ...], accept: float, progress: Progress
) -> Weighed:
    """The fuller law of an effect (a second creep time), where it is not in force yet and the data ask for it.

    Before other effects are added: what the plain law leaves would be taken for them.
    """
    n_tendon, parts = objective.bench.n_tendon, objective.bench.robot.build().parts
    for effect in effects:
        richer = catalogue()[effect].richer
        free = tuple(f.parameter.name for f in found.fit.model.free if f.effect == effect)
        if not richer or set(richer) <= set(free) or not catalogue()[effect].richer_needs <= parts:
            continue
        progress(f"fuller law of {effect}")
        table = {p.name: p for p in catalogue()[effect].declared(n_tendon)}
        law = next(e for e in found.fit.model.twin.effects if e.id == effect)
        values = {**law.values, **{n: table[n].value + (0.0 if n in law.shape else table[n].step) for n in richer}}
        model = found.fit.model.without_effect(effect).with_effect(effect, values, (*free, *richer), n_tendon)
        try:
            fuller = weigh(objective, evidence, fit(objective, model, J=_own(found.fit)))
        except SolveError:
            continue
        if fuller.score > found.score + accept:
            found = fuller
    return found


def _better(found: Weighed, than: Weighed) -> bool:
    """Of two fits of the same effects. With the same parameters free they are minima of one cost, and the lower one is the fit."""
    if set(found.fit.model.free) == set(than.fit.model.free):
        return found.fit.cost < than.fit.cost
    return found.score > than.score


def _own(fitted: Fit) -> np.ndarray:
    """Derivatives for the robot's own parameters, which come first."""
    return fitted.J[:, [i for i, f in enumerate(fitted.model.free) if f.effect is None]]


def _leaner(
    objective: Objective,
    evidence: Evidence,
    base: Weighed,
    best: Weighed,
    known: dict[tuple[str, ...], Weighed],
    accept: float,
    progress: Progress,
) -> Weighed:
    """Drop every effect beside the base's whose removal costs less evidence than `accept`; the last one stays."""
    while len(added := [e for e in best.effects if e not in base.effects]) > 1:
        reduced = []
        for effect in added:
            rest = tuple(e for e in best.effects if e != effect)
            if rest not in known:
                progress(f"without {effect}")
                known[rest] = refit_without(objective, evidence, base, best, effect)
            reduced.append(known[rest])
        lean = max(reduced, key=lambda w: w.score)
        if lean.score < best.score - accept:
            break
        best = lean
    return best


def refit_without(objective: Objective, evidence: Evidence, base: Weighed, best: Weighed, effect: str) -> Weighed:
    """The best set less one effect, everything else fitted again.

    A robot fitted with the effect may have no equilibrium without it, where lengths are held: then from the base's robot, and where
    that has none under the other effects, the base itself.
    """
    keep = [i for i, f in enumerate(best.fit.model.free) if f.effect != effect]
    model = best.fit.model.without_effect(effect)
    as_calibrated = Model(replace(model.twin, values=base.fit.model.twin.values), model.free)
    for start, J in ((model, best.fit.J[:, keep]), (as_calibrated, _own(base.fit))):
        try:
            return weigh(objective, evidence, fit(objective, start, J=J))
        except SolveError:
            continue
    return base
