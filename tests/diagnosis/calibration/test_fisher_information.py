"""Information that may be singular: what it tells is solved for, of the scaled problem the least norm; what it cannot is named."""

from __future__ import annotations

import numpy as np
import pytest

from twin.diagnosis.calibration.fisher_information import scatter, solve, unidentifiable

RNG = np.random.default_rng(0)
UNITS = np.array([1e-6, 1.0, 1e5, 30.0])


def test_a_matrix_that_tells_all_is_solved_whatever_the_units() -> None:
    J = RNG.normal(size=(40, 4)) * UNITS
    H, x = J.T @ J, RNG.normal(size=(4, 3)) / UNITS[:, None]
    np.testing.assert_allclose(solve(H, H @ x), x, rtol=1e-9)
    np.testing.assert_allclose(solve(H, H @ x[:, 0]), x[:, 0], rtol=1e-9)
    assert not unidentifiable(H).any()


def test_of_two_that_move_the_data_alike_the_sum_is_shared_evenly_in_units_of_their_patterns() -> None:
    """Columns a, 2 a, b: with x = (s, t, u) only s + 2 t is told; each takes half of it in units in which patterns are alike."""
    a, b = RNG.normal(size=40), RNG.normal(size=40)
    J = np.column_stack([a, 2.0 * a, b])
    H = J.T @ J
    np.testing.assert_allclose(solve(H, H @ np.array([3.0, 1.0, -2.0])), [2.5, 1.25, -2.0], rtol=1e-9)
    np.testing.assert_array_equal(unidentifiable(H), [True, True, False])


def test_what_moves_nothing_stays_at_zero_and_is_told_by_nothing() -> None:
    J = np.column_stack([RNG.normal(size=40), np.zeros(40)])
    H = J.T @ J
    np.testing.assert_allclose(solve(H, np.array([H[0, 0], 7.0])), [1.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(unidentifiable(H), [False, True])


def test_nearly_alike_is_told_until_rounding() -> None:
    """A part of 1e-5 in amplitude is 1e-10 of the information: told. One of 1e-8 is below rounding."""
    a, b = RNG.normal(size=(2, 400))
    for part, lost in ((1e-5, False), (1e-8, True)):
        J = np.column_stack([a, a + part * b])
        np.testing.assert_array_equal(unidentifiable(J.T @ J), lost)


def _drawn(rng: np.random.Generator, alike: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least squares of a line through 20 parts of 30 samples, true x = 0; errors of size 1, and of size `alike` that go with the
    slope's own column within each part. Returns x (2,), and variances by `scatter` and by the noise alone."""
    J = np.stack([np.ones(600), np.tile(np.linspace(-1.0, 1.0, 30), 20) * np.repeat(rng.uniform(0.5, 2.0, 20), 30)], axis=1)
    y = rng.normal(size=600) + J[:, 1] * np.repeat(alike * rng.normal(size=20), 30)
    H = J.T @ J
    x = solve(H, J.T @ y)
    z = y - J @ x
    parts = [(J[a : a + 30].T @ J[a : a + 30], J[a : a + 30].T @ z[a : a + 30]) for a in range(0, 600, 30)]
    return x, scatter(parts, H), np.diag(np.linalg.inv(H))


def test_where_parts_err_alike_within_the_intervals_still_cover() -> None:
    """2,000 draws: a share of 0.90 is known to 0.007; 20 parts of unlike weight stand for some 15, of which the normal's 90 %
    interval holds 88 %. The noise alone says less than half as much."""
    rng = np.random.default_rng(1)
    drawn = [_drawn(rng, 0.5) for _ in range(2000)]
    x, by_parts, by_noise = (np.stack(d)[:, 1] for d in zip(*drawn, strict=True))
    assert 0.85 < np.mean(np.abs(x) < 1.645 * np.sqrt(by_parts)) < 0.95
    assert np.mean(np.abs(x) < 1.645 * np.sqrt(by_noise)) < 0.6


def test_where_errors_are_the_noise_both_variances_agree_in_the_mean() -> None:
    """Of white errors the correction is exact: a mean of 2,000 draws of some 19 degrees of freedom is good to 0.7 %."""
    rng = np.random.default_rng(2)
    drawn = [_drawn(rng, 0.0) for _ in range(2000)]
    ratio = np.mean([by_parts / by_noise for _, by_parts, by_noise in drawn], axis=0)
    assert ratio == pytest.approx(np.ones(2), abs=0.03)


def test_what_one_part_alone_tells_cannot_disagree() -> None:
    alone, other = np.diag([1.0, 0.0]), np.diag([0.0, 1.0])
    parts = [(alone, np.zeros(2)), (other, np.array([0.0, 3.0])), (other, np.array([0.0, -3.0]))]
    found = scatter(parts, alone + 2.0 * other)
    # Of the second: two parts with half the information each, d = (1/2) 3 sqrt(2) each way.
    assert found == pytest.approx([0.0, 2 * (3.0 / 2.0**0.5) ** 2])
    # A fit ends with a slope of some thousandths of a standard error: no sign that the part disagrees with itself.
    unfinished = [(alone, np.array([1e-3, 0.0])), *parts[1:]]
    assert scatter(unfinished, alone + 2.0 * other) == pytest.approx(found)
