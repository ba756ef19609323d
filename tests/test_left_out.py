"""What a fit would have predicted of trials left out, and what is chosen by it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from twin.diagnose import verdict
from twin.diagnose.left_out import left_out
from twin.diagnose.search import _better

TRIALS = (5, 8, 7)  # rows
STD = 0.7  # of the first parameter's prior, in steps; the second has none


def linear(rng: np.random.Generator) -> tuple[Any, Any, np.ndarray, np.ndarray]:
    """A linear least-squares problem dressed as an Objective and a Fit at its solution; and its J, and z at x = 0."""
    J = rng.normal(size=(sum(TRIALS), 2))
    z0 = rng.normal(size=sum(TRIALS)) + 3.0
    weight = np.array([1.0 / STD, 0.0])
    x = np.linalg.solve(J.T @ J + np.diag(weight**2), -J.T @ z0)
    free = [SimpleNamespace(parameter=SimpleNamespace(std=std, step=1.0)) for std in (STD, None)]
    fit = SimpleNamespace(J=J, z=z0 + J @ x, model=SimpleNamespace(free=free), at_bound=lambda: np.zeros(2, bool))
    measured = [np.zeros((n, 1)) for n in TRIALS]
    objective = SimpleNamespace(bench=SimpleNamespace(measured=measured), trials=range(len(TRIALS)), n=sum(TRIALS))
    return objective, fit, J, z0


def test_it_is_what_refits_without_each_trial_give() -> None:
    """To first order nothing is lost where the model is linear: equal to rounding (1e-8, from the ridge)."""
    objective, fit, J, z0 = linear(np.random.default_rng(3))
    ends, total = np.cumsum([0, *TRIALS]), 0.0
    for k in range(len(TRIALS)):
        out = np.zeros(len(z0), bool)
        out[ends[k] : ends[k + 1]] = True
        x = np.linalg.solve(J[~out].T @ J[~out] + np.diag([STD**-2, 0.0]), -J[~out].T @ z0[~out])
        total += float(((z0 + J @ x)[out] ** 2).sum())
    assert left_out(objective, fit) == pytest.approx(total / len(z0), rel=1e-8)
    assert left_out(objective, fit) > float(np.mean(fit.z**2)), "what is left out is predicted worse than what is fitted"


def test_what_one_trial_alone_shows_does_not_end_it() -> None:
    """J'J of 1e12 beside a ridge of 1e-9: the difference of two such sums would be singular."""
    objective, fit, J, _ = linear(np.random.default_rng(3))
    J[:, 1] = 0.0
    J[: TRIALS[0], 1] = 1e6
    assert np.isfinite(left_out(objective, fit))


def weighed(*effects: str, score: float, size: float, unseen: float) -> Any:
    twin = SimpleNamespace(effects=effects, unseen=unseen)
    fit = SimpleNamespace(model=SimpleNamespace(twin=twin))
    return SimpleNamespace(effects=effects, score=score, discrepancy=SimpleNamespace(size=size), fit=fit)


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> Any:
    """(base, sets) -> the effects chosen; every set is as bad on trials left out as on unseen ones."""
    monkeypatch.setattr(verdict, "left_out", lambda objective, fit: fit.model.twin.unseen**2)
    held_out = cast(Any, SimpleNamespace(error=lambda twin: twin.unseen))

    def choose(base: Any, *sets: Any) -> tuple[str, ...] | None:
        ranked = tuple(sorted((base, *sets), key=lambda w: -w.score))
        found = cast(Any, SimpleNamespace(base=base, best=ranked[0], all=ranked))
        core = verdict._most_predictive(found, cast(Any, None), held_out)
        return core.effects if core else None

    return choose


def test_a_set_is_chosen_by_what_it_predicts_only_if_each_of_its_effects_halves_the_squared_error(chosen: Any) -> None:
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    imitation = weighed("routing", score=40.0, size=5.5, unseen=3.8)
    cause = weighed("drive", score=20.0, size=3.5, unseen=2.0)
    assert chosen(base, imitation, cause) == ("drive",)
    assert chosen(base, imitation) is None, "nothing predicts: the evidence has the word"
    weak = weighed("drive", score=20.0, size=5.0, unseen=3.0)  # 9/16 of the square
    assert chosen(base, imitation, weak) is None
    both = weighed("drive", "routing", score=25.0, size=3.4, unseen=1.9)
    assert chosen(base, imitation, cause, both) == ("drive",), "the second effect does not pay"


def test_a_set_that_leaves_a_trial_without_equilibrium_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    base = weighed(score=0.0, size=6.0, unseen=4.0)
    falls, stands = weighed("ageing", score=90.0, size=0.1, unseen=0.1), weighed("drift", score=50.0, size=1.0, unseen=1.0)
    monkeypatch.setattr(verdict, "_solves", lambda twin, bench: "ageing" not in twin.effects)
    found = cast(Any, SimpleNamespace(base=base, best=falls, all=(falls, stands, base)))
    assert verdict._predicting(found, cast(Any, None), 10.0).effects == ("drift",)


@pytest.mark.parametrize(("left", "unseen", "kept"), [(0.1, 0.2, True), (0.1, 0.6, False), (0.9, 0.2, False)])
def test_a_small_effect_beside_a_large_one_must_take_half_of_what_is_left_on_unseen_trials_too(
    left: float, unseen: float, kept: bool
) -> None:
    held_out = cast(Any, SimpleNamespace(structure=lambda twin: (twin.unseen, {})))
    both = weighed("large", "small", score=0.0, size=left, unseen=unseen)
    alone = weighed("large", score=0.0, size=1.0, unseen=1.0)
    assert verdict._takes_most(held_out, both, alone) is kept


@pytest.mark.parametrize("stands", [True, False])
def test_what_is_found_beside_the_core_is_taken_if_every_trial_can_be_predicted_with_it(
    monkeypatch: pytest.MonkeyPatch, stands: bool
) -> None:
    base, core = weighed(score=9.0, size=6.0, unseen=4.0), weighed("drive", score=5.0, size=3.0, unseen=2.0)
    both = weighed("drive", "play", score=7.0, size=2.0, unseen=1.0)
    core.fit.evaluation = None
    monkeypatch.setattr(verdict, "fit", lambda *_, **__: core.fit)
    monkeypatch.setattr(verdict, "weigh", lambda *_: core)
    monkeypatch.setattr(verdict, "dictionary", lambda *_: None)
    monkeypatch.setattr(verdict, "search", lambda *_: SimpleNamespace(best=both, all=(both, core)))
    monkeypatch.setattr(verdict, "_solves", lambda twin, bench: stands or "play" not in twin.effects)
    found, nothing = cast(Any, SimpleNamespace(base=base, best=base, all=(base, core))), cast(Any, None)
    widened = verdict._beside(core, found, nothing, nothing, nothing, nothing, nothing)
    assert widened.best is (both if stands else core)
    assert widened.base is base
    assert [w.effects for w in widened.all] == [(), ("drive", "play"), ("drive",)]


def test_of_two_fits_of_one_law_the_lower_cost_wins_and_of_two_laws_the_evidence() -> None:
    def fitted(cost: float, score: float, *free: str) -> Any:
        return SimpleNamespace(fit=SimpleNamespace(cost=cost, model=SimpleNamespace(free=free)), score=score)

    trapped, better = fitted(9.0, 40.0, "turn", "sine"), fitted(5.0, 30.0, "turn", "sine")
    assert _better(better, trapped)
    assert not _better(trapped, better)
    assert _better(trapped, fitted(1.0, 30.0, "turn", "sine", "cosine"))
