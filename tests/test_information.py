"""Information that may be singular: what it tells is solved for, of the scaled problem the least norm; what it cannot is named."""

from __future__ import annotations

import numpy as np

from twin.information import solve, untold

RNG = np.random.default_rng(0)
UNITS = np.array([1e-6, 1.0, 1e5, 30.0])


def test_a_matrix_that_tells_all_is_solved_whatever_the_units() -> None:
    J = RNG.normal(size=(40, 4)) * UNITS
    H, x = J.T @ J, RNG.normal(size=(4, 3)) / UNITS[:, None]
    np.testing.assert_allclose(solve(H, H @ x), x, rtol=1e-9)
    np.testing.assert_allclose(solve(H, H @ x[:, 0]), x[:, 0], rtol=1e-9)
    assert not untold(H).any()


def test_of_two_that_move_the_data_alike_the_sum_is_shared_evenly_in_units_of_their_patterns() -> None:
    """Columns a, 2 a, b: with x = (s, t, u) only s + 2 t is told; each takes half of it in units in which patterns are alike."""
    a, b = RNG.normal(size=40), RNG.normal(size=40)
    J = np.column_stack([a, 2.0 * a, b])
    H = J.T @ J
    np.testing.assert_allclose(solve(H, H @ np.array([3.0, 1.0, -2.0])), [2.5, 1.25, -2.0], rtol=1e-9)
    np.testing.assert_array_equal(untold(H), [True, True, False])


def test_what_moves_nothing_stays_at_zero_and_is_told_by_nothing() -> None:
    J = np.column_stack([RNG.normal(size=40), np.zeros(40)])
    H = J.T @ J
    np.testing.assert_allclose(solve(H, np.array([H[0, 0], 7.0])), [1.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(untold(H), [False, True])


def test_nearly_alike_is_told_until_rounding() -> None:
    """A part of 1e-5 in amplitude is 1e-10 of the information: told. One of 1e-8 is below rounding."""
    a, b = RNG.normal(size=(2, 400))
    for part, lost in ((1e-5, False), (1e-8, True)):
        J = np.column_stack([a, a + part * b])
        np.testing.assert_array_equal(untold(J.T @ J), lost)
