"""Of two effects that data cannot tell apart: when the likelier is taken, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.search.search import Search
from twin.diagnosis.verdict import resolve_ties as stage
from twin.diagnosis.verdict.gate import Ambiguity, Gated
from twin.diagnosis.verdict.resolve_ties import resolve_ties

BASE, BIAS, BENT, BOTH, SAG = (), ("bias",), ("bent",), ("bias", "creep"), ("creep", "sag")


def weighed(effects: tuple[str, ...], score: float) -> Any:
    return SimpleNamespace(effects=effects, score=score, fit=SimpleNamespace(effects=effects))


@pytest.fixture
def says(monkeypatch: pytest.MonkeyPatch) -> dict[Any, Any]:
    """The verdict of each set, to be set; "worse": sets that predict trials left out worse than the calibrated robot."""
    of: dict[Any, Any] = {"worse": ()}

    def left_out(study: Any, fit: Any) -> Any:
        return SimpleNamespace(effects=fit.effects, worse=lambda base: fit.effects in of["worse"] and base.effects == BASE)

    monkeypatch.setattr(stage, "verdict_inputs", lambda study, base, w, bars, beyond: w.effects)
    monkeypatch.setattr(stage, "verdict", lambda added, signs, bars: of[signs] if added == bool(signs) else "wrongly asked")
    monkeypatch.setattr(stage, "left_out", left_out)
    monkeypatch.setattr(stage, "out_of_sample", lambda study, w, bars: left_out(study, w.fit))
    monkeypatch.setattr(stage, "refit_without", lambda study, base, best, e: (best.effects, e))
    return of


BASIS, FOUND, OTHER = weighed(BASE, -400.0), weighed(BIAS, 0.0), weighed(BENT, -5.0)


def settled(gated: Gated, *known: Any) -> tuple[Search, Gated]:
    return resolve_ties(None, Search(BASIS, FOUND, known or (FOUND, OTHER, BASIS)), gated, AcceptanceLimits())  # type: ignore[arg-type]


DROPPED = Gated(BASIS, {}, doubts=(Ambiguity("bias", "bent", FOUND, OTHER),))


def test_the_likelier_is_taken_where_each_explains_what_is_left_without_either(says: dict[Any, Any]) -> None:
    says |= {BASE: "unexplained", BIAS: "explained", BENT: "explained"}
    _, found = settled(DROPPED)
    assert (found.best, found.without) == (FOUND, {"bias": (BIAS, "bias")})
    assert (found.doubts, found.settled) == ((), DROPPED.doubts)
    better = weighed(BENT, 3.0)
    rival = settled(Gated(BASIS, {}, doubts=(Ambiguity("bias", "bent", FOUND, better),)))[1]
    assert (rival.best, list(rival.without)) == (better, ["bent"])


@pytest.mark.parametrize(
    "changed",
    [
        {BASE: "noise"},  # nothing is left: then none of the two is needed
        {BIAS: "partly_explained"},
        {BENT: "unexplained"},
        {"worse": (BIAS,)},
        {"worse": (BENT,)},
    ],
)
def test_neither_is_taken_where_none_is_needed_or_one_explains_too_little(says: dict[Any, Any], changed: dict[Any, Any]) -> None:
    says |= {BASE: "unexplained", BIAS: "explained", BENT: "explained"} | changed
    search, found = settled(DROPPED)
    assert found is DROPPED
    assert search.all == (FOUND, OTHER, BASIS)


def test_what_explains_without_the_doubt_stays_alone(says: dict[Any, Any]) -> None:
    both, sag = weighed(BOTH, 9.0), weighed(SAG, 8.0)
    says |= {("creep",): "explained", BOTH: "explained", SAG: "explained"}
    gated = Gated(weighed(("creep",), 0.0), {}, doubts=(Ambiguity("bias", "sag", both, sag),))
    assert settled(gated, both, sag, BASIS)[1] is gated
    says["creep",] = "partly_explained"
    assert settled(gated, both, sag, BASIS)[1].best is both


def test_of_several_doubts_the_smallest_set_that_explains_is_taken(says: dict[Any, Any]) -> None:
    """The first was dropped from the largest set; what is not needed stays undecided."""
    both, sag = weighed(BOTH, 9.0), weighed(SAG, 8.0)
    first, last = Ambiguity("creep", "sag", both, sag), Ambiguity("bias", "bent", FOUND, OTHER)
    says |= {BASE: "unexplained", BIAS: "explained", BENT: "explained", BOTH: "explained", SAG: "explained"}
    gated = Gated(BASIS, {}, doubts=(first, last))
    _, found = settled(gated, both, sag, FOUND, OTHER, BASIS)
    assert (found.best, found.doubts, found.settled) == (FOUND, (first,), (last,))
    says[BENT] = "partly_explained"
    _, found = settled(gated, both, sag, FOUND, OTHER, BASIS)
    assert (found.best, found.doubts, found.settled) == (both, (), (first, last))


def test_a_rival_that_the_search_had_not_weighed_is_weighed_from_then_on(says: dict[Any, Any]) -> None:
    says |= {BASE: "unexplained", BIAS: "explained", BENT: "explained"}
    assert settled(DROPPED, FOUND, BASIS)[0].all == (FOUND, OTHER, BASIS)
    assert settled(DROPPED)[0].all == (FOUND, OTHER, BASIS)
