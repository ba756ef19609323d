"""Stage `gate`: drop what is too small, what may be a larger law's fault, what predicts worse, and what cannot be told apart."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from twin.diagnose.lateness import LATE, tells_laws
from twin.diagnose.left_out import left_out, proven
from twin.diagnose.null import Thresholds
from twin.diagnose.screen import Screening
from twin.diagnose.search import Search
from twin.diagnose.study import Study
from twin.diagnose.thresholds import CLEAR, FORM, HALF, MUCH
from twin.diagnose.weigh import Weighed, extended, refit_without


@dataclass(frozen=True)
class Small:
    """An effect found and not claimed: its fit, and how far (sigma) dropping it moved the fitted trials."""

    effect: str
    fitted: Weighed
    contribution: float


@dataclass(frozen=True)
class Doubt:
    """An effect that these data cannot tell from its `rival`; the set it was found in, and the one with the rival in its place."""

    effect: str
    rival: str
    found: Weighed
    other: Weighed


@dataclass(frozen=True)
class Gated:
    """What stays, its refits with one effect dropped, and what did not pass; the doubts of which `settle` took the likelier."""

    best: Weighed
    without: dict[str, Weighed] = field(default_factory=dict)
    small: tuple[Small, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    settled: tuple[Doubt, ...] = ()

    def contribution(self, study: Study, effect: str) -> float:
        return contribution(study, self.best, self.without[effect])


def gate(study: Study, found: Search, screening: Screening) -> Gated:
    """One effect after the other, the smallest first, until all that is left passes."""
    best, own = found.best, set(found.base.effects)
    small: list[Small] = []
    doubts: list[Doubt] = []
    while True:
        without = {e: refit_without(study, found.base, best, e) for e in best.effects if e not in own}
        moved = {e: contribution(study, best, w) for e, w in without.items()}
        if not moved:
            return Gated(best, {}, tuple(small), tuple(doubts))
        least = min(moved, key=lambda e: moved[e])
        if _immaterial(study, screening.bars, best, without[least]) or _may_be_form(study, screening.bars, best, without, least):
            small.append(Small(least, best, moved[least]))
            best = without[least]
            continue
        harmful = [e for e in moved if len(moved) > 1 and _harms(study, screening.bars, best, without[e])]
        if harmful:
            best = without[min(harmful, key=lambda e: moved[e])]
            continue
        if (doubt := _doubt(study, found, screening, best, without)) is None:
            return Gated(best, without, tuple(small), tuple(doubts))
        doubts.append(doubt)
        best = without[doubt.effect]


def contribution(study: Study, best: Weighed, without: Weighed) -> float:
    """How far (sigma RMS) dropping an effect and refitting everything else moves the fitted trials."""
    fall = float(without.fit.z @ without.fit.z - best.fit.z @ best.fit.z)
    return float(np.sqrt(max(0.0, fall) / study.objective.n))


def _immaterial(study: Study, bars: Thresholds, best: Weighed, without: Weighed) -> bool:
    """Whether an effect moves too little, in all outputs together and in each group that an accuracy is declared for, and too
    little of that depends on more than the pose; nor shows in the outputs as they are. White residuals allow each row what its
    inputs' readings may err by. An error of that size which comes back at every row, a delay's, is small there: but not in the
    outputs, and they can be told it."""
    moved = contribution(study, best, without)
    if moved >= bars.visible or (moved >= bars.material and bool(np.any(study.fall(without.fit, best.fit) > study.excused))):
        return False
    if study.evidence.beyond_pose(without.fit.z - best.fit.z) >= bars.material:
        return False
    after, before = study.plain(best.fit), study.plain(without.fit)
    shows = float(before @ before - after @ after) >= bars.visible**2 * study.objective.n
    return not (shows and study.evidence.beyond_pose(before - after) >= bars.material)


def _may_be_form(study: Study, bars: Thresholds, best: Weighed, without: dict[str, Weighed], least: str) -> bool:
    """Whether an effect is so much smaller than another that it may be what that one's law gets wrong: unless it explains half of
    all that is left without it, on trials left out in turn too. A large law's faults leave more. They show where that law acts: in
    a group of outputs that it leaves alone, an effect is as large as it is there."""
    moved = {e: np.sqrt(np.maximum(0.0, study.fall(w.fit, best.fit)) / study.objective.n) for e, w in without.items()}
    if np.any((moved[least] >= bars.material) & (moved[least] >= FORM * np.max(list(moved.values()), axis=0))):
        return False
    sizes = [(w.discrepancy.beyond(study.accuracy), left_out(study, w.fit).structure) for w in (best, without[least])]
    return not all(after <= HALF * before for after, before in zip(*sizes, strict=True))


def _harms(study: Study, bars: Thresholds, best: Weighed, without: Weighed) -> bool:
    """Whether trials left out are predicted better without an effect; of a set that leaves noise alone of those fitted, where a
    step to first order throws one that is left out, by fits in truth."""
    own, other = left_out(study, best.fit), left_out(study, without.fit)
    if not own.worse(other) or best.discrepancy.size > max(MUCH, bars.left):
        return own.worse(other)
    return proven(study, best.fit, own).worse(proven(study, without.fit, other))


def _doubt(study: Study, found: Search, screening: Screening, best: Weighed, without: dict[str, Weighed]) -> Doubt | None:
    """The first effect, of those smaller than what the design tells from its closest rival, that the rival in its place explains as
    well to within five standard errors; None where there is none. A rival that is in the set itself was fitted beside it. What
    `lateness` weighed is claimed with its odds."""
    rows, form = {(v.effect, v.form): v for v in screening.table}, dict(best.laws)
    for effect in sorted(without, key=lambda e: contribution(study, best, without[e])):
        row = rows.get((effect, form[effect]))
        if row is None or row.rival in ("", *best.effects):
            continue
        if {effect, row.rival} == LATE and tells_laws(study):
            continue
        if contribution(study, best, without[effect]) >= row.apart:
            continue
        other = _in_its_place(study, found, screening, without[effect], row.rival)
        if other is not None and other.score > best.score - CLEAR:
            return Doubt(effect, row.rival, best, other)
    return None


def _in_its_place(study: Study, found: Search, screening: Screening, rest: Weighed, rival: str) -> Weighed | None:
    """The set `rest` with the rival, as the search weighed it or fitted now; None without equilibrium."""
    effects = tuple(sorted((*rest.effects, rival)))
    weighed = [w for w in found.all if w.effects == effects]
    if not weighed:
        study.progress(f"{rival} in its place")
        starts = [p.start for p in screening.patterns.patterns if p.effect == rival]
        weighed = [w for start in starts if (w := extended(study, rest, rival, start)) is not None]
    return max(weighed, key=lambda w: w.score, default=None)
