"""Stage `gate`: drop effects that are too small, may be errors of a larger one, or are confusable with a rival."""

from dataclasses import dataclass, field

import numpy as np

from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import ScoredModel, described, refit_without, with_effect_added
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.choose import converged
from twin.diagnosis.search.lag_or_delay import LATE, tells_laws
from twin.diagnosis.search.screen import Screening
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, LARGEST_SCORE_GAP, LAW_FORM_SHARE, LEFT_BY_EFFECTS


@dataclass(frozen=True)
class TooSmall:
    """An effect found and not claimed: its fit, and how far (sigma) dropping it moved the fitted trials."""

    effect: str
    fitted: ScoredModel
    contribution: float


@dataclass(frozen=True)
class Ambiguity:
    """An effect that these data cannot separate from its `rival`.

    `found`: the set of effects it was found in. `other`: that set with the rival in its place.
    """

    effect: str
    rival: str
    found: ScoredModel
    other: ScoredModel


@dataclass(frozen=True)
class Gated:
    """The candidate that passed, its refits with one effect dropped, and what did not pass.

    `doubts`: ambiguities of which neither effect is taken. `settled`: those of which `resolve_ties` took the likelier effect.
    """

    best: ScoredModel
    without: dict[str, ScoredModel] = field(default_factory=dict)
    small: tuple[TooSmall, ...] = ()
    doubts: tuple[Ambiguity, ...] = ()
    settled: tuple[Ambiguity, ...] = ()

    def contribution(self, context: FitContext, effect: str) -> float:
        return contribution(context, self.best, self.without[effect])


def gate(context: FitContext, found: Search, screening: Screening) -> Gated:
    """Drop effects one after the other, the smallest first, until all remaining ones pass."""
    best, own = found.best, set(found.base.effects)
    small: list[TooSmall] = []
    doubts: list[Ambiguity] = []
    while True:
        without = {e: refit_without(context, found.base, best, e, found.all) for e in best.effects if e not in own}
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
        if (ambiguity := _ambiguity(context, found, screening, best, without)) is None:
            return Gated(best, without, tuple(small), tuple(doubts))
        doubts.append(ambiguity)
        best = without[ambiguity.effect]


def contribution(context: FitContext, best: ScoredModel, without: ScoredModel) -> float:
    """Return how far (sigma RMS) dropping an effect and refitting everything else moves the fitted trials."""
    fall = float(without.fit.z @ without.fit.z - best.fit.z @ best.fit.z)
    return float(np.sqrt(max(0.0, fall) / context.objective.n))


def _immaterial(context: FitContext, limits: AcceptanceLimits, best: ScoredModel, without: ScoredModel) -> bool:
    """Return whether an effect moves the outputs too little to be claimed.

    That is in all outputs together, in each group with a declared accuracy, in the part that depends on more than the pose, and in
    the residuals before whitening. Whitening allows each row the error of its input readings. An error of that size that returns in
    every row, a delay's, is small after whitening but not in the outputs.
    """
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
    """Return whether an effect may be an error of a much larger effect's equation.

    Not if it explains half of all that is left without it, on left-out trials too: errors of a large effect's equation leave more.
    Such errors show where that effect acts; in a group of outputs that it does not move, even a small effect counts.
    """
    moved = {e: np.sqrt(np.maximum(0.0, context.fall_by_group(w.fit, best.fit)) / context.objective.n) for e, w in without.items()}
    if np.any((moved[least] >= limits.material) & (moved[least] >= LAW_FORM_SHARE * np.max(list(moved.values()), axis=0))):
        return False
    sizes = [(w.discrepancy.beyond(context.accuracy), left_out(context, w.fit).structure) for w in (best, without[least])]
    return not all(after <= LEFT_BY_EFFECTS * before for after, before in zip(*sizes, strict=True))


def _ambiguity(
    context: FitContext, found: Search, screening: Screening, best: ScoredModel, without: dict[str, ScoredModel]
) -> Ambiguity | None:
    """Return the first ambiguity: an effect whose closest rival in its place explains the data as well; None if there is none.

    Only effects smaller than the design can separate from the rival are tried; of motion all, since what separates small effects
    need not separate large ones (a limit that drives run into, and their gain). "As well" is within five standard errors. A rival
    in the candidate itself was fitted beside the effect. A lag or a delay that `lag_or_delay` scored is claimed with its odds.
    """
    rows, form = {(v.effect, v.form): v for v in screening.table}, dict(best.forms)
    for effect in sorted(without, key=lambda e: contribution(context, best, without[e])):
        row = rows.get((effect, form[effect]))
        if row is None or row.rival in ("", *best.effects):
            continue
        if {effect, row.rival} == LATE and tells_laws(context):
            continue
        if contribution(context, best, without[effect]) >= row.apart and not context.objective.bends:
            continue
        other = _in_its_place(context, found, screening, without[effect], row.rival)
        if other is not None and other.score > best.score - CLEAR_CHI_SQUARE:
            return Ambiguity(effect, row.rival, best, other)
    return None


def _in_its_place(context: FitContext, found: Search, screening: Screening, rest: ScoredModel, rival: str) -> ScoredModel | None:
    """Return the set `rest` with the rival, as the search fitted it or fitted now; None without an equilibrium."""
    effects = tuple(sorted((*rest.effects, rival)))
    weighed = [w for w in found.all if w.effects == effects]
    if weighed or not context.budget.allows(" + ".join((*rest.effects, rival))):
        return max(weighed, key=lambda w: w.score, default=None)
    context.progress(f"{rival} in its place")
    starts = [p.start for p in screening.patterns.patterns if p.effect == rival]
    rest = described(context, rest) or rest
    fresh = [w for start in starts if (w := with_effect_added(context, rest, rival, start)) is not None]
    other = max(fresh, key=lambda w: w.score, default=None)
    near = other is not None and context.objective.bends and other.score > found.best.score - LARGEST_SCORE_GAP
    return converged(context, other) if other is not None and near else other
