"""Stage `resolve_ties`: where two effects cannot be separated and the data need one of them, take the likelier.

The data must be explained with each of the two: then the error is real, whatever its name, and a twin without it is off by that
much. Which of the two it is stays ambiguous. Where the data are noise without them, or not explained with them, neither is taken.
"""

from dataclasses import replace

from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import ScoredModel, refit_without
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.search import Search
from twin.diagnosis.verdict.gate import Gated
from twin.diagnosis.verdict.judge import out_of_sample, verdict, verdict_inputs


def resolve_ties(context: FitContext, found: Search, gated: Gated, limits: AcceptanceLimits) -> tuple[Search, Gated]:
    """Return the search and the gated set, with the ambiguities resolved that can be.

    The result is the smallest set, with an ambiguity's effect or its rival, that explains the data; else both are unchanged.
    """
    base = found.base

    def verdict_of(w: ScoredModel) -> str:
        return verdict(w is not base, verdict_inputs(context, base, w, limits, out_of_sample(context, w, limits)), limits)

    if not gated.doubts or verdict_of(gated.best) in ("noise", "explained"):
        return found, gated
    for n in reversed(range(len(gated.doubts))):
        pair = gated.doubts[n].found, gated.doubts[n].other
        if any(verdict_of(w) != "explained" or out_of_sample(context, w, limits).worse(left_out(context, base.fit)) for w in pair):
            continue
        weighed = (*found.all, *(w for w in pair if all(w.effects != known.effects for known in found.all)))
        best = max(pair, key=lambda w: w.score)
        without = {e: refit_without(context, base, best, e) for e in best.effects if e not in base.effects}
        found = replace(found, all=tuple(sorted(weighed, key=lambda w: -w.score)))
        return found, replace(gated, best=best, without=without, doubts=gated.doubts[:n], settled=gated.doubts[n:])
    return found, gated
