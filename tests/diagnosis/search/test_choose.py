"""Which set is gone on with: by structure, and by what it predicts of trials left out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from twin.diagnosis.budget import Budget
from twin.diagnosis.evidence.half_session import PredictiveErrors
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import better
from twin.diagnosis.search import choose as stage
from twin.diagnosis.search.choose import add_one_effect, choose, halved, most_predictive, predicting, solves
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import SETS_FITTED_TO_HALVES
from twin.foundation.errors import SolveError

STUDY = cast(Any, SimpleNamespace(accuracy=0.0, objective=SimpleNamespace(bends=False)))


def weighed(
    *effects: str, score: float, size: float, unseen: float, headline: float | None = None, far: float | None = None, form: str = ""
) -> Any:
    """A set of effects with its evidence, smooth error, and RMS on trials left out (all outputs, headline) and on halves."""
    model = SimpleNamespace(twin=SimpleNamespace(effects=effects))
    headline = unseen if headline is None else headline
    beyond = errors(unseen, headline) if far is None else errors(far, far)
    fit = SimpleNamespace(model=model, unseen=unseen, headline=headline, far=beyond)
    laws, left = tuple((e, form) for e in effects), SimpleNamespace(beyond=lambda accuracy: size - accuracy)
    return SimpleNamespace(effects=effects, forms=laws, score=score, discrepancy=left, fit=fit)


def errors(rms: float, headline: float) -> Any:
    return SimpleNamespace(square=rms**2, headline=headline**2)


@pytest.fixture(autouse=True)
def by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "left_out", lambda study, fit: errors(fit.unseen, fit.headline))
    monkeypatch.setattr(
        stage, "predictive_errors", lambda study, w: PredictiveErrors(errors(w.fit.unseen, w.fit.headline), w.fit.far)
    )
    monkeypatch.setattr(stage, "solves", lambda study, twin: True)


def searched(base: Any, *sets: Any) -> Search:
    ranked = tuple(sorted((base, *sets), key=lambda w: -w.score))
    return Search(base, ranked[0], ranked)


def test_a_set_is_chosen_by_what_it_predicts_only_if_it_halves_the_squared_error() -> None:
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    imitation = weighed("routing", score=40.0, size=5.5, unseen=3.8)
    cause = weighed("drive", score=20.0, size=3.5, unseen=2.0)
    assert most_predictive(STUDY, searched(base, imitation, cause)) is cause
    assert most_predictive(STUDY, searched(base, imitation)) is None, "nothing predicts: the evidence has the word"
    weak = weighed("drive", score=20.0, size=5.0, unseen=3.0)  # 9/16 of the square
    assert most_predictive(STUDY, searched(base, imitation, weak)) is None
    both = weighed("drive", "routing", score=25.0, size=3.4, unseen=1.9)
    assert most_predictive(STUDY, searched(base, imitation, cause, both)) is cause, "the second effect does not pay"


def test_of_two_laws_of_one_name_the_one_that_predicts_is_chosen() -> None:
    """Though the other has more evidence: block 2 of the three-cable robot, whose ropes have a toe."""
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    stretch = weighed("ropes", score=40.0, size=5.5, unseen=3.8, form="stretch")
    toe = weighed("ropes", score=20.0, size=3.5, unseen=2.0, form="toe")
    assert most_predictive(STUDY, searched(base, stretch, toe)) is toe
    pair = weighed("drives", "ropes", score=30.0, size=3.4, unseen=1.9, form="toe")
    assert most_predictive(STUDY, searched(base, stretch, toe, pair)) is toe, "the drives do not pay beside the toe"


@pytest.mark.parametrize(
    ("size", "unseen", "headline", "said"),
    [(3.0, 4.0, 4.0, True), (3.1, 2.0, 2.0, True), (3.1, 2.0, 3.9, False), (3.1, 3.9, 2.0, False), (3.1, 3.0, 3.0, False)],
)
def test_halved_is_the_structure_or_both_errors_left_out(size: float, unseen: float, headline: float, said: bool) -> None:
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    assert halved(STUDY, base, weighed("drive", score=9.0, size=size, unseen=unseen, headline=headline)) is said


def test_what_halves_the_structure_is_gone_on_with_as_the_evidence_ranks_it() -> None:
    base, best = weighed(score=0.0, size=6.0, unseen=4.0), weighed("drift", score=50.0, size=1.0, unseen=9.0)
    found = searched(base, best)
    assert choose(STUDY, found, AcceptanceLimits()) == found


def test_where_nothing_predicts_the_evidence_has_the_word() -> None:
    found = searched(weighed(score=0.0, size=6.0, unseen=4.0), weighed("routing", score=40.0, size=5.5, unseen=3.8))
    assert choose(STUDY, found, AcceptanceLimits()) == found


def moving(budget: Budget) -> Any:
    return SimpleNamespace(accuracy=0.0, objective=SimpleNamespace(bends=True), budget=budget, progress=lambda words: None)


def test_the_chosen_fit_of_motion_goes_on_to_its_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    base, best = weighed(score=0.0, size=6.0, unseen=4.0), weighed("drift", score=50.0, size=1.0, unseen=9.0)
    closer = weighed("drift", score=55.0, size=1.0, unseen=8.0)
    monkeypatch.setattr(stage, "converged", lambda study, rough: closer)
    assert choose(moving(Budget()), searched(base, best), AcceptanceLimits()) == Search(base, closer, (closer, base))
    late = moving(Budget(-1.0))
    assert choose(late, searched(base, best), AcceptanceLimits()) == searched(base, best)
    assert late.budget.untried == ["the last steps of drift"]
    alone = searched(base)
    assert choose(moving(Budget()), alone, AcceptanceLimits()) == alone  # the calibrated robot is at its minimum already


def test_of_two_near_each_other_the_better_at_its_minimum_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A set with an effect more, and one far behind, are not fitted again."""
    base, gain = weighed(score=0.0, size=6.0, unseen=4.0), weighed("gain", score=950.0, size=1.0, unseen=1.0)
    limit, far = weighed("limit", score=900.0, size=1.0, unseen=1.0), weighed("drift", score=500.0, size=1.0, unseen=1.0)
    pair = weighed("drift", "gain", score=955.0, size=1.0, unseen=1.0)
    minimum = {("gain",): 960.0, ("limit",): 970.0}
    monkeypatch.setattr(stage, "converged", lambda study, w: SimpleNamespace(**vars(w) | {"score": minimum[w.effects]}))
    found = choose(moving(Budget()), Search(base, gain, (pair, gain, limit, far, base)), AcceptanceLimits())
    assert (found.best.effects, found.best.score) == (("limit",), 970.0)
    assert [w.score for w in found.all] == [970.0, 960.0, 955.0, 500.0, 0.0]
    monkeypatch.setattr(stage, "solves", lambda study, twin: "limit" not in twin.effects)
    assert choose(moving(Budget()), Search(base, gain, (gain, limit, base)), AcceptanceLimits()).best.effects == ("gain",)


def test_a_twin_solves_a_set_unless_a_trial_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    def simulate(twin: Any, bench: Any, *, trials: list[int]) -> None:
        if 3 in trials:
            raise SolveError("lost")

    monkeypatch.setattr(stage, "simulate", simulate)
    assert solves(cast(Any, SimpleNamespace(prepared=None, trials=[1, 2])), cast(Any, None))
    assert not solves(cast(Any, SimpleNamespace(prepared=None, trials=[1, 3])), cast(Any, None))


def test_a_set_that_leaves_a_fitted_trial_without_equilibrium_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    falls, stands = weighed("ageing", score=90.0, size=0.1, unseen=0.1), weighed("drift", score=50.0, size=1.0, unseen=1.0)
    monkeypatch.setattr(stage, "solves", lambda study, twin: "ageing" not in twin.effects)
    assert predicting(STUDY, searched(base, falls, stands), 10.0) is stands


@pytest.mark.parametrize(("unseen", "taken"), [(2.5, True), (2.9, False), (2.6, False)])
def test_two_effects_that_halve_it_together_must_take_a_quarter_each(unseen: float, taken: bool) -> None:
    """Of 16 alone 9 and 12.25; together 6.25, under half and three quarters of 9; 8.41 is neither, 6.76 no quarter less."""
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    ropes, drives = weighed("ropes", score=5.0, size=5.0, unseen=3.0), weighed("drives", score=9.0, size=5.0, unseen=3.5)
    both = weighed("drives", "ropes", score=4.0, size=4.0, unseen=unseen)
    assert most_predictive(STUDY, searched(base, ropes, drives, both)) is (both if taken else None)


@pytest.mark.parametrize(("effects", "sought"), [(("ropes",), True), (("drives", "ropes"), False)])
def test_beside_a_pair_nothing_more_is_sought(monkeypatch: pytest.MonkeyPatch, effects: tuple[str, ...], sought: bool) -> None:
    core = weighed(*effects, score=1.0, size=3.5, unseen=1.0)
    monkeypatch.setattr(stage, "converged", lambda study, rough: rough)
    asked: list[Any] = []
    monkeypatch.setattr(stage, "add_one_effect", lambda study, core, found, bars: asked.append(core) or core)
    study: Any = SimpleNamespace(accuracy=0.0, budget=SimpleNamespace(allows=lambda what: True))
    assert choose(study, searched(weighed(score=0.0, size=6.0, unseen=4.0), core), AcceptanceLimits()).best is core
    assert bool(asked) is sought


@pytest.mark.parametrize("time_left", [True, False])
def test_what_is_gone_on_with_for_what_it_predicts_is_fitted_to_the_end(monkeypatch: pytest.MonkeyPatch, time_left: bool) -> None:
    base = weighed(score=30.0, size=6.0, unseen=4.0)
    rough, done, both = (
        weighed(*e, score=s, size=3.5, unseen=2.0) for e, s in ((["drive"], 20.0), (["drive"], 21.0), ("ab", 40.0))
    )
    rough.fit.evaluation, kept = "there", []
    monkeypatch.setattr(stage, "fit", lambda objective, model, **how: kept.append(how) or "to the end")
    monkeypatch.setattr(stage, "score_model", lambda study, fitted: done)
    monkeypatch.setattr(stage, "add_one_effect", lambda study, core, found, bars: both if core is done else None)
    study: Any = SimpleNamespace(accuracy=0.0, objective=STUDY.objective, budget=SimpleNamespace(allows=lambda what: time_left))
    found = choose(study, searched(base, rough), AcceptanceLimits())
    assert kept == [{"near": "there", "refresh": True}]
    assert found.base is base
    assert found.best is (both if time_left else done)
    assert found.all == ((both, base, rough) if time_left else (base, done))
    assert found.predicted


@pytest.mark.parametrize(
    ("score", "unseen", "stands", "taken"),
    [(12.1, 1.73, True, True), (11.9, 1.73, True, False), (12.1, 1.74, True, False), (12.1, 1.73, False, False)],
)  # the core: no evidence either way, 2 sigma left out, three quarters of whose square are 1.732^2
def test_beside_the_core_stays_what_has_evidence_and_predicts(
    score: float, unseen: float, stands: bool, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, core = weighed(score=30.0, size=6.0, unseen=4.0), weighed("drive", score=0.0, size=3.0, unseen=2.0)
    more = weighed("drive", "play", score=score, size=2.0, unseen=unseen)
    bent = weighed("drive", "routing", score=50.0, size=2.0, unseen=1.9)

    def extend(study: Any, of: Any, member: Any, lacks: Any, bars: Any, fresh: dict[tuple[str, ...], Any]) -> None:
        assert (of, member, lacks) == (base, core, "patterns")
        fresh |= {w.effects: w for w in (bent, more)}

    monkeypatch.setattr(stage, "extend", extend)
    monkeypatch.setattr(stage, "dictionary", lambda objective, fit: "patterns" if fit is core.fit else None)
    monkeypatch.setattr(stage, "solves", lambda study, twin: stands or "play" not in twin.effects)
    monkeypatch.setattr(stage, "converged", lambda study, rough: rough)
    study: Any = SimpleNamespace(accuracy=0.0, objective=STUDY.objective, progress=lambda words: None)
    assert add_one_effect(study, core, searched(base, core), AcceptanceLimits(accept=12.0)) is (more if taken else core)


def test_what_predicts_a_trial_and_not_a_half_of_the_session_is_passed_over() -> None:
    """A law that bends to the poses that were fitted: a quarter of the squared error of single trials, five of halves'."""
    base = weighed(score=30.0, size=6.0, unseen=4.0)
    bent = weighed("drive", score=20.0, size=3.5, unseen=2.0, far=9.0)
    ropes = weighed("ropes", score=10.0, size=3.5, unseen=2.9, far=2.5)
    assert most_predictive(STUDY, searched(base, bent, ropes)) is ropes
    assert most_predictive(STUDY, searched(base, bent)) is None
    assert not halved(STUDY, base, bent)
    assert not halved(STUDY, base, weighed("drift", score=9.0, size=3.5, unseen=0.0, far=float("inf")))


def test_halves_are_fitted_for_the_sets_that_promise_most(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, ...]] = []
    seen = stage.predictive_errors
    monkeypatch.setattr(stage, "predictive_errors", lambda study, w: asked.append(w.effects) or seen(study, w))
    base = weighed(score=30.0, size=6.0, unseen=4.0)
    worse = weighed("worse", score=25.0, size=5.0, unseen=4.1)
    sets = [weighed(f"law {k}", score=20.0 - k, size=5.0, unseen=3.5 - 0.1 * k, far=1.0) for k in range(SETS_FITTED_TO_HALVES + 2)]
    pair = weighed("a", "b", score=20.0, size=5.0, unseen=2.9)  # every effect pays for itself: less than the last of the singles
    assert most_predictive(STUDY, searched(base, worse, pair, *sets)) is sets[-1]
    assert set(asked) == {(), *(w.effects for w in sets[-SETS_FITTED_TO_HALVES:])}


def test_of_two_fits_of_one_law_the_lower_cost_wins_and_of_two_laws_the_evidence() -> None:
    def fitted(cost: float, score: float, *free: str) -> Any:
        return SimpleNamespace(fit=SimpleNamespace(cost=cost, model=SimpleNamespace(free=free)), score=score)

    trapped, lower = fitted(9.0, 40.0, "turn", "sine"), fitted(5.0, 30.0, "turn", "sine")
    assert better(lower, trapped)
    assert not better(trapped, lower)
    assert better(trapped, fitted(1.0, 30.0, "turn", "sine", "cosine"))
