"""Derivatives of motion by long steps: near those by short ones, and not used where they are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mechanics.mjcf.models import robot
from tests.servo import ARM, UNCERTAIN, day
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import COARSE_ERROR, Objective
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.foundation.errors import SolveError
from twin.mechanics.mjcf import solver
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load


@pytest.fixture
def swung(tmp_path: Path) -> tuple[Objective, Model]:
    robot(tmp_path, ARM, UNCERTAIN)
    prepared, trials = prepare(day(tmp_path, 0.0), load(str(tmp_path))), [0, 1, 2, 3]
    measured, command = ([of[k] for k in trials] for of in (prepared.measured, [i.command for i in prepared.inputs]))
    noise = Noise(np.array([1e-3]), np.zeros(1), np.zeros(1), "start")
    none = [np.zeros((*y.shape, 1)) for y in measured]
    return Objective(prepared, trials, Whitener(noise, measured, none, command), 1), Model.base(prepared.robot)


def test_long_steps_give_the_derivatives(swung: tuple[Objective, Model], monkeypatch: pytest.MonkeyPatch) -> None:
    objective, model = swung
    at, which = objective.evaluate(model), range(len(model.free))
    coarse = objective.jacobian(at, which)
    monkeypatch.setattr(solver, "COARSE_STEPS", 1.0)
    fine = Objective(objective.prepared, objective.trials, objective.whitener, 1).jacobian(at, which)
    off = np.linalg.norm(coarse - fine, axis=0) / np.linalg.norm(fine, axis=0)
    assert 0.0 < off.max() < COARSE_ERROR  # columns differ, so that long steps were taken, by less than what a fit bears


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
