"""Stage `gate`: drop what is too small, what may be a larger law's fault, what predicts worse, and what cannot be told apart."""

from dataclasses import dataclass, field

import numpy as np

from twin.diagnosis.evidence.left_out import left_out, proven
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import ScoredModel, refit_without, with_effect_added
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.lag_or_delay import LATE, tells_laws
from twin.diagnosis.search.screen import Screening
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, LARGE_STRUCTURE, LAW_FORM_SHARE, LEFT_BY_EFFECTS


@dataclass(frozen=True)
class TooSmall:
    """An effect found and not claimed: its fit, and how far (sigma) dropping it moved the fitted trials."""

    effect: str
    fitted: ScoredModel
    contribution: float


@dataclass(frozen=True)
class Ambiguity:
    """An effect that these data cannot tell from its `rival`; the set it was found in, and the one with the rival in its place."""

    effect: str
    rival: str
    found: ScoredModel
    other: ScoredModel


@dataclass(frozen=True)
class Gated:
    """What stays, its refits with one effect dropped, and what did not pass; the doubts of which `settle` took the likelier."""

    best: ScoredModel
    without: dict[str, ScoredModel] = field(default_factory=dict)
    small: tuple[TooSmall, ...] = ()
    doubts: tuple[Ambiguity, ...] = ()
    settled: tuple[Ambiguity, ...] = ()

    def contribution(self, context: FitContext, effect: str) -> float:
        return contribution(context, self.best, self.without[effect])


def gate(context: FitContext, found: Search, screening: Screening) -> Gated:
    """One effect after the other, the smallest first, until all that is left passes."""
    best, own = found.best, set(found.base.effects)
    small: list[TooSmall] = []
    doubts: list[Ambiguity] = []
    while True:
        without = {e: refit_without(context, found.base, best, e) for e in best.effects if e not in own}
        moved = {e: contribution(context, best, w) for e, w in without.items()}
        if not moved:
            return Gated(best, {}, tuple(small), tuple(doubts))
        least = min(moved, key=lambda e: moved[e])
        if _immaterial(context, screening.limits, best, without[least]) or _may_be_form(
            context, screening.limits, best, without, least
        ):
            small.append(TooSmall(least, best, moved[least]))
            best = without[least]
            continue
        harmful = [e for e in moved if len(moved) > 1 and _harms(context, screening.limits, best, without[e])]
        if harmful:
            best = without[min(harmful, key=lambda e: moved[e])]
            continue
        if (doubt := _doubt(context, found, screening, best, without)) is None:
            return Gated(best, without, tuple(small), tuple(doubts))
        doubts.append(doubt)
        best = without[doubt.effect]


def contribution(context: FitContext, best: ScoredModel, without: ScoredModel) -> float:
    """How far (sigma RMS) dropping an effect and refitting everything else moves the fitted trials."""
    fall = float(without.fit.z @ without.fit.z - best.fit.z @ best.fit.z)
    return float(np.sqrt(max(0.0, fall) / context.objective.n))


def _immaterial(context: FitContext, limits: AcceptanceLimits, best: ScoredModel, without: ScoredModel) -> bool:
    """Whether an effect moves too little, in all outputs together and in each group that an accuracy is declared for, and too
    little of that depends on more than the pose; nor shows in the outputs as they are. White residuals allow each row what its
    inputs' readings may err by. An error of that size which comes back at every row, a delay's, is small there: but not in the
    outputs, and they can be told it."""
    moved = contribution(context, best, without)
    if moved >= limits.visible or (
        moved >= limits.material and bool(np.any(context.fall_by_group(without.fit, best.fit) > context.excused))
    ):
        return False
    if context.evidence.beyond_pose(without.fit.z - best.fit.z) >= limits.material:
        return False
    after, before = context.unwhitened(best.fit), context.unwhitened(without.fit)
    shows = float(before @ before - after @ after) >= limits.visible**2 * context.objective.n
    return not (shows and context.evidence.beyond_pose(before - after) >= limits.material)


def _may_be_form(
    context: FitContext, limits: AcceptanceLimits, best: ScoredModel, without: dict[str, ScoredModel], least: str
) -> bool:
    """Whether an effect is so much smaller than another that it may be what that one's law gets wrong: unless it explains half of
    all that is left without it, on trials left out in turn too. A large law's faults leave more. They show where that law acts: in
    a group of outputs that it leaves alone, an effect is as large as it is there."""
    moved = {e: np.sqrt(np.maximum(0.0, context.fall_by_group(w.fit, best.fit)) / context.objective.n) for e, w in without.items()}
    if np.any((moved[least] >= limits.material) & (moved[least] >= LAW_FORM_SHARE * np.max(list(moved.values()), axis=0))):
        return False
    sizes = [(w.discrepancy.beyond(context.accuracy), left_out(context, w.fit).structure) for w in (best, without[least])]
    return not all(after <= LEFT_BY_EFFECTS * before for after, before in zip(*sizes, strict=True))


def _harms(context: FitContext, limits: AcceptanceLimits, best: ScoredModel, without: ScoredModel) -> bool:
    """Whether trials left out are predicted better without an effect; of a set that leaves noise alone of those fitted, where a
    step to first order throws one that is left out, by fits in truth."""
    own, other = left_out(context, best.fit), left_out(context, without.fit)
    if not own.worse(other) or best.discrepancy.size > max(LARGE_STRUCTURE, limits.left):
        return own.worse(other)
    return proven(context, best.fit, own).worse(proven(context, without.fit, other))


def _doubt(
    context: FitContext, found: Search, screening: Screening, best: ScoredModel, without: dict[str, ScoredModel]
) -> Ambiguity | None:
    """The first effect, of those smaller than what the design tells from its closest rival, that the rival in its place explains as
    well to within five standard errors; None where there is none. A rival that is in the set itself was fitted beside it. What
    `lateness` weighed is claimed with its odds."""
    rows, form = {(v.effect, v.form): v for v in screening.table}, dict(best.forms)
    for effect in sorted(without, key=lambda e: contribution(context, best, without[e])):
        row = rows.get((effect, form[effect]))
        if row is None or row.rival in ("", *best.effects):
            continue
        if {effect, row.rival} == LATE and tells_laws(context):
            continue
        if contribution(context, best, without[effect]) >= row.apart:
            continue
        other = _in_its_place(context, found, screening, without[effect], row.rival)
        if other is not None and other.score > best.score - CLEAR_CHI_SQUARE:
            return Ambiguity(effect, row.rival, best, other)
    return None


def _in_its_place(context: FitContext, found: Search, screening: Screening, rest: ScoredModel, rival: str) -> ScoredModel | None:
    """The set `rest` with the rival, as the search weighed it or fitted now; None without equilibrium."""
    effects = tuple(sorted((*rest.effects, rival)))
    weighed = [w for w in found.all if w.effects == effects]
    if not weighed:
        context.progress(f"{rival} in its place")
        starts = [p.start for p in screening.patterns.patterns if p.effect == rival]
        weighed = [w for start in starts if (w := with_effect_added(context, rest, rival, start)) is not None]
    return max(weighed, key=lambda w: w.score, default=None)
