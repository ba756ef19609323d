"""Stage `settle`: of two effects that data cannot tell apart the likelier, where a structured error is left without either.

With the one as with the other the day must be explained: then what they do is there, whatever its name, and a twin without it is
off by that much. Which of them it is stays in doubt. Where a day is noise without them, or not explained with them, neither is
taken.
"""

from __future__ import annotations

from dataclasses import replace

from twin.diagnose.gate import Gated
from twin.diagnose.judge import look, unseen, verdict
from twin.diagnose.left_out import left_out
from twin.diagnose.null import Thresholds
from twin.diagnose.search import Search
from twin.diagnose.study import Study
from twin.diagnose.weigh import Weighed, refit_without


def settle(study: Study, found: Search, gated: Gated, bars: Thresholds) -> tuple[Search, Gated]:
    """The sets weighed; the gated one as it is, or the smallest with a doubt's effect, or its rival, that explains the day."""
    base = found.base

    def says(w: Weighed) -> str:
        return verdict(w is not base, look(study, base, w, bars, unseen(study, w, bars)), bars)

    if not gated.doubts or says(gated.best) in ("noise", "explained"):
        return found, gated
    for n in reversed(range(len(gated.doubts))):
        pair = gated.doubts[n].found, gated.doubts[n].other
        if any(says(w) != "explained" or unseen(study, w, bars).worse(left_out(study, base.fit)) for w in pair):
            continue
        weighed = (*found.all, *(w for w in pair if all(w.effects != known.effects for known in found.all)))
        best = max(pair, key=lambda w: w.score)
        without = {e: refit_without(study, base, best, e) for e in best.effects if e not in base.effects}
        found = replace(found, all=tuple(sorted(weighed, key=lambda w: -w.score)))
        return found, replace(gated, best=best, without=without, doubts=gated.doubts[:n], settled=gated.doubts[n:])
    return found, gated
