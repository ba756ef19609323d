"""The robot's own parameters, found in days of the independent bench whose robot is known to the test alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tests.recorded_days import half, recorded_day
from tools.simulators.rod.nuisance import built
from twin.diagnosis import Settings, calibrated_fit
from twin.diagnosis.calibration import fit as stage
from twin.diagnosis.calibration.fisher_information import solve, unidentifiable
from twin.diagnosis.calibration.fit import Fit, StopRule, fit
from twin.diagnosis.calibration.model import Free, Model, prior_weight
from twin.diagnosis.calibration.objective import Evaluation, Objective
from twin.diagnosis.checks.fit_warnings import strained, unlikely
from twin.diagnosis.evidence.ranking import projected
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.diagnosis.split import split
from twin.effects import catalogue
from twin.foundation.errors import SolveError
from twin.foundation.parameters import Parameter
from twin.measurements import Recording, read
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import Trace, TrialSimulator
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

SEEDS = (5, 6)
ROBOT = load("continuum")
PRIOR = {p.name: p for p in ROBOT.nuisance}


def calibrated(recording: Recording, **settings: int) -> Fit:
    return calibrated_fit(recording, Twin.of(ROBOT), Settings(**settings))[0]


@cache
def few() -> Recording:
    """A part of a day, with repeats."""
    return recorded_day(None)[0].select(["slow_1", "fast_3", "pair_1", "hold_2", "circle_1", "circle_2"])


@pytest.fixture(scope="module", params=SEEDS)
def case(request: pytest.FixtureRequest) -> tuple[int, Recording, Fit]:
    recording = half(recorded_day(None, seed=request.param)[0])
    return request.param, recording, calibrated(recording)


def test_it_finds_the_built_robot(case: tuple[int, Recording, Fit]) -> None:
    seed, _, found = case
    rod, fitted = built(np.random.default_rng([seed, 0])), found.fitted(None)
    true = {"backbone.youngs_modulus": rod.youngs_modulus, "tendons.radius": rod.hole_radius[0, 0]}
    for name, value in true.items():
        # Three standard errors, as for any honest fit: 3 in 1,000 days fail by chance, and these two days are always the same.
        assert abs(fitted[name].value - value) < 3 * fitted[name].std, name
    # What bends the robot is their ratio: known to a few per mille, or the calibration did nothing.
    ratio, true_ratio = (v["tendons.radius"] / v["backbone.youngs_modulus"] for v in ({n: fitted[n].value for n in true}, true))
    assert abs(ratio / true_ratio - 1) < 5e-3


def test_all_errors_together_are_as_large_as_claimed(case: tuple[int, Recording, Fit]) -> None:
    """Mean square of (found - true) / standard error over all parameters, those priors hold included."""
    seed, _, found = case
    rod, fitted = built(np.random.default_rng([seed, 0])), found.fitted(None)
    true = {
        "backbone.youngs_modulus": rod.youngs_modulus,
        "backbone.radius_taper": rod.radius_taper,
        "disks.mass": rod.disk_mass.sum(),
        "tendons.radius": rod.hole_radius[0, 0],
        **{f"disks.pitch_{k + 1}": p for k, p in enumerate(rod.pitch)},
        **{f"markers.axial_offset_{k + 1}": p for k, p in enumerate(rod.marker_offset)},
    }
    assert set(true) == set(fitted)
    pull = np.array([(fitted[n].value - v) / fitted[n].std for n, v in true.items()])
    # 20 correlated numbers of unit variance: a mean square above 3 or a single one beyond 4 is beyond chance. Prior draws cut at
    # two deviations make it smaller.
    assert np.mean(pull**2) < 3.0
    assert np.abs(pull).max() < 4.0


def test_what_is_left_is_noise(case: tuple[int, Recording, Fit]) -> None:
    _, _, found = case
    z = found.z[found.z != 0]
    # 15,000 whitened numbers: chance is 1.1 %; the chain's own error of 0.01 mm adds 0.2 %. The noise is estimated from the half
    # day's few repeats, its variance to some 3 %: three standard errors of all that are 10 %.
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.1)


def test_every_value_stays_within_its_bounds_and_gets_a_smaller_error(case: tuple[int, Recording, Fit]) -> None:
    _, _, found = case
    for name, value in found.fitted(None).items():
        assert PRIOR[name].low <= value.value <= PRIOR[name].high
        assert value.std is not None
        assert 0 < value.std < 1.1 * PRIOR[name].std  # data never widen a belief, but for the inflation by a residual above noise
        assert value.unit == PRIOR[name].unit


def test_it_names_what_the_data_do_not_fix(case: tuple[int, Recording, Fit]) -> None:
    _, recording, found = case
    std = {n: f.std for n, f in found.fitted(None).items()}
    assert "backbone.youngs_modulus" not in found.unfixed()
    # One marker alone on two unloaded pulls: the other markers' offsets cannot be known, and neither can the disks' mass.
    tip = tuple(c for c in recording.channels if c.role == "input" or c.name.startswith("disk_8"))
    thin = replace(
        recording,
        channels=tip,
        trials=tuple(
            replace(t, values={c.name: t.values[c.name] for c in tip})
            for t in recording.trials
            if t.name in ("slow_1.csv", "fast_1.csv")
        ),
    )
    poor = calibrated(thin)
    assert {f"markers.axial_offset_{k}" for k in range(1, 8)} | {"disks.mass"} <= set(poor.unfixed())
    for name, value in poor.fitted(None).items():
        assert value.std > std[name]  # less data, less certain


def test_same_seed_same_result_and_threads_do_not_count() -> None:
    recording = few()
    found = calibrated(recording, jobs=2)
    again = calibrated(recording, jobs=1)
    np.testing.assert_array_equal(again.model.vector(), found.model.vector())
    np.testing.assert_array_equal(again.z, found.z)
    np.testing.assert_array_equal(again.J, found.J)


def test_held_out_trials_do_not_count() -> None:
    recording = few()
    found = calibrated(recording)
    held = {prepare(recording, ROBOT).inputs[k].name for k in split(prepare(recording, ROBOT), 0)[1]}
    assert held
    outputs = [c.name for c in recording.outputs()]
    trials = tuple(
        replace(t, values={**t.values, **{n: 1e3 * (t.values[n] + 1) for n in outputs}}) if t.name in held else t
        for t in recording.trials
    )
    wild = replace(recording, trials=trials)
    np.testing.assert_array_equal(calibrated(wild).model.vector(), found.model.vector())


def test_its_derivatives_are_those_of_its_residual(case: tuple[int, Recording, Fit]) -> None:
    """Columns taken near the solution against whole predictions far apart enough to be free of the solver's last digits."""
    _, recording, found = case
    prepared = prepare(recording.select(["slow_1", "circle_1"]), ROBOT)
    trials = [0, 1]
    objective = Objective(prepared, trials, _white(prepared, trials), 1)
    model = Model(found.model.twin, found.model.free)
    at = objective.evaluate(model)
    x = model.vector()
    for i in (0, 3, len(x) - 1):
        column = objective.jacobian(at, [i])[:, 0]
        e = 0.2 * np.eye(len(x))[i]
        central = (objective.evaluate(model.at(x + e)).z - objective.evaluate(model.at(x - e)).z) / 0.4
        # Sigmas per step: the one-sided difference of 0.02 steps carries 1 % of a curvature of 2 sigma, the solver's 1e-6 rad
        # 0.5 um / 250 um / 0.02 = 0.1 sigma, of columns of up to 20.
        np.testing.assert_allclose(column, central, rtol=0, atol=0.12 + 0.01 * np.abs(central).max())


def test_a_fit_that_starts_at_its_answer_stays(case: tuple[int, Recording, Fit]) -> None:
    _, recording, found = case
    prepared = prepare(recording, ROBOT)
    fitted = split(prepared, 0)[0]
    objective = Objective(prepared, fitted, _white(prepared, fitted), 2)
    once = fit(objective, Model(found.model.twin, found.model.free))
    twice = fit(objective, once.model)
    assert twice.cost <= once.cost
    # Steps of a prior deviation each: the fit stops when the cost falls by less than 1e-5 of itself, i.e. by 0.3: half a standard
    # error along the weakest direction, which a prior deviation bounds.
    spread = once.std() / np.array([f.parameter.step for f in once.model.free])
    assert np.all(np.abs(twice.model.vector() - once.model.vector()) < spread)


def _white(prepared: PreparedRecording, trials: list[int]) -> Whitener:
    measured = [prepared.measured[k] for k in trials]
    noise = Noise(np.full(len(prepared.outputs), 2.5e-4), np.zeros(3), np.zeros(len(prepared.outputs)), "test")
    return Whitener(noise, measured, [np.zeros((*y.shape, 3)) for y in measured], [prepared.inputs[k].command for k in trials])


# ---- the ends of ranges ------------------------------------------------------------------------------------------------------


def ended(found: Fit, label: str, high: bool = True) -> Fit:
    """The same fit with one parameter at an end of its range."""
    model = found.model
    x = model.vector()
    i = next(i for i, f in enumerate(model.free) if f.parameter.name == label)
    p = model.free[i].parameter
    x[i] = (p.high if high else p.low) / p.step
    return replace(found, evaluation=replace(found.evaluation, model=model.at(x)))


def test_a_parameter_at_the_end_of_its_range_absorbs_nothing(case: tuple[int, Recording, Fit]) -> None:
    """A pattern that only the stiffness imitates gains nothing while that is free, and much once that is at its end."""
    found = case[2]
    assert not found.at_bound().any()
    i = next(i for i, f in enumerate(found.model.free) if f.parameter.name == "backbone.youngs_modulus")
    X = np.column_stack([found.J, found.J[:, i]])
    others = np.delete(found.J, i, axis=1)
    weight = np.diag(np.delete(prior_weight(found.model), i) ** 2)
    c = X[:, -1]
    alone = c @ c - c @ others @ np.linalg.solve(others.T @ others + weight, others.T @ c)  # what the other parameters leave of it
    free, held = (float(projected(X, X, f)[-1, -1]) for f in (found, ended(found, "backbone.youngs_modulus")))
    assert held == pytest.approx(alone, rel=1e-6)  # the same sum; 1e-9 is added to its diagonal
    assert 0.0 <= free < 0.01 * held  # its prior alone, of 6 %, speaks against


def test_a_law_at_the_end_of_its_range_is_said(case: tuple[int, Recording, Fit]) -> None:
    found = case[2]
    assert strained(found) == []
    bent = found.model.with_effect("backbone_precurvature", {"about_x": 0.1, "slope": 0.5}, ("about_x", "about_y", "slope"), 3)
    wider = replace(found, evaluation=replace(found.evaluation, model=bent))
    assert strained(wider) == []
    said = strained(ended(wider, "slope"))
    assert len(said) == 1
    assert said[0].startswith("backbone precurvature: slope came out at the end of its range (4)")
    assert strained(ended(found, "backbone.youngs_modulus")) == []  # the robot's own parameters have a notice of their own
    assert any("backbone.youngs_modulus" in words for words in unlikely(ended(found, "backbone.youngs_modulus")))


def test_the_derivative_of_strong_friction_is_that_of_full_solves() -> None:
    """The central difference within 7 %, as the law bends over the step. By one Newton step a sample, the slip of each carried on
    to the next, it came out 20 times too large."""
    whole = read(models_folder() / "continuum/samples/friday")
    prepared = prepare(whole, ROBOT)
    trials = list(range(6))
    objective = Objective(prepared, trials, _white(prepared, trials), 1)
    model = Model.base(ROBOT).with_effect("tendon_friction", {"mu": 0.65, "presliding": 2e-5}, ["mu"], 3)
    which = [f.label for f in model.free].index("tendon_friction.mu")
    at, x = objective.evaluate(model), model.vector()
    moved = [x + side * 0.02 * np.eye(len(x))[which] for side in (1.0, -1.0)]
    up, down = (objective.evaluate(model.at(y)).z for y in moved)
    full, found = (up - down) / 0.04, objective.jacobian(at, [which])[:, 0]
    assert np.linalg.norm(found - full) < 0.07 * np.linalg.norm(full)


@pytest.mark.parametrize("across", [0.0, 5e-3])
def test_the_derivative_of_a_slight_asymmetry_is_that_of_full_solves(across: float) -> None:
    """Its hinges turn with it: at e = 0.005 by 0.006 rad a nudge, which one Newton step leaves 8 % wrong; with nudges ten times as
    long it was 80 %."""
    whole = read(models_folder() / "continuum/samples/friday")
    prepared, trials = prepare(whole, ROBOT), [0, 1]
    objective = Objective(prepared, trials, _white(prepared, trials), 1)
    names = ["along", "across"]
    model = Model.base(ROBOT).with_effect("stiffness_asymmetry", {"along": 5e-3, "across": across}, names, 3)
    which = [f.label for f in model.free].index("stiffness_asymmetry.along")
    at, x = objective.evaluate(model), model.vector()
    for i in (which, which + 1):
        e = 0.3 * np.eye(len(x))[i]
        full = (objective.evaluate(model.at(x + e)).z - objective.evaluate(model.at(x - e)).z) / 0.6
        found = objective.jacobian(at, [i])[:, 0]
        assert np.linalg.norm(found - full) < 0.15 * np.linalg.norm(full), names[i - which]


def test_errors_go_together_as_the_closed_form_says() -> None:
    """Of two parameters the correlation is -b / sqrt(a c), [[a, b], [b, c]] = J'J; a third that nothing tells is left out."""
    free = tuple(Free(None, replace(p, std=None)) for p in load("continuum").nuisance[:3])
    model, J = Model(Twin.of(load("continuum")), free), np.zeros((3, 3))
    J[:, 0], J[:, 1] = [3.0, 0.0, 1.0], [1.0, 2.0, 1.0]
    labels, together = Fit(Evaluation(model, [], [], np.zeros(3)), J, 0.0).correlation()
    assert labels == tuple(f.label for f in free[:2])
    assert together == pytest.approx(np.array([[1.0, -4.0 / 60.0**0.5], [-4.0 / 60.0**0.5, 1.0]]))


def test_standard_errors_widen_where_the_residual_is_larger_than_its_noise() -> None:
    """With residuals three times as large as the noise they were divided by, three times the errors of ordinary least squares; with
    smaller ones no less than the noise makes."""
    rng = np.random.default_rng(0)
    p = Parameter("x", 0.0, "m", -10.0, 10.0, "by hand", scale=0.5)
    model = Model(Twin.of(ROBOT), (Free(None, p),))
    J = rng.normal(size=(400, 1))

    def spread(size: float, trust: float = 1.0) -> float:
        z = rng.normal(size=400)
        z *= size * np.sqrt(399) / np.linalg.norm(z)  # mean square size^2 over 399 degrees of freedom
        return float(Fit(Evaluation(model, [], [], z), J, 0.0, trust=trust).std()[0])

    noise = 0.5 / float(np.linalg.norm(J))  # SI: a step over the root of J'J
    assert spread(1.0) == pytest.approx(noise)
    assert spread(3.0) == pytest.approx(3.0 * noise)
    assert spread(0.5) == pytest.approx(noise)
    assert spread(3.0, trust=1.0 / 9.0) == pytest.approx(3.0 * noise)  # what a fit took for noise is not counted twice


def test_a_model_that_is_too_far_off_is_seen_at_the_first_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """`within` answers as `evaluate` where the bound holds, and simulates no trial after the one that breaks it."""
    prepared = prepare(few(), ROBOT)
    m, n, trials = len(prepared.outputs), prepared.n_tendon, [0, 2, 5]
    noise = Noise(np.full(m, 2e-4), np.full(n, 1e-3), np.zeros(m), "given")
    measured = [prepared.measured[k] for k in trials]
    seen = Whitener(noise, measured, [np.zeros((*y.shape, n)) for y in measured], [prepared.inputs[k].command for k in trials])
    objective, model, ran = Objective(prepared, trials, seen, 1), Model.base(ROBOT), []
    solve = TrialSimulator.solve
    monkeypatch.setattr(TrialSimulator, "solve", lambda self, inputs, *a: ran.append(inputs.name) or solve(self, inputs, *a))
    whole = objective.evaluate(model)
    assert ran == [prepared.inputs[k].name for k in trials]
    z = np.split(whole.z, np.cumsum([y.size for y in measured])[:-1])
    first, second = float(z[0] @ z[0]), float(z[1] @ z[1])
    enough = objective.within(1.001 * float(whole.z @ whole.z), model)
    assert enough is not None
    assert np.array_equal(enough.z, whole.z)
    for most, after in ((0.999 * first, 1), (first + 0.999 * second, 2)):
        ran.clear()
        assert objective.within(most, model) is None
        assert len(ran) == after
    # Its derivatives are the slopes of whole predictions; tolerances as in test_its_derivatives_are_those_of_its_residual.
    i, x = next(i for i, f in enumerate(model.free) if f.label == "tendons.radius"), model.vector()
    e = 0.2 * np.eye(len(x))[i]
    central = (objective.evaluate(model.at(x + e)).z - objective.evaluate(model.at(x - e)).z) / 0.4
    np.testing.assert_allclose(objective.jacobian(whole, [i])[:, 0], central, rtol=0, atol=0.12 + 0.01 * np.abs(central).max())


def test_a_neighbour_without_equilibrium_takes_no_other_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared = prepare(recorded_day(None)[0].select(["slow_1"]), ROBOT)
    objective, model = Objective(prepared, [0], _white(prepared, [0]), 2), Model.base(ROBOT)
    at, x = objective.evaluate(model), model.vector()
    near = [(model.at(x + 0.2 * e), 0.2) for e in np.eye(len(x))[:2]]
    lost = model.at(x + 0.1).twin

    solve = TrialSimulator.solve

    def solved(self: TrialSimulator, *rest: Any) -> Trace:
        if self.twin == lost:
            raise SolveError("no static equilibrium")
        return solve(self, *rest)

    monkeypatch.setattr(TrialSimulator, "solve", solved)
    models = [near[0], (model.at(x + 0.1), 0.1), near[1]]
    with pytest.raises(SolveError, match="no static equilibrium"):
        objective.columns(at, models)
    columns = objective.columns(at, models, unsolved="zeros")
    np.testing.assert_array_equal(columns[:, 1], 0.0)
    assert np.abs(columns[:, [0, 2]]).max(axis=0).min() > 0.0
    np.testing.assert_array_equal(columns[:, [0, 2]], objective.columns(at, near))


# ---- coverage: do intervals hold the truth as often as they say ----------------------------------------------------------------


class Linear(Objective):
    """A bench whose white outputs are A x, x in steps, measured as y with noise of one sigma."""

    def __init__(self, A: np.ndarray, y: np.ndarray) -> None:
        nothing: Any = SimpleNamespace(measured=[])
        super().__init__(nothing, [], nothing, 1)
        self.A, self.y = A, y

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        z = self.y - self.A @ model.vector()
        return Evaluation(model, {}, [], z) if z @ z <= most else None

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        return -self.A[:, list(which)]


# Two numbers believed to some spread beforehand, which the data fix well and badly, and two of which nothing is believed.
BELIEVED = (0.8, 0.3, None, None)
LOOKS = (0.3, 0.03, 0.2, 1.0)  # size of each one's pattern: standard errors of 1/3, 3, 1/2 and 1/10 steps from 100 samples alone
STEP = 0.5  # SI
FREE = tuple(
    Free(None, Parameter(f"p{i}", 0.0, "m", -50.0, 50.0, "made", std=None if s is None else s * STEP, scale=STEP))
    for i, s in enumerate(BELIEVED)
)


def drawn(rng: np.random.Generator, louder: float = 1.0) -> tuple[np.ndarray, Fit]:
    """What is true (SI), drawn as believed, and what is fitted to it through noise of `louder` times the sigma it is divided by."""
    A = rng.normal(size=(100, 4)) * LOOKS
    # std takes a step's share: STEP * s believed in SI is s steps
    x = np.array([rng.normal() * s if s is not None else rng.uniform(-3.0, 3.0) for s in BELIEVED])
    y = A @ x + louder * rng.normal(size=100)
    return x * STEP, fit(Linear(A, y), Model(Twin.of(ROBOT), FREE))


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """90 % intervals, value +- 1.645 standard errors, over 400 linear days: 85 to 95 % of each parameter (1.5 % by chance, and some
    1 % wide for the residual's own scatter, which only ever widens). Half the error would hold 59 %, twice the error 99.9 %."""
    rng = np.random.default_rng(0)
    days = [drawn(rng) for _ in range(400)]
    held = [np.abs([f.model.value(p) for p in FREE] - true) < 1.645 * f.std() for true, f in days]
    assert np.all(np.abs(np.mean(held, axis=0) - 0.90) < 0.05)
    # Mean square of the error over its standard error: one, known to sqrt(2 / 1600), less 4 % for the widening.
    pull = np.array([([f.model.value(p) for p in FREE] - true) / f.std() for true, f in days])
    assert 0.86 < np.mean(pull**2) < 1.06


def test_an_amplitude_is_no_better_known_than_the_form_of_its_law() -> None:
    """2 % of how far it is from OFF, beside the data's error; of where a wall stands, and of the robot's own, nothing."""
    free = (
        *(Free("contact", p) for p in catalogue()["contact"].parameters[:3]),
        *(Free("load_cell_gain", p) for p in catalogue()["load_cell_gain"].all_parameters(3)[:1]),
        FREE[0],
    )
    wall = catalogue()["contact"]({"stiffness": 300.0, "azimuth": 2.0, "distance": 0.03})
    twin = replace(Twin.of(ROBOT), effects=(wall, catalogue()["load_cell_gain"]({"gain_1": 1.1})))
    A = 1e3 * np.random.default_rng(3).normal(size=(100, 5))
    model = Model(twin, free)
    found = Fit(Evaluation(model, {}, [], np.zeros(100)), A, 0.0)
    surely = dict(zip([f.label for f in free], found.std(), strict=True))
    assert found.fitted("contact")["stiffness"].std == pytest.approx(np.hypot(surely["contact.stiffness"], 6.0))
    assert found.fitted("load_cell_gain")["gain_1"].std == pytest.approx(np.hypot(surely["load_cell_gain.gain_1"], 2e-3))
    for name in ("azimuth", "distance"):
        assert found.fitted("contact")[name].std == surely[f"contact.{name}"]
    assert found.fitted(None)["p0"].std == surely["p0"]


def test_intervals_hold_where_the_noise_is_larger_than_it_was_taken_for() -> None:
    """Twice the sigma that residuals were divided by: of the numbers that the data alone fix, as many are held."""
    rng = np.random.default_rng(1)
    days = [drawn(rng, louder=2.0) for _ in range(300)]
    held = [np.abs([f.model.value(p) for p in FREE] - true) < 1.645 * f.std() for true, f in days]
    assert np.all(np.abs(np.mean(held, axis=0)[2:] - 0.90) < 0.05)  # 1.7 % by chance


def test_a_fit_of_a_linear_bench_is_its_posterior() -> None:
    """Mean and covariance of a Gaussian with a Gaussian prior, by least squares with the prior as further rows."""
    rng = np.random.default_rng(2)
    A, y = rng.normal(size=(100, 4)) * LOOKS, 3.0 * rng.normal(size=100)
    f = fit(Linear(A, y), Model(Twin.of(ROBOT), FREE))
    rows = np.diag([0.0 if s is None else 1.0 / s for s in BELIEVED])
    whole, zero = np.vstack([A, rows]), np.zeros(4)
    x = np.linalg.lstsq(whole, np.append(y, zero), rcond=None)[0]
    np.testing.assert_allclose(f.model.vector(), x, atol=1e-3)  # steps; a fit stops when its cost falls by less than 1e-5 of itself
    spread = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)) * np.sum((y - A @ x) ** 2) / 96.0)
    np.testing.assert_allclose(f.std(), STEP * spread, rtol=1e-3)
    assert f.cost == pytest.approx(np.sum((y - A @ x) ** 2) + np.sum((rows @ x) ** 2), rel=1e-4)
    # Share of each number that the data, not the belief, made: the trace of the hat matrix over the data's rows.
    hat = whole @ np.linalg.pinv(whole)
    assert f.effective_parameters() == pytest.approx(np.trace(hat[:100, :100]), rel=1e-6)


def test_a_fit_from_elsewhere_ends_at_the_posterior_and_within_the_ranges() -> None:
    """As above, with beliefs other than zero, begun far from them; where ranges cut it off, the bounded least-squares problem's."""
    rng = np.random.default_rng(5)
    A, y, belief = rng.normal(size=(100, 4)) * LOOKS, 3.0 * rng.normal(size=100), np.array([2.0, -1.0, 0.0, 0.0])
    rows = np.diag([0.0 if s is None else 1.0 / s for s in BELIEVED])
    whole, right = np.vstack([A, rows]), np.append(y, rows @ belief)
    least = np.linalg.lstsq(whole, right, rcond=None)[0]
    for bound in (100.0, 0.5 * np.abs(least).max()):  # steps
        free = tuple(
            replace(f, parameter=replace(f.parameter, value=b * STEP, low=-bound * STEP, high=bound * STEP))
            for f, b in zip(FREE, np.clip(belief, -bound, bound), strict=True)
        )
        right = np.append(y, rows @ np.clip(belief, -bound, bound))
        best = lsq_linear(whole, right, bounds=(-bound, bound), method="bvls").x
        unbelieving = np.clip(np.linalg.lstsq(A, y, rcond=None)[0], -bound, bound)  # from there on z grows
        for x in (np.full(4, 0.9 * min(bound, 4.0)), unbelieving):
            found = fit(Linear(A, y), Model(Twin.of(ROBOT), free).at(x))
            np.testing.assert_allclose(found.model.vector(), best, atol=2e-3)
            assert found.cost == pytest.approx(np.sum((whole @ best - right) ** 2), rel=1e-5)
        assert (np.abs(best) > 0.99 * bound).any() == (bound < 100.0)


def test_a_linear_bench_on_which_two_numbers_are_all_but_alike_is_fitted_to_the_end() -> None:
    """Of two patterns that differ in 5e-5 of their square damping of 1e-4 leaves two thirds of what parts them, in a step. As long
    as the cost falls as foretold damping falls too, and twelve steps are enough; with the same damping they would leave 0.8 %."""
    rng = np.random.default_rng(6)
    one, other = np.linalg.qr(rng.normal(size=(100, 2)))[0].T
    A = 30.0 * np.stack([one, np.sqrt(1.0 - 1e-4) * one + 1e-2 * other], axis=1)  # 1 - cosine: 5e-5
    true = np.array([3.0, -2.0])
    found = fit(Linear(A, A @ true), Model(Twin.of(ROBOT), FREE[2:]))
    np.testing.assert_allclose(found.model.vector(), true, atol=1e-4)
    last = StopRule(worth=1e9)  # a step that falls by less is the last
    once = fit(Linear(A, A @ true), Model(Twin.of(ROBOT), FREE[2:]), stop=last)
    rough = fit(Linear(A, A @ true), Model(Twin.of(ROBOT), FREE[2:]), stop=StopRule(worth=0.1))
    assert once.cost > 2.0 * rough.cost > 0.0
    assert 0.1 > rough.cost > 4.0 * found.cost


@pytest.mark.parametrize(("worth", "tried"), [(0.0, 8), (0.5, 5), (0.9, 4)])
def test_a_step_that_failed_is_shortened_only_as_long_as_it_may_be_worth_it(worth: float, tried: int) -> None:
    """With damping m a step is 1 / (1 + m) of the whole and foretells 1 - (m / (1 + m))^2 of its fall, here 1. As m goes up tenfold
    from 1e-4 this is 0.99 at 0.1, 0.75 at 1, 0.17 at 10, and 2e-3 at 1000, the last."""

    class Stuck(Linear):
        steps = 0

        def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
            self.steps += near is not None
            return super().within(most, model, near) if near is None else None

    bench = Stuck(np.ones((1, 1)), np.ones(1))
    found = fit(bench, Model(Twin.of(ROBOT), FREE[2:3]), stop=StopRule(0.0, worth))
    assert bench.steps == tried
    assert found.cost == 1.0


class Bent(Linear):
    """Outputs 4 A tanh(x / 4): derivatives where the fit ends are a fifth of those where it begins."""

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        x = model.vector()
        z = self.y - 4.0 * self.A @ np.tanh(0.25 * x)
        return Evaluation(model, {}, [], z) if z @ z <= most else None

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        return -(self.A / np.cosh(0.25 * at.model.vector()) ** 2)[:, list(which)]

    def renewed(self, at: Evaluation, which: Sequence[int], known: np.ndarray) -> np.ndarray:
        return self.jacobian(at, which)


def test_derivatives_that_have_changed_are_renewed_or_the_fit_ends_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spools and zeros that nobody knows bend the outputs; a fit that keeps its first derivatives does not reach the truth."""
    A, true = np.random.default_rng(4).normal(size=(60, 2)), np.array([6.0, -5.0])
    bench, model = Bent(A, 4.0 * A @ np.tanh(0.25 * true)), Model(Twin.of(ROBOT), FREE[2:])
    np.testing.assert_allclose(fit(bench, model).model.vector(), true, atol=1e-3)
    monkeypatch.setattr(stage, "MOST_RENEWALS", 0)
    assert np.abs(fit(bench, model).model.vector() - true).max() > 0.1


class Motion(Linear):
    """A bench whose outputs are those of a motion."""

    def __init__(self, A: np.ndarray, y: np.ndarray) -> None:
        super().__init__(A, y)
        self.n = y.size

    @property
    def bends(self) -> bool:
        return True


class BentMotion(Motion, Bent):
    """A motion that bends likewise."""


def test_derivatives_of_motion_learn_from_each_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Secants converge faster than tangents of the start, which come a constant factor nearer with each step."""
    A, true = np.random.default_rng(4).normal(size=(60, 2)), np.array([6.0, -5.0])
    free = tuple(Free(None, Parameter(n, 0.0, "1", -50.0, 50.0, "made", std=1e3, scale=1.0)) for n in ("a", "b"))
    model = Model(Twin.of(ROBOT), free)
    bench = BentMotion(A, 4.0 * A @ np.tanh(0.25 * true))
    monkeypatch.setattr(stage, "MOTION_RENEWALS", 0)
    learnt = fit(bench, model).model.vector() - true
    monkeypatch.setattr(stage._Step, "learned", lambda step, better: step.columns)
    kept = fit(bench, model).model.vector() - true
    assert np.abs(learnt).max() < 1e-2 * np.abs(kept).max()


class Product(Motion):
    """Outputs A (x_0 x_1) of a motion: data know the product of two numbers alone, as of a servo's gain and its strength."""

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        z = self.y - self.A @ np.prod(model.vector(), keepdims=True)
        return Evaluation(model, {}, [], z) if z @ z <= most else None

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        return -(self.A * at.model.vector()[::-1])[:, list(which)]

    def renewed(self, at: Evaluation, which: Sequence[int], known: np.ndarray) -> np.ndarray:
        return self.jacobian(at, which)


@pytest.mark.parametrize("product", [0.25, 0.5, 2.0])
def test_of_numbers_whose_product_alone_is_known_the_described_one_stays(product: float) -> None:
    """Along the curved valley of equal products only the description says where to end: there the cost is zero, and its standard
    deviation off it is one. A fit may end within what its stop is worth, here 3."""
    described = Free(None, Parameter("kp", 20.0, "N", 5.0, 40.0, "made", std=1.0, scale=1.0))
    unknown = Free(None, Parameter("gain", 50.0, "1", 5.0, 150.0, "made", scale=1.0))
    A = np.full((100, 1), 10.0)
    found = fit(Product(A, A[:, 0] * 1000.0 * product), Model(Twin.of(ROBOT), (described, unknown)), stop=StopRule(2e-4, 3.0))
    kp, gain = found.model.vector()
    assert found.cost < 3.0
    assert kp * gain == pytest.approx(1000.0 * product, rel=1e-4)  # 0.1 of 2,000 with noise of one sigma in 10 x, 100 times


class Kinked(Linear):
    """Outputs A x of the robot, and beside them a delay's, b |delay - 0.5 s|, whose derivative is taken from one side alone."""

    def within(self, most: float, model: Model, near: Mapping[int, Trace] | None = None) -> Evaluation | None:
        own, delay = model.vector()[:-1], model.twin.effects[0]["delay"]
        z = np.append(self.y - self.A @ own, -0.5 - 20.0 * abs(delay - 0.5))
        return Evaluation(model, {}, [], z) if z @ z <= most else None

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        step = at.model.free[-1].parameter.step
        whole = np.zeros((len(self.y) + 1, self.A.shape[1] + 1))
        whole[:-1, :-1], whole[-1, -1] = -self.A, -20.0 * step
        return whole[:, list(which)]


def test_a_kink_of_an_effect_does_not_stop_the_robots_own_numbers() -> None:
    """At its kink a delay promises a fall and gives a rise, by more than the robot's numbers would gain in the same step."""
    delay = next(p for p in catalogue()["time_delay"].parameters if p.name == "delay")
    twin = replace(Twin.of(ROBOT), effects=(catalogue()["time_delay"]({"delay": 0.5}),))
    A, true = 0.02 * np.random.default_rng(5).normal(size=(60, 2)), np.array([1.0, -1.0])
    found = fit(Kinked(A, A @ true), Model(twin, (*FREE[2:], Free("time_delay", delay))))
    np.testing.assert_allclose(found.model.vector()[:-1], true, atol=1e-3)
    assert found.model.twin.effects[0]["delay"] == pytest.approx(0.5, abs=1e-6)


def test_derivatives_of_a_neighbour_serve_as_well() -> None:
    """Of a linear bench they are its own: those given are kept, those that lack are taken."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(100, 4)) * LOOKS
    bench, model = Linear(A, rng.normal(size=100)), Model(Twin.of(ROBOT), FREE)
    whole = fit(bench, model)
    for given in (0, 2, 4):
        again = fit(bench, model, J=-A[:, :given])
        np.testing.assert_array_equal(again.J, whole.J)
        np.testing.assert_allclose(again.model.vector(), whole.model.vector(), rtol=1e-12)


def test_a_thousandth_of_its_range_from_an_end_a_parameter_stands_there() -> None:
    model = Model(Twin.of(ROBOT), FREE)  # from -50 to 50, so 0.1 is at the end
    for value, at in ((-49.95, True), (-49.85, False), (0.0, False), (49.85, False), (49.95, True)):
        moved = model.at(np.array([value / STEP, 0.0, 0.0, 0.0]))
        assert Fit(Evaluation(moved, [], [], np.zeros(5)), np.zeros((5, 4)), 0.0).at_bound().tolist() == [at, False, False, False]


def test_a_limit_far_below_the_end_of_a_range_that_no_robot_reaches_is_not_at_the_other() -> None:
    """4.4 N m of up to 10,000, where 0.02 N m are noticed."""
    wide = replace(FREE[0].parameter, value=1e4, low=1e-3, high=1e4, std=None, scale=0.02)
    model = Model(Twin.of(ROBOT), (replace(FREE[0], parameter=wide), *FREE[1:]))
    for value, at in ((4.4, False), (0.03, False), (0.02, True)):
        moved = model.at(np.array([value / 0.02, 0.0, 0.0, 0.0]))
        assert Fit(Evaluation(moved, [], [], np.zeros(5)), np.zeros((5, 4)), 0.0).at_bound().tolist() == [at, False, False, False]


def test_twins_and_what_moves_nothing_are_said_to_be_untold_and_the_search_goes_on() -> None:
    """Two numbers that move the data alike, in whole numbers so that no rounding saves it, and one that moves nothing."""
    rng = np.random.default_rng(0)
    A = np.zeros((100, 4))
    A[:, 0] = A[:, 1] = 1e6 * rng.integers(1, 9, 100)
    A[:, 2] = rng.normal(size=100) * LOOKS[2]
    free = tuple(Free(None, replace(f.parameter, std=None)) for f in FREE)
    found = fit(Linear(A, A[:, 0] + rng.normal(size=100)), Model(Twin.of(ROBOT), free))
    assert found.unfixed() == ["p0", "p1", "p3"]
    assert [f.std is None for f in found.fitted(None).values()] == [True, True, False, True]
    assert found.effective_parameters() == pytest.approx(2.0)
    together = found.model.vector()
    assert together[0] + together[1] == pytest.approx(1.0, abs=1e-6)  # steps: what the data do tell of the twins
    np.testing.assert_array_equal(unidentifiable(np.diag([1e-30, 1.0, 0.0])), [False, False, True])  # units do not decide
    np.testing.assert_allclose(solve(np.diag([1e-30, 2.0, 0.0]), np.array([1e-30, 1.0, 0.0])), [1.0, 0.5, 0.0])


def test_a_belief_that_data_hardly_narrow_is_called_unfixed() -> None:
    """Of the two believed numbers only the one with the faint pattern; of the others nothing was believed that could stay."""
    assert drawn(np.random.default_rng(4))[1].unfixed() == ["p1"]
