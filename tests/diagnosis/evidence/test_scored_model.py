"""Refits of a fitted model, by hand: evidence from known numbers, fits that are looked up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration.fit import StopRule
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.evidence import scored_model as stage
from twin.diagnosis.evidence.scored_model import (
    ScoredModel,
    refit_without,
    score_model,
    with_effect_added,
    with_extended_law,
    without_idle_numbers,
)
from twin.diagnosis.thresholds import REFIT_SCORE_TOLERANCE, REFIT_TOLERANCE
from twin.effects import FitStart, catalogue, effect_class
from twin.foundation.errors import SolveError
from twin.prediction.twin import Twin
from twin.robots import load

N = 1000
ROBOT = load("continuum")
CREEP = "backbone_creep"
RICHER = catalogue()[CREEP].extended_parameters
PLAIN = tuple(p.name for p in catalogue()[CREEP].all_parameters(3) if p.name not in RICHER)


def study(budget: Budget | None = None) -> Any:
    bench = SimpleNamespace(n_tendon=3, robot=ROBOT)
    evidence = SimpleNamespace(log_likelihood_gain=lambda z: (100.0 - float(z @ z), "smooth"))
    return SimpleNamespace(
        objective=SimpleNamespace(n=N, bends=False), evidence=evidence, prepared=bench, progress=lambda words: None,
        budget=budget or Budget(),
        blocked_input_noise=lambda fit: 7.0,
    )  # fmt: skip


def calibrated(*effects: str) -> Model:
    """With these effects in force, all their plain parameters free."""
    model = Model.base(ROBOT, Twin.of(ROBOT))
    for e in effects:
        free = tuple(p.name for p in effect_class(e).all_parameters(3) if p.name not in effect_class(e).extended_parameters)
        model = model.with_effect(e, {}, free, 3)
    return model


HERE = SimpleNamespace(traces={})


def weighed(model: Model, score: float = 0.0) -> Any:
    """J names every parameter by its column."""
    J = np.tile(np.arange(float(len(model.free))), (2, 1))
    fit = SimpleNamespace(model=model, J=J, evaluation=HERE, at_bound=lambda: np.zeros(len(model.free), bool))
    return ScoredModel(fit, score, None)  # type: ignore[arg-type]


class Fits:
    """Stands in for `fit` and `weigh`: scores by the free parameters of an effect; keeps what it was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, score: float = 0.0, fails: int = 0) -> None:
        self.asked: list[tuple[Model, dict[str, Any]]] = []
        self.score, self.fails = score, fails
        monkeypatch.setattr(stage, "fit", self.fit)
        monkeypatch.setattr(stage, "score_model", lambda study, model: weighed(model, self.score))

    def fit(self, objective: Any, model: Model, **how: Any) -> Model:
        self.asked.append((model, how))
        if len(self.asked) <= self.fails:
            raise SolveError("lost")
        return model


def test_a_score_is_twice_the_log_evidence_less_priors_and_the_price_of_what_the_data_fix() -> None:
    """|z|^2 = 14, the priors' terms 3, 7 not heard by slack tendons: 100 - 14 - 7 - 3 - 2.5 log n."""
    fitted: Any = SimpleNamespace(z=np.array([1.0, 2.0, 3.0]), cost=17.0, effective_parameters=lambda: 2.5)
    found = score_model(study(), fitted)
    assert found.score == pytest.approx(100.0 - 17.0 - 7.0 - 2.5 * np.log(N))
    assert found.unheard == 7.0
    assert (found.fit, found.discrepancy) == (fitted, "smooth")


def test_one_effect_more_is_fitted_from_its_start_near_what_was_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    fits, member = Fits(monkeypatch), weighed(calibrated("base_tilt"))
    found = with_effect_added(study(), member, "tendon_friction", FitStart({"mu": 0.1}, ("mu",)), beat=7.0)
    assert found is not None
    assert found.effects == ("base_tilt", "tendon_friction")
    ((model, how),) = fits.asked
    assert model.twin.effects[-1]["mu"] == 0.1
    assert [f.label for f in model.free[len(member.fit.model.free) :]] == ["tendon_friction.mu"]
    assert how == {"near": HERE, "J": member.fit.J, "stop": StopRule(REFIT_TOLERANCE, REFIT_SCORE_TOLERANCE, 7.0)}
    Fits(monkeypatch, fails=1)
    assert with_effect_added(study(), member, "tendon_friction", FitStart({"mu": 0.1}, ("mu",))) is None


@pytest.mark.parametrize(("ended", "anew"), [("backbone.youngs_modulus", True), ("about_x", False), ("", False)])
def test_a_robot_whose_own_numbers_are_at_bounds_is_fitted_from_the_description(
    ended: str, anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With derivatives of its own; one within its bounds, whatever an effect's number is at, goes on from what was fitted."""
    base = calibrated("base_tilt")
    off = base.at(base.vector() * 1.01)
    fits, member = Fits(monkeypatch), weighed(off)
    member.fit.at_bound = lambda: np.array([f.parameter.name == ended for f in off.free])
    with_effect_added(study(), member, "tendon_friction", FitStart({"mu": 0.1}, ("mu",)))
    ((model, how),) = fits.asked
    own = {f.parameter.name for f in base.free if f.effect is None}
    assert model.twin.values == pytest.approx((base.twin.values | {n: ROBOT.value(n) for n in own}) if anew else off.twin.values)
    assert (how["J"] is None) == anew


@pytest.mark.parametrize(("truth", "begun"), [(0.15, 0.15), (0.07, 0.075), (0.7, 0.6), (1.1, 1.0), (-4.0, 0.6)])
def test_an_effect_of_a_motion_begins_where_it_brings_it_nearest(
    monkeypatch: pytest.MonkeyPatch, truth: float, begun: float
) -> None:
    """|z| is 3 without friction, and less within 0.3 of the truth; powers of two of 0.6, at most the largest there is. Where no
    amplitude is nearer, and where OFF is out of reach, the start stays."""
    fits, member, moving = Fits(monkeypatch), weighed(calibrated("base_tilt")), study()
    member.fit.evaluation = SimpleNamespace(z=np.full(1, 3.0), traces={})
    monkeypatch.setattr(stage, "unlikely", lambda fitted: ())

    def within(most: float, model: Model) -> Any:
        z = np.full(1, 10.0 * abs(model.twin.effects[-1]["mu"] - truth))
        return SimpleNamespace(z=z) if float(z @ z) <= most else None

    moving.objective = SimpleNamespace(n=N, bends=True, within=within)
    with_effect_added(moving, member, "tendon_friction", FitStart({"mu": 0.6}, ("mu",)))
    assert fits.asked[-1][0].twin.effects[-1]["mu"] == begun
    with_effect_added(moving, member, "actuator_saturation", FitStart({"limit": 5.0}, ("limit",)))
    assert fits.asked[-1][0].twin.effects[-1]["limit"] == 5.0


@pytest.mark.parametrize(("moves", "bent"), [(True, True), (True, False), (False, True)])
def test_a_bent_robot_in_motion_is_seen_as_described(monkeypatch: pytest.MonkeyPatch, moves: bool, bent: bool) -> None:
    """Its effects as they are; statics, and a robot within its bounds, stay what they are."""
    Fits(monkeypatch)
    monkeypatch.setattr(stage, "unlikely", lambda fitted: ())
    monkeypatch.setattr(stage, "score_model", lambda study, fitted: fitted)
    base = calibrated("base_tilt")
    off = base.at(base.vector() * 1.01)
    member, moving = weighed(off), study()
    member.fit.at_bound = lambda: np.array([bent and f.effect is None for f in off.free])
    evaluate, n = lambda model: SimpleNamespace(model=model, z=np.full(1, 3.0)), len(base.free)
    moving.objective = SimpleNamespace(n=N, bends=moves, evaluate=evaluate, jacobian=lambda at, which: np.ones((1, len(which))))
    found: Any = stage.described(moving, member)
    assert (found is not None) == (moves and bent)
    if found is not None:
        own = {f.parameter.name for f in base.free if f.effect is None}
        assert found.model.twin.values == pytest.approx(base.twin.values | {name: ROBOT.value(name) for name in own})
        assert found.model.twin.effects == off.twin.effects
        assert (found.J.shape, found.cost) == ((1, n), 9.0)


def test_amplitudes_of_either_sign_take_a_step_before_their_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    """One step with the shape held, then all from where that ended; where nothing has a shape, or no sign, all at once."""
    drift, member = "load_cell_drift", weighed(calibrated("base_tilt"))
    fits = Fits(monkeypatch)
    stepped, after = {"rate_1": 3e-5, "rate_2": -2e-5}, SimpleNamespace(traces={0: "stepped"})

    def fit(objective: Any, model: Model, **how: Any) -> Any:
        fits.fit(objective, model, **how)
        if len(fits.asked) == 2:
            return model
        moved = model.without_effect(drift).with_effect(
            drift, {**model.twin.effects[-1].values, **stepped}, ("rate_1", "rate_2"), 3
        )
        return SimpleNamespace(model=moved, evaluation=after)

    monkeypatch.setattr(stage, "fit", fit)
    start = FitStart({"rate_1": 1e-5, "rate_2": 1e-5, "levelling": 1e-3}, ("rate_1", "rate_2", "levelling"))
    found = with_effect_added(study(), member, drift, start, beat=7.0)
    assert found is not None
    (first, how), (whole, then) = fits.asked
    assert [f.label for f in first.free[len(member.fit.model.free) :]] == [f"{drift}.rate_1", f"{drift}.rate_2"]
    assert first.twin.effects[-1].values == {**effect_class(drift)({}, 3).values, **start.values}
    assert how == {"near": HERE, "J": member.fit.J, "stop": StopRule(worth=np.inf)}  # a fit that ends with its first step
    assert [f.label for f in whole.free[len(member.fit.model.free) :]] == [f"{drift}.{n}" for n in start.free]
    assert whole.twin.effects[-1].values == {**effect_class(drift)({}, 3).values, **start.values, **stepped}
    assert then == {"near": after, "J": member.fit.J, "stop": StopRule(REFIT_TOLERANCE, REFIT_SCORE_TOLERANCE, 7.0)}
    Fits(monkeypatch, fails=1)
    assert with_effect_added(study(), member, drift, start) is None
    for effect, begun in (
        (drift, FitStart({"rate_1": 1e-5}, ("rate_1",))),
        (CREEP, FitStart({"amplitude": 0.1}, ("amplitude", "time"))),
    ):
        plain = Fits(monkeypatch)
        assert with_effect_added(study(), member, effect, begun) is not None
        assert len(plain.asked) == 1


@pytest.mark.parametrize(
    ("worth", "kept"),
    [
        ((50.0, 0.0, -20.0), ["bias_1"]),  # one fits as well without, one better
        ((50.0, 4.0, 50.0), ["bias_1", "bias_2", "bias_3"]),
        ((0.0, 0.0, 0.0), ["bias_3"]),  # an effect without numbers would be none
        ((50.0, None, 50.0), ["bias_1", "bias_2", "bias_3"]),  # without it there is no equilibrium
    ],
)
def test_numbers_of_a_motion_that_are_worth_less_than_a_fit_s_last_step_are_off(
    worth: tuple[float | None, ...], kept: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """|z|^2 rises by what each number that is OFF is worth; what a fit's last step may fall by is no loss."""
    names = [f"bias_{i}" for i in (1, 2, 3)]
    model = Model.base(ROBOT, Twin.of(ROBOT)).with_effect("load_cell_bias", dict.fromkeys(names, 0.02), names, 3)

    def within(most: float, model: Model, near: Any) -> Any:
        off = [w for n, w in zip(names, worth, strict=True) if model.twin.effects[-1][n] == 0.0]
        if None in off:
            raise SolveError("slack")
        square = 100.0 + sum(w for w in off if w is not None)
        return SimpleNamespace(model=model, z=np.array([np.sqrt(square)]), traces={}) if square <= most else None

    told = study()
    told.objective.within, told.objective.bends = within, True
    start = within(np.inf, model, None)
    begun: Any = SimpleNamespace(model=model, J=np.zeros((1, len(model.free))), z=start.z, evaluation=start, cost=107.0, trust=1.0)
    monkeypatch.setattr(stage, "score_model", lambda study, fitted: ScoredModel(fitted, 0.0, None))  # type: ignore[arg-type]
    found = without_idle_numbers(told, ScoredModel(begun, 0.0, None)).fit  # type: ignore[arg-type]
    assert [f.parameter.name for f in found.model.free if f.effect] == kept
    assert found.J.shape == (1, len(found.model.free))
    assert found.cost == pytest.approx(7.0 + float(found.z @ found.z))
    assert [found.model.twin.effects[-1][n] for n in names] == [0.02 if n in kept else 0.0 for n in names]
    told.objective.bends = False
    still = ScoredModel(begun, 0.0, None)  # type: ignore[arg-type]
    assert without_idle_numbers(told, still) is still


def test_a_fuller_law_stands_where_the_data_ask_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    member, said = weighed(calibrated("base_tilt", CREEP, "tendon_friction"), score=10.0), []
    told = study()
    told.progress = said.append
    for score, kept in ((22.0, False), (22.1, True)):
        fits = Fits(monkeypatch, score)
        found = with_extended_law(told, member, 12.0)
        assert (found is not member) is kept
        ((model, how),) = fits.asked
        creep = next(e for e in model.twin.effects if e.id == CREEP)
        assert {f.parameter.name for f in model.free if f.effect == CREEP} == {*PLAIN, *RICHER}
        table = {p.name: p for p in catalogue()[CREEP].all_parameters(3)}
        for name in RICHER:  # amplitudes one step from OFF, times, which mean nothing while these are OFF, as they stand
            assert creep[name] == table[name].value + (0.0 if name in creep.inactive_when_off else table[name].step)
        own = [i for i, f in enumerate(member.fit.model.free) if f.effect is None]
        np.testing.assert_array_equal(how["J"], member.fit.J[:, own])
    assert said == 2 * [f"extended equation of {CREEP}"]


def test_a_fuller_law_is_fitted_from_each_start_and_the_best_fit_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    member, fits = weighed(calibrated(CREEP), score=10.0), Fits(monkeypatch, 30.0)
    starts = [FitStart({"amplitude_2": x, "time_2": 40.0}, ("amplitude_2", "time_2")) for x in (0.01, 0.02, 0.03)]
    monkeypatch.setattr(catalogue()[CREEP], "extended_starts", lambda law, predicted: iter(starts))
    scores = iter((30.0, 50.0, 40.0))
    monkeypatch.setattr(stage, "score_model", lambda study, model: weighed(model, next(scores)))
    found = with_extended_law(study(), member, 12.0)
    assert [next(e for e in model.twin.effects if e.id == CREEP)["amplitude_2"] for model, _ in fits.asked] == [0.01, 0.02, 0.03]
    assert found.score == 50.0


def test_a_fuller_law_is_not_tried_twice_nor_beyond_the_time_nor_without_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    fits, plain = Fits(monkeypatch, 1e9), weighed(calibrated(CREEP))
    full = with_extended_law(study(), plain, 12.0)
    assert len(fits.asked) == 1
    assert with_extended_law(study(), full, 12.0) is full
    late = study(Budget(-1.0))
    assert with_extended_law(late, plain, 12.0) is plain
    assert late.budget.untried == [f"the extended equation of {CREEP}"]
    monkeypatch.setattr(catalogue()[CREEP], "extended_needs", frozenset({"wings"}))
    assert with_extended_law(study(), plain, 12.0) is plain
    assert len(fits.asked) == 1
    monkeypatch.setattr(catalogue()[CREEP], "extended_needs", ROBOT.build().features)
    assert with_extended_law(study(), plain, 12.0) is not plain, "all the parts that there are"


def test_a_law_that_is_fuller_is_tried_fuller_still_with_all_that_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an amplitude in force: not that alone again, nor the time without it; both, each free once."""
    monkeypatch.setattr(catalogue()[CREEP], "extended_starts", lambda law, predicted: iter([]))
    steps = {"amplitude_2": 0.02, "time_2": 40.0}
    starts = [FitStart(steps, free) for free in (("amplitude_2",), ("time_2",), ("amplitude_2", "time_2"))]
    plain = weighed(calibrated(CREEP), score=10.0)
    assert with_extended_law(study(), plain, 12.0) is plain, "none to try"
    monkeypatch.setattr(catalogue()[CREEP], "extended_starts", lambda law, predicted: iter(starts))
    scores = iter((50.0, 20.0, 30.0))
    monkeypatch.setattr(stage, "fit", lambda objective, model, **how: model)
    monkeypatch.setattr(stage, "score_model", lambda study, model: weighed(model, next(scores)))
    first = with_extended_law(study(), plain, 12.0)
    freed = [f.parameter.name for f in first.fit.model.free if f.effect == CREEP]
    assert freed == [*PLAIN, "amplitude_2"]
    scores = iter((90.0,))
    second = with_extended_law(study(), first, 12.0)
    assert second.score == 90.0
    assert [f.parameter.name for f in second.fit.model.free if f.effect == CREEP] == [*PLAIN, "amplitude_2", "time_2"]
    assert with_extended_law(study(), second, 12.0) is second


def test_a_fuller_law_that_cannot_be_solved_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = weighed(calibrated(CREEP))
    Fits(monkeypatch, 1e9, fails=1)
    assert with_extended_law(study(), plain, 12.0) is plain


def test_less_one_effect_the_rest_is_fitted_again_from_what_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    base, best = weighed(calibrated()), weighed(calibrated("base_tilt", "tendon_friction"))
    fits, told, said = Fits(monkeypatch), study(), []
    told.progress = said.append
    assert refit_without(told, base, best, "base_tilt").effects == ("tendon_friction",)
    assert said == ["without base_tilt"]
    ((_, how),) = fits.asked
    left = [i for i, f in enumerate(best.fit.model.free) if f.effect != "base_tilt"]
    np.testing.assert_array_equal(how["J"], best.fit.J[:, left])


def test_less_one_effect_a_fit_of_motion_goes_on_from_that_of_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    base, best = weighed(calibrated()), weighed(calibrated("base_tilt", "tendon_friction"))
    known, fits = weighed(calibrated("tendon_friction")), Fits(monkeypatch)
    for bends, start in ((False, best.fit.model.without_effect("base_tilt")), (True, known.fit.model)):
        told = study()
        told.objective = SimpleNamespace(**vars(told.objective) | {"bends": bends})
        refit_without(told, base, best, "base_tilt", (base, known))
        assert fits.asked[-1][0] == start


def test_without_equilibrium_it_is_fitted_from_the_calibrated_robot_and_at_last_is_that(monkeypatch: pytest.MonkeyPatch) -> None:
    base, best = weighed(calibrated()), weighed(calibrated("base_tilt", "tendon_friction"))
    name = base.fit.model.free[0].parameter.name
    base.fit.model.twin.values[name] = best.fit.model.twin.values.get(name, base.fit.model.free[0].parameter.value) * 1.01
    fits = Fits(monkeypatch, fails=1)
    found = refit_without(study(), base, best, "base_tilt")
    assert found.effects == ("tendon_friction",)
    assert found.fit.model.twin.values == base.fit.model.twin.values
    np.testing.assert_array_equal(fits.asked[1][1]["J"], base.fit.J)
    Fits(monkeypatch, fails=2)
    assert refit_without(study(), base, best, "base_tilt") is base


def test_laws_are_effects_with_the_form_that_is_fitted() -> None:
    ropes = "tendon_elasticity"
    model = calibrated("base_tilt")
    toe = weighed(model.with_effect(ropes, {"toe": 1e-4}, ("toe", "toe_tension"), 3))
    stretch = weighed(model.with_effect(ropes, {"stretch": 1e-4}, ("stretch",), 3))
    assert toe.effects == stretch.effects == ("base_tilt", ropes)
    assert toe.forms == (("base_tilt", ""), (ropes, "toe"))
    assert stretch.forms == (("base_tilt", ""), (ropes, "stretch"))
    assert toe.forms_without("base_tilt") == ((ropes, "toe"),)
    assert toe.forms_without(ropes) == (("base_tilt", ""),)
