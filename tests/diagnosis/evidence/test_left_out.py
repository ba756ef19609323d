"""What a fit would have predicted of trials left out: against refits, by hand."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.calibration.fit import StopRule
from twin.diagnosis.evidence import left_out as stage
from twin.diagnosis.evidence.left_out import LeftOut, left_out, proven
from twin.diagnosis.thresholds import FIRST_ORDER_LIMIT, HALF_SESSION_TOLERANCE, REFIT_SCORE_TOLERANCE
from twin.foundation.errors import SolveError

TRIALS = (5, 8, 7)  # rows
STD = 0.7  # of the first parameter's prior, in steps; the second has none


def linear(rng: np.random.Generator, rows: tuple[int, ...] = TRIALS, off: float = 0.0) -> tuple[Any, Any, np.ndarray, np.ndarray]:
    """A linear least-squares problem dressed as a Study and a Fit, `off` its solution; and its J, and z at x = 0."""
    J = rng.normal(size=(sum(rows), 2))
    z0 = rng.normal(size=sum(rows)) + 3.0
    x = solved(J, z0, np.ones(sum(rows), bool)) + off
    free = [SimpleNamespace(parameter=SimpleNamespace(std=std, step=1.0, value=0.0)) for std in (STD, None)]
    model = SimpleNamespace(free=free, vector=lambda: x)
    fit = SimpleNamespace(J=J, z=z0 + J @ x, model=model, trust=1.0, at_bound=lambda: np.zeros(2, bool))
    outputs = [SimpleNamespace(group="marker")]
    bench = SimpleNamespace(inputs=[SimpleNamespace(time=np.arange(n)) for n in rows], outputs=outputs)
    objective = SimpleNamespace(n=sum(rows))
    evidence = SimpleNamespace(present=np.ones((sum(rows), 1), bool))
    return SimpleNamespace(prepared=bench, trials=range(len(rows)), objective=objective, evidence=evidence), fit, J, z0


def solved(J: np.ndarray, z0: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The fit to the kept rows."""
    return np.linalg.solve(J[kept].T @ J[kept] + np.diag([STD**-2, 0.0]), -J[kept].T @ z0[kept])


def refitted(J: np.ndarray, z0: np.ndarray, rows: tuple[int, ...]) -> np.ndarray:
    """Residuals of every part under the fit to the others, by fitting again."""
    z = np.empty_like(z0)
    for a, b in pairwise(np.cumsum([0, *rows])):
        out = np.zeros(len(z0), bool)
        out[a:b] = True
        z[out] = (z0 + J @ solved(J, z0, ~out))[out]
    return z


def test_it_is_what_refits_without_each_trial_give() -> None:
    """To first order nothing is lost where the model is linear: equal to rounding (1e-7, from the ridge of 1e-9)."""
    study, fit, J, z0 = linear(np.random.default_rng(3))
    found = left_out(study, fit)
    np.testing.assert_allclose(found.z.ravel(), refitted(J, z0, TRIALS), rtol=0, atol=1e-7)
    assert found.square == pytest.approx(float(np.mean(refitted(J, z0, TRIALS) ** 2)), rel=1e-7)
    assert found.square > float(np.mean(fit.z**2)), "what is left out is predicted worse than what is fitted"


def test_readings_that_a_fit_trusts_less_count_as_with_larger_noise() -> None:
    """To a ninth: as with three times the noise, by which residuals and derivatives are divided (1e-7, as above)."""
    study, fit, _, _ = linear(np.random.default_rng(3))
    fit.trust = 1.0 / 9.0
    found = left_out(study, fit)
    fit.J, fit.z, fit.trust = fit.J / 3.0, fit.z / 3.0, 1.0
    np.testing.assert_allclose(found.z, 3.0 * left_out(study, fit).z, rtol=0, atol=1e-7)


def test_trials_a_step_throws_far_off_are_fitted_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second trial, five times its square to first order, is predicted by a fit to the others; the third, which has no
    equilibrium under that, stays; the first, which doubles at most, is not asked for."""
    study, fitted, _, _ = linear(np.random.default_rng(3))
    fitted.model.free = [SimpleNamespace(effect=None), SimpleNamespace(effect="contact")]
    fitted.evaluation = SimpleNamespace(traces="near")
    study.prepared.inputs = [SimpleNamespace(name=str(k), time=i.time) for k, i in enumerate(study.prepared.inputs)]
    ends, asked, said = np.cumsum([0, *TRIALS]), [], []
    study.progress = said.append

    def of(trials: list[int]) -> Any:
        def evaluate(model: str, near: str) -> Any:
            assert (model, near) == (f"without {trials[0]}", "near")
            if trials == [2]:
                raise SolveError("caught")
            return SimpleNamespace(z=np.full(TRIALS[trials[0]], 7.0))

        return SimpleNamespace(trials=trials, evaluate=evaluate)

    def refit(objective: Any, model: Any, *, near: Any, J: np.ndarray, stop: StopRule) -> Any:
        asked.append(objective.trials)
        (k,) = set(range(3)) - set(objective.trials)
        np.testing.assert_array_equal(J, np.delete(fitted.J[:, :1], slice(ends[k], ends[k + 1]), axis=0))
        assert (near, stop) == (fitted.evaluation, StopRule(HALF_SESSION_TOLERANCE, REFIT_SCORE_TOLERANCE))
        return SimpleNamespace(model=f"without {k}")

    study.objective.of = of
    monkeypatch.setattr(stage, "fit", refit)
    thrown = fitted.z.copy()
    for k, times in enumerate((FIRST_ORDER_LIMIT, 5.0, FIRST_ORDER_LIMIT + 0.01)):
        thrown[ends[k] : ends[k + 1]] *= np.sqrt(times) * (1.0 - 1e-12)
    found = proven(study, fitted, LeftOut(study, thrown[:, None])).z.ravel()
    np.testing.assert_array_equal(found[ends[1] : ends[2]], 7.0)
    np.testing.assert_array_equal(np.delete(found, slice(ends[1], ends[2])), np.delete(thrown, slice(ends[1], ends[2])))
    assert asked == [[0, 2], [0, 1]]
    assert said == ["without 1", "without 2"]


def test_trials_of_one_condition_are_left_out_together() -> None:
    study, fit, J, z0 = linear(np.random.default_rng(3))
    found = left_out(study, fit, [[0, 2], [1]]).z.ravel()
    apart = np.repeat([0, 1, 0], TRIALS) == 1
    expected = np.where(apart, (z0 + J @ solved(J, z0, ~apart)), (z0 + J @ solved(J, z0, apart)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


def test_a_fit_that_has_not_converged_is_not_taken_further() -> None:
    """The step all trials together would take is no consequence of leaving one out: it stays in the residual."""
    study, fit, J, z0 = linear(np.random.default_rng(3), off=0.1)
    expected = refitted(J, z0, TRIALS) + J @ np.full(2, 0.1)
    np.testing.assert_allclose(left_out(study, fit).z.ravel(), expected, rtol=0, atol=1e-7)


def test_what_one_trial_alone_shows_stays() -> None:
    """The second parameter is seen in the first trial only, by J'J of 1e12 beside a ridge of 1e-9."""
    study, fit, J, _ = linear(np.random.default_rng(3))
    J[:, 1] = 0.0
    J[: TRIALS[0], 1] = 1e6
    assert np.isfinite(left_out(study, fit).z).all()


def test_a_single_trial_is_left_out_by_quarters() -> None:
    study, fit, J, z0 = linear(np.random.default_rng(4), rows=(20,))
    np.testing.assert_allclose(left_out(study, fit).z.ravel(), refitted(J, z0, (5, 5, 5, 5)), rtol=0, atol=1e-7)


def test_worse_is_all_channels_or_the_headline() -> None:
    """Two channels, of which the marker is the headline: 1,000 samples each. A description good for half a sigma of it, whose own
    square is 0.25, may add that to 1; not to what is worse altogether."""

    def of(marker: float, displacement: float, accuracy: float = 0.0) -> LeftOut:
        outputs = [SimpleNamespace(group="displacement"), SimpleNamespace(group="marker")]
        study: Any = SimpleNamespace(
            prepared=SimpleNamespace(outputs=outputs),
            objective=SimpleNamespace(n=2000),
            evidence=SimpleNamespace(present=np.ones((1000, 2), bool)),
            accuracy=np.array([0.0, accuracy]),
        )
        return LeftOut(study, np.tile([displacement, marker], (1000, 1)))

    plain = of(marker=1.0, displacement=2.0)
    assert plain.square == pytest.approx(2.5)
    assert plain.headline == pytest.approx(1.0)
    assert not of(1.001, 1.0).worse(plain), "what only displacements show leaves the markers' last digits"
    assert of(1.02, 1.0).worse(plain), "the markers' error is worse, though the displacements' falls more"
    assert of(0.9, 2.1).worse(plain), "all channels together are worse"
    assert not plain.worse(plain)
    assert not of(1.11, 1.0, accuracy=0.5).worse(plain), "1.232 of 1.26"
    assert of(1.13, 1.0, accuracy=0.5).worse(plain), "1.277 of 1.26"
    assert of(1.11, 1.95, accuracy=0.5).worse(plain), "all channels together are worse"
