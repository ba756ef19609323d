"""What keeps a day from being explained though little is left: numbers at their bounds, another loop, no gain unseen."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.checks.test_loops import HALF, TWICE, recorded
from twin.diagnosis.checks.fit_warnings import far_from_description, unlikely
from twin.diagnosis.diagnosis import Errors
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.polynomial import predict_by_polynomial
from twin.diagnosis.verdict import judge as stage
from twin.diagnosis.verdict.judge import VerdictInputs, verdict
from twin.foundation.parameters import Parameter

CLEAN = VerdictInputs(2.0, 0.05, 0.05, (1.0, 0.1), 0.1, True, False, ())


def test_a_caveat_bars_explained_and_nothing_else() -> None:
    limits = AcceptanceLimits()
    assert verdict(True, CLEAN, limits) == "explained"
    doubtful = replace(CLEAN, caveats=("a number at its bound",))
    assert verdict(True, doubtful, limits) == "partly_explained"
    assert verdict(False, replace(doubtful, after=0.01), limits) == verdict(False, replace(CLEAN, after=0.01), limits) == "noise"


def fitted(*values: float, at_bound: tuple[int, ...] = (), error: float = 0.0) -> Any:
    """A fit of numbers described as 0 +- 1, from -5 to 5."""
    free = [
        SimpleNamespace(effect=None, parameter=Parameter(f"n{k}", 0.0, "m", -5.0, 5.0, "by hand", std=1.0))
        for k in range(len(values))
    ]
    twin = SimpleNamespace(values={f"n{k}": v for k, v in enumerate(values)})
    return SimpleNamespace(
        model=SimpleNamespace(free=free, twin=twin),
        at_bound=lambda: [k in at_bound for k in range(len(values))],
        std=lambda: np.full(len(values), error),
    )


def test_numbers_far_off_and_at_an_end_are_counted_and_the_first_is_named() -> None:
    assert far_from_description(fitted(2.9, -2.9)) == ""
    assert far_from_description(fitted(2.9, 3.1)).startswith("n1 ended at a bound or 3 standard deviations off")
    assert far_from_description(fitted(3.1, 0.0, 5.0, at_bound=(2,))).startswith("2 numbers of the robot (n0, ...) ended")
    assert ["end of its range" in said for said in unlikely(fitted(3.1, 0.0, 5.0, at_bound=(2,)))] == [False, True]


def test_a_number_is_far_off_by_the_errors_of_the_description_and_of_the_fit_together() -> None:
    """sqrt(1^2 + 0.75^2) = 1.25, and three of them are 3.75."""
    assert far_from_description(fitted(3.7, error=0.75)) == ""
    assert far_from_description(fitted(3.8, error=0.75)).startswith("n0")


@pytest.mark.parametrize(("own", "told"), [(HALF, False), (0.9 * HALF, False), (0.0, True), (0.6 * HALF, True)])
def test_a_loop_that_the_twin_has_not_is_told_with_both_sizes(own: float, told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    measured, predicted = (recorded(TWICE, lag=lag, drift=0.0, noise=1e-6) for lag in (HALF, own))
    raw = [m - p for m, p in zip(measured.measured, predicted.measured, strict=True)]
    noise = SimpleNamespace(sigma=np.full(len(measured.outputs), 1e-6))
    context: Any = SimpleNamespace(
        prepared=measured, trials=range(len(raw)), objective=SimpleNamespace(whitener=SimpleNamespace(noise=noise))
    )
    monkeypatch.setattr(stage, "far_from_description", lambda fit: "")
    model: Any = SimpleNamespace(fit=SimpleNamespace(evaluation=SimpleNamespace(raw=raw)))
    said = stage.find_caveats(context, model)
    assert bool(said) is told
    if told:
        assert f"by {2e3 * HALF:.2f} mm" in said[0]
        assert f"by {2e3 * own:.2f} mm in this twin" in said[0]


def test_effects_improve_where_all_groups_together_come_nearer_to_their_floors() -> None:
    def errors(marker: float, tension: float) -> Errors:
        before, floor = {"marker": 2e-3, "tension": 0.2}, {"marker": 1e-3, "tension": 0.1}
        none = dict.fromkeys(before, (0.0, 0.0))
        return Errors(before, before, {"marker": marker, "tension": tension}, floor, none, none)

    assert errors(1e-3, 0.2).improved
    assert errors(2.1e-3, 0.1).improved  # a little worse in one, at the floor in the other
    assert not errors(2e-3, 0.2).improved
    assert not errors(2.5e-3, 0.19).improved
    assert errors(float("nan"), 0.2).improved, "no trial tells"


# ---- the rival without physics ----------------------------------------------------------------------------------------------


def test_a_polynomial_of_the_commands_is_found_to_a_micrometre() -> None:
    """On a trial it has not seen; 20 mm/N moves the tip by 40 mm, and the least ridge leaves a millionth of that."""
    day = recorded(TWICE, lag=0.0, noise=1e-9)
    (found,) = predict_by_polynomial(day, [1, 2], [0])
    assert np.nanmax(np.abs(found - day.measured[0])) < 1e-6


def test_a_loop_is_a_branch_of_the_polynomial() -> None:
    """The sign of the rate is smooth near a turn: all but a quarter of the loop is told."""
    day = recorded(TWICE, noise=1e-9)
    (found,) = predict_by_polynomial(day, [0, 1, 2], [0])
    assert np.nanstd(found - day.measured[0], axis=0)[3] < 0.25 * HALF


def test_what_no_known_trial_measured_is_not_predicted() -> None:
    day = recorded(TWICE, lag=0.0, drift=0.0, noise=1e-9)
    blind = replace(day, measured=tuple(np.where(np.arange(y.shape[1]) == 0, np.nan, y) for y in day.measured))
    (found,) = predict_by_polynomial(blind, [1, 2], [0])
    assert np.isnan(found[:, 0]).all()
    assert np.isfinite(found[:, 1:]).all()


def test_what_one_trial_alone_measured_is_no_reason_to_stop() -> None:
    """Left out in turn, that trial leaves no row of these outputs."""
    day = recorded(TWICE, lag=0.0, drift=0.0, noise=1e-9)
    alone = [np.where((np.arange(y.shape[1]) == 0) & (k != 1), np.nan, y) for k, y in enumerate(day.measured)]
    (found,) = predict_by_polynomial(replace(day, measured=tuple(alone)), [0, 1, 2], [0])
    assert np.isfinite(found).all()
