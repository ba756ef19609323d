"""What a fit to one half of the session would have predicted of the other: against refits, by hand, and on a real bench day."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.recorded_days import recorded_day
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.evidence import half_session as stage
from twin.diagnosis.evidence.half_session import PredictiveErrors, halves, predictive_errors
from twin.foundation.errors import SolveError
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

ROWS = (4, 6, 3, 7, 5)  # of five trials: halves of two and three


class Line:
    """Residuals z0 + J x of some trials, where the last may have no equilibrium once the first was fitted."""

    def __init__(self, J: np.ndarray, z0: np.ndarray, trials: list[int], lost: bool = False) -> None:
        self.J, self.z0, self.trials, self.lost = J, z0, trials, lost
        self.n = sum(ROWS[k] for k in trials)

    def of(self, which: Any) -> Line:
        return Line(self.J, self.z0, [self.trials[k] for k in which], self.lost)

    @property
    def mine(self) -> np.ndarray:
        return np.isin(np.repeat(np.arange(len(ROWS)), ROWS), self.trials)

    def solved(self) -> np.ndarray:
        return np.linalg.lstsq(self.J[self.mine], -self.z0[self.mine], rcond=None)[0]

    def evaluate(self, x: np.ndarray, near: Any) -> Any:
        if self.lost and 4 in self.trials:
            raise SolveError("no equilibrium")
        return SimpleNamespace(z=(self.z0 + self.J @ x)[self.mine])


def study_of(objective: Line) -> Any:
    bench = SimpleNamespace(outputs=[SimpleNamespace(group="marker")], inputs=[SimpleNamespace(time=np.arange(n)) for n in ROWS])
    present = np.ones((sum(ROWS), 1), bool)
    return SimpleNamespace(objective=objective, trials=objective.trials, prepared=bench, evidence=SimpleNamespace(present=present))


@pytest.fixture
def day(monkeypatch: pytest.MonkeyPatch) -> tuple[Line, Any]:
    rng = np.random.default_rng(5)
    objective = Line(rng.normal(size=(sum(ROWS), 2)), rng.normal(size=sum(ROWS)) + 3.0, list(range(len(ROWS))))
    asked: list[np.ndarray] = []

    def refit(part: Line, model: Any, *, near: Any, J: np.ndarray, stop: Any) -> Any:
        np.testing.assert_array_equal(J, objective.J[part.mine][:, :1])  # the robot's own alone, of the rows that are fitted
        asked.append(J)
        x = part.solved()
        return SimpleNamespace(model=x, evaluation=SimpleNamespace(traces=None))

    monkeypatch.setattr(stage, "fit", refit)
    free = [SimpleNamespace(effect=None), SimpleNamespace(effect="drive")]
    x = objective.solved()
    evaluation = SimpleNamespace(raw=[np.empty((n, 1)) for n in ROWS])
    z, model = objective.z0 + objective.J @ x, SimpleNamespace(free=free)
    found = SimpleNamespace(z=z, J=objective.J, model=model, evaluation=evaluation)
    return objective, SimpleNamespace(fit=found)


def test_each_half_is_what_a_fit_to_the_other_leaves(day: tuple[Line, Any]) -> None:
    objective, weighed = day
    early, late = objective.of([0, 1]), objective.of([2, 3, 4])
    expected = np.concatenate([
        (objective.z0 + objective.J @ late.solved())[early.mine], (objective.z0 + objective.J @ early.solved())[late.mine]
    ])  # fmt: skip
    found = halves(study_of(objective), weighed)
    np.testing.assert_allclose(found.z.ravel(), expected)
    assert found.square > float(np.mean(weighed.fit.z**2)), "what is not fitted is predicted worse"


def test_a_half_without_equilibrium_is_missed_by_any_amount(day: tuple[Line, Any]) -> None:
    objective, weighed = day
    objective.lost = True
    found = halves(study_of(objective), weighed)
    assert np.isfinite(found.z[: sum(ROWS[:2])]).all()
    assert np.isinf(found.z[sum(ROWS[:2]) :]).all()


def test_near_and_far_count_alike() -> None:
    def left(square: float, headline: float) -> Any:
        return SimpleNamespace(square=square, headline=headline)

    both = PredictiveErrors(left(4.0, 1.0), left(9.0, 16.0))
    assert (both.square, both.headline) == (6.0, 4.0)


@pytest.mark.parametrize(("trials", "far"), [(3, 4.0), (4, 9.0)])
def test_of_three_trials_or_fewer_a_half_is_no_more_than_a_trial(trials: int, far: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "left_out", lambda study, fit: SimpleNamespace(square=4.0))
    monkeypatch.setattr(stage, "halves", lambda study, weighed: SimpleNamespace(square=9.0))
    study, weighed = SimpleNamespace(trials=range(trials)), SimpleNamespace(fit=None)
    assert predictive_errors(study, weighed).far.square == far  # type: ignore[arg-type]


def test_part_of_an_objective_sees_its_trials_as_the_whole_does() -> None:
    """Of a bench day: residuals of two trials alone are their share of all. A warm start differs by the solver's tolerance,
    a thousandth of the markers' noise is far above it."""
    recording = recorded_day(None)[0].select(["slow_1", "pair_3", "circle_1", "wander_3"])
    day = prepare(recording, load("continuum"))
    model, objective, _ = objective_of(day, Twin.of(day.robot), [0, 1, 2, 3], Settings(jobs=1))
    whole = objective.evaluate(model)
    part = objective.of([1, 3])
    assert part.trials == [1, 3]
    each = np.split(whole.z, np.cumsum([r.size for r in whole.raw])[:-1])
    alone = part.evaluate(model, whole.traces)
    np.testing.assert_allclose(alone.z, np.concatenate([each[1], each[3]]), rtol=0, atol=1e-3)
    assert part.n == sum(int(np.isfinite(day.measured[k]).sum()) for k in (1, 3))
