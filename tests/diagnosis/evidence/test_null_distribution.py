"""No-effect sets: their quantile, their seed, and that noise alone stays below it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from tests.recorded_days import recorded_day
from twin.diagnosis import Settings
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import StopRule, fit
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.evidence.first_order import dictionary
from twin.diagnosis.evidence.null_distribution import NullDraws, acceptance_limits, draws, quantile
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import LARGEST_SPECTRAL_LINE, LEAST_CONTRIBUTION, LEAST_EVIDENCE, NO_EFFECT_DRAWS, STRUCTURE_AS_BUILT
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load


def test_the_quantile_is_that_of_a_gumbel_law_with_the_same_moments() -> None:
    x = stats.gumbel_r.rvs(loc=3.0, scale=2.0, size=200_000, random_state=1)
    # Moments of 200,000 draws are known to half a per cent.
    assert quantile(x) == pytest.approx(stats.gumbel_r.ppf(0.99, loc=3.0, scale=2.0), rel=0.01)


@pytest.fixture(scope="module")
def calibrated() -> Any:
    robot = load("continuum")
    prepared = prepare(recorded_day(None)[0].select(["slow_1", "pair_3", "circle_1", "circle_2"]), robot)
    start, objective, _ = objective_of(prepared, Twin.of(robot), [0, 1, 2, 3], Settings(jobs=1))
    base = fit(objective, start, refresh=True)
    study = FitContext(objective, Evidence(prepared, [0, 1, 2, 3], objective.whitener.noise.drive))
    return SimpleNamespace(context=study, base=base, patterns=dictionary(objective, base))


def test_the_seed_draws_the_sets_and_nothing_else_does(calibrated: Any) -> None:
    def drawn(seed: int) -> NullDraws:
        return draws(calibrated.context, calibrated.base, calibrated.patterns, seed)

    once, again, other = drawn(3), drawn(3), drawn(4)
    for name in ("gain", "moved", "left", "line"):
        np.testing.assert_array_equal(getattr(once, name), getattr(again, name))
        assert not np.array_equal(getattr(once, name), getattr(other, name))


def test_noise_alone_stays_below_the_thresholds(calibrated: Any) -> None:
    """Thresholds of one seed against the sets of five others: of 120 one in a hundred may exceed a 99 % quantile; and the quantile
    itself, of 24 draws, is known to 0.75 of their spread."""
    bars = acceptance_limits(calibrated.context, calibrated.base, calibrated.patterns, 0)
    d = [draws(calibrated.context, calibrated.base, calibrated.patterns, seed) for seed in range(5)]
    for name, bar, floor in (
        ("gain", bars.accept, LEAST_EVIDENCE), ("moved", bars.material, LEAST_CONTRIBUTION),
        ("left", bars.left, STRUCTURE_AS_BUILT), ("line", bars.line, LARGEST_SPECTRAL_LINE),
    ):  # fmt: skip
        x = np.concatenate([getattr(one, name) for one in d])
        assert len(x) == 5 * NO_EFFECT_DRAWS
        assert np.mean(x > bar) <= 0.05
        assert bar == max(floor, quantile(getattr(d[0], name)))
        assert quantile(d[0].__dict__[name]) > np.quantile(x, 0.9), "a quantile shifted down would lie within the draws"


def test_the_pose_explains_what_is_smooth_in_it_and_no_direction_of_pull(calibrated: Any) -> None:
    """Cubic polynomials of the pulls are of the pose, to rounding. The sign of a pull's rate is not; what the few poses of one pass
    alone share with it is less than half."""
    evidence = calibrated.context.evidence
    phi, m = evidence.phi, evidence.present.shape[1]
    static, direction = (np.flatnonzero(phi.component == c) for c in (0, 1))
    pose = np.outer(phi.matrix[:, static] @ np.linspace(-1.0, 1.0, len(static)), np.ones(m))
    assert evidence.beyond_pose(pose) < 1e-5 * np.std(pose)
    way = np.outer(phi.matrix[:, direction[0]], np.ones(m))
    assert 0.5 < evidence.beyond_pose(pose + way) < 1.0
    assert evidence.beyond_pose(pose + way) == pytest.approx(evidence.beyond_pose(way), rel=1e-4)


def test_a_fit_that_cannot_win_is_not_finished(calibrated: Any) -> None:
    """From parameters a standard deviation off; a cost that no fit beats ends it after a step, one that it may beat does not."""
    objective, base = calibrated.context.objective, calibrated.base
    start = base.model.at(base.model.vector() + 1.0)
    whole, hopeless, hopeful = (
        fit(objective, start, stop=StopRule(1e-9, beat=beat)) for beat in (np.inf, -np.inf, 2.0 * base.cost)
    )
    assert hopeless.cost > whole.cost
    assert hopeful.cost == whole.cost
