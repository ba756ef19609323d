"""Fits of motion: derivatives by long steps, near those by short ones and not used where they are not; and errors above noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mechanics.mjcf.models import robot
from tests.servo import ARM, UNCERTAIN, day
from twin.diagnosis.calibration.fit import StopRule, fit
from twin.diagnosis.calibration.model import Model, prior_pull, prior_weight
from twin.diagnosis.calibration.objective import COARSE_ERROR, LARGEST_LAST_FALL, MISFIT_SHARE, TRIALS_PROBED, Objective
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.foundation.errors import SolveError
from twin.mechanics.mjcf import solver
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.twin import Twin
from twin.robots import load


@pytest.fixture
def swung(tmp_path: Path) -> tuple[Objective, Model]:
    robot(tmp_path, ARM, UNCERTAIN)
    prepared = prepare(day(tmp_path, 0.0), load(str(tmp_path)))
    return with_noise(prepared, 1e-3), Model.base(prepared.robot)


def with_noise(prepared: PreparedRecording, sigma: float) -> Objective:
    trials = [0, 1, 2, 3]
    measured, command = ([of[k] for k in trials] for of in (prepared.measured, [i.command for i in prepared.inputs]))
    noise = Noise(np.array([sigma]), np.zeros(1), np.zeros(1), "start")
    none = [np.zeros((*y.shape, 1)) for y in measured]
    return Objective(prepared, trials, Whitener(noise, measured, none, command), 1)


def test_long_steps_give_the_derivatives(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    objective, model = swung
    at, which = objective.evaluate(model), range(len(model.free))
    coarse = objective.jacobian(at, which)
    monkeypatch.setattr(solver, "COARSE_STEPS", 1.0)
    fine = Objective(objective.prepared, objective.trials, objective.whitener, 1).jacobian(at, which)
    off = np.linalg.norm(coarse - fine, axis=0) / np.linalg.norm(fine, axis=0)
    assert 0.0 < off.max() < COARSE_ERROR  # columns differ, so that long steps were taken, by less than what a fit bears


def test_precise_derivatives_take_no_long_steps(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor do those of some of its trials, by which derivatives are renewed."""
    objective, model = swung
    at, which = objective.evaluate(model), list(range(len(model.free)))
    precise = objective.precise()
    found = precise.jacobian(at, which), precise.renewed(at, which, np.zeros((at.z.size, len(which))))
    coarse = objective.jacobian(at, which)
    monkeypatch.setattr(solver, "COARSE_STEPS", 1.0)
    fine = Objective(objective.prepared, objective.trials, objective.whitener, 1).jacobian(at, which)
    for J in found:
        np.testing.assert_allclose(J, fine, atol=1e-9)
    assert np.abs(coarse - fine).max() > 1e-3


def test_steps_too_long_for_a_model_are_not_used(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    objective, model = swung
    at, which = objective.evaluate(model), range(len(model.free))
    monkeypatch.setattr(solver, "COARSE_STEPS", 1.0)
    fine = objective.jacobian(at, which)
    monkeypatch.setattr(solver, "COARSE_STEPS", 25.0)  # 50 ms, a third of the servo's period, where rows allow no more than 20 ms
    monkeypatch.setattr("twin.diagnosis.calibration.objective.COARSE_ERROR", 1e-3)
    again = Objective(objective.prepared, objective.trials, objective.whitener, 1).jacobian(at, which)
    np.testing.assert_allclose(again, fine, atol=1e-9)


def test_a_refit_to_fewer_trials_keeps_the_derivatives_it_was_given(
    swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Halves of a session are fitted many times; each renewal would cost a prediction for every parameter."""
    objective, model = swung
    whole = fit(objective, model, refresh=True)
    asked = []
    of = Objective.jacobian
    monkeypatch.setattr(Objective, "jacobian", lambda self, at, which: asked.extend(which) or of(self, at, which))
    part = objective.of([0, 1])
    rows = sum(r.size for r in whole.evaluation.raw[:2])
    found = fit(part, whole.model, near=whole.evaluation, J=whole.J[:rows])
    assert asked == []
    changed = replace(whole.model.twin, values={**whole.model.twin.values})
    fit(part, Model(changed, model.free), near=whole.evaluation, J=whole.J[:rows])
    assert asked  # of another model's derivatives nobody knows
    assert found.cost <= float(part.evaluate(whole.model).z @ part.evaluate(whole.model).z) + whole.cost - float(whole.z @ whole.z)


def test_motion_that_is_lost_in_long_steps_alone_is_taken_by_short_ones(
    swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    objective, model = swung
    at, which = objective.evaluate(model), range(len(model.free))
    coarse = objective.jacobian(at, which)
    of = Objective.predict

    def lost(self: Objective, twin: Twin, *rest: Any, once: bool = False, **more: Any) -> Any:
        if once and twin != model.twin:  # every neighbour, and not the model itself
            raise SolveError("the motion diverges")
        return of(self, twin, *rest, once=once, **more)

    monkeypatch.setattr(Objective, "predict", lost)
    fine = objective.jacobian(at, which)
    assert np.isfinite(fine).all()
    off = np.linalg.norm(coarse - fine, axis=0) / np.linalg.norm(fine, axis=0)
    assert 0.0 < off.max() < COARSE_ERROR


def test_where_motion_is_lost_on_one_side_the_other_gives_the_derivative(
    swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A servo that is unstable if it is any stronger, and one that is unstable either way."""
    objective, model = swung
    at, which = objective.evaluate(model), range(len(model.free))
    right, kp, predict = objective.jacobian(at, which), model.value(model.free[3]), Objective.predict

    def lost(to: float) -> Any:
        def found(self: Objective, twin: Twin, *rest: Any, **more: Any) -> Any:
            if (twin.values["actuator.servo.kp"] - kp) * to > 0.0 or (to == 0.0 and twin.values["actuator.servo.kp"] != kp):
                raise SolveError("diverges")
            return predict(self, twin, *rest, **more)

        return found

    monkeypatch.setattr(Objective, "predict", lost(1.0))
    # The tried move of all parameters is lost too, so that steps are short and differences large here: they err by 2e-3 and more.
    off = np.linalg.norm(objective.jacobian(at, which) - right, axis=0) / np.linalg.norm(right, axis=0)
    assert off.max() < 0.05
    monkeypatch.setattr(Objective, "predict", lost(0.0))
    assert not objective.jacobian(at, which)[:, 3].any()


def test_only_derivatives_that_changed_are_computed_again(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    objective, model = swung
    at, which = objective.evaluate(model), list(range(len(model.free)))
    right = objective.jacobian(at, which)
    known = right.copy()
    known[:, 0] *= 1.5
    asked: list[tuple[int, int]] = []
    of = Objective.jacobian

    def counted(self: Objective, at: Any, which: Any) -> np.ndarray:
        asked.append((len(self.trials), len(which)))
        return of(self, at, which)

    monkeypatch.setattr(Objective, "jacobian", counted)
    np.testing.assert_allclose(objective.renewed(at, which, known), right, atol=1e-9)
    assert asked == [(TRIALS_PROBED, len(which)), (len(objective.trials) - TRIALS_PROBED, 1)]


def test_a_hopeless_fit_renews_nothing(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    objective, model = swung
    J = objective.jacobian(objective.evaluate(model), range(len(model.free)))
    renewed = []
    monkeypatch.setattr(Objective, "renewed", lambda self, at, which, known: renewed.append(which) or known)
    fit(objective, model, J=J)
    assert renewed
    renewed.clear()
    fit(objective, model, J=J, stop=StopRule(beat=0.0))
    assert renewed == []


def test_a_fit_that_comes_nearer_with_each_step_is_not_given_up(swung: tuple[Objective, Model]) -> None:
    """From a servo twice too weak; its cost, logarithmic far from the data, promises nearly as much at each step as at the last."""
    objective, model = swung
    best = fit(objective, model)
    weak = model.at(model.vector() - np.array([0.0, 0.0, 0.0, 0.5 * model.vector()[3]]))
    found = fit(objective, weak, stop=StopRule(beat=1.1 * best.cost))
    np.testing.assert_allclose(found.cost, best.cost, rtol=1e-3)


def test_fits_of_motion_end_near_a_minimum_that_leaves_much(swung: tuple[Objective, Model]) -> None:
    objective, _ = swung
    at_noise, far = objective.smallest_fall(1e-5, objective.n), objective.smallest_fall(1e-5, 100.0 * objective.n)
    assert at_noise[0] == at_noise[1] <= LARGEST_LAST_FALL
    assert far[0] <= LARGEST_LAST_FALL
    np.testing.assert_allclose(far[1], max(far[0], MISFIT_SHARE * 99.0 * objective.n))


def test_derivatives_of_smooth_motion_are_those_of_small_differences(swung: tuple[Objective, Model]) -> None:
    """Differences of half a standard deviation err by 2e-3 of a column and more here, and in directions that data hardly show by
    all of it; those of 2 % of one by a twentieth of that."""
    objective, model = swung
    at, x = objective.evaluate(model), model.vector()
    found = objective.jacobian(at, range(len(model.free)))
    for i, column in enumerate(found.T):
        ends = [objective.white(objective._raw(objective.predict(model.at(x + d * np.eye(x.size)[i]).twin, once=True)[1]))
                for d in (-0.05, 0.05)]  # fmt: skip
        right = (ends[1] - ends[0]) / 0.1
        assert np.linalg.norm(column - right) < 1e-3 * np.linalg.norm(right)


def test_how_motion_is_differenced_is_tried_again_with_effects_in_force(
    swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Long steps that serve for a smooth swing do not serve for one that slips off at each turn."""
    objective, model = swung
    monkeypatch.setattr(solver, "COARSE_STEPS", 20.0)  # as long as a row, with friction too
    objective.jacobian(objective.evaluate(model), range(len(model.free)))
    greased = {"torque_hinge": 1.0, "presliding": 1e-3, "breakaway": 1.0, "stribeck": 0.05}
    rubbing = model.with_effect("joint_friction", greased, ("torque_hinge",), objective.prepared.n_tendon)
    fresh = Objective(objective.prepared, objective.trials, objective.whitener, 1)
    which = range(len(rubbing.free))
    known, right = (of.jacobian(of.evaluate(rubbing), which) for of in (objective, fresh))
    np.testing.assert_allclose(known, right, atol=1e-9)
    assert objective._differences_at(objective.evaluate(model)).long_steps
    assert not objective._differences_at(objective.evaluate(rubbing)).long_steps


def test_an_error_above_the_noise_counts_as_noise_of_that_size(swung: tuple[Objective, Model]) -> None:
    """Beside a swing of 30 noises that no number explains, whose root mean square is s noises.

    With noise declared s times as large, the usual cost |z|^2 / s^2 + priors has its minimum where n (1 + ln |z|^2 / n) + priors
    has it. Both fits end within a tenth of the standard deviations of the description, a small part of what the description leaves
    open. A step of the usual cost with the small noise leads on from there by more than three times as much.
    """
    objective, model = swung
    for y in objective.prepared.measured:
        y += 0.03 * np.sin(0.7 * np.arange(len(y)))[:, None]
    found = fit(objective, model, refresh=True)
    s = float(np.sqrt(found.z @ found.z / objective.n))
    assert s > 10.0
    alike = fit(with_noise(objective.prepared, 1e-3 * s), model, refresh=True)
    np.testing.assert_allclose(found.model.vector(), alike.model.vector(), atol=0.1)
    usual = found.J.T @ found.J + np.diag(prior_weight(found.model) ** 2)
    assert np.abs(np.linalg.solve(usual, found.J.T @ found.z + prior_pull(found.model))).max() > 0.3
