"""Noise that remembers the row before, told from errors that channels share, on residuals of known make."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from twin.diagnosis.noise.autocorrelation import autocorrelation

SIGMA = 2e-4  # m
MARKERS = np.zeros(24, dtype=int)  # all of one group


def coloured(rng: np.random.Generator, rho: float, n: int, m: int) -> np.ndarray:
    """AR(1) noise (n, m) of unit variance, from its stationary start; by a filter, not by the recursion of the other tests."""
    drawn = rng.normal(size=(n, m)) * np.sqrt(1.0 - rho**2)
    drawn[0] /= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], drawn, axis=0))


def shared(rng: np.random.Generator, trials: int, n: int, m: int, memory: float) -> list[np.ndarray]:
    """Three ways in which a body moves, each correlated by `memory` from row to row."""
    shapes = rng.normal(size=(3, m))
    return [coloured(rng, memory, n, 3) @ shapes for _ in range(trials)]


@pytest.mark.parametrize("rho", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("memory", [0.0, 0.6, 0.99])
def test_it_is_found_under_an_error_five_times_as_large(rho: float, memory: float) -> None:
    """16,000 free differences: rho to 0.01 by chance, 0.015 where it is 0.8; of that noise the largest eigenvalues are taken for
    shared too, which costs another 0.015."""
    rng = np.random.default_rng(0)
    residual = [SIGMA * (coloured(rng, rho, 250, 24) + 5.0 * moved) for moved in shared(rng, 3, 250, 24, memory)]
    np.testing.assert_allclose(autocorrelation(residual, MARKERS), rho, rtol=0, atol=0.04)


def test_what_is_slow_in_one_channel_alone_takes_no_part() -> None:
    """Each marker warms up on its own, by twenty sigmas a trial: (20 / 250)^2 / 2 of V_1, four times that of V_2: 0.01 too much."""
    rng = np.random.default_rng(1)
    warm = np.linspace(0.0, 20.0, 250)[:, None] * rng.normal(size=24) / 20.0
    assert (autocorrelation([SIGMA * (rng.normal(size=(250, 24)) + 20.0 * warm) for _ in range(3)], MARKERS) < 0.05).all()


@pytest.mark.parametrize(("memory", "size"), [(0.0, 3.0), (0.9, 3.0), (0.6, 0.5)])
def test_white_noise_stays_white(memory: float, size: float) -> None:
    """One-sided, three standard errors: 1 in 741; of 100 days at most two, under an error of the body with a memory too, also of
    half the noise: left in, that would make rho 0.05, four standard errors."""
    rng = np.random.default_rng(2)
    days = [[rng.normal(size=(200, 24)) + size * moved for moved in shared(rng, 2, 200, 24, memory)] for _ in range(100)]
    assert sum(bool(autocorrelation(day, MARKERS).any()) for day in days) <= 2


def test_five_standard_errors_are_found() -> None:
    """sqrt(2 / (400 * 24)) = 0.0144: found where chance leaves more than three of five, on 98 of 100 days; of 40 on 36 or more but
    for 1 in 1,000. A bar of four would find 34, one of six 6."""
    rng = np.random.default_rng(3)
    days = [[coloured(rng, 0.072, 200, 24) for _ in range(2)] for _ in range(40)]
    assert sum(bool(autocorrelation(day, MARKERS).all()) for day in days) >= 36


def test_each_group_has_its_own() -> None:
    rng = np.random.default_rng(4)
    residual = [np.hstack([coloured(rng, 0.5, 300, 12), 1e3 * coloured(rng, 0.8, 300, 6)]) for _ in range(3)]
    found = autocorrelation(residual, np.array([0] * 12 + [1] * 6))
    np.testing.assert_allclose(found, [0.5] * 12 + [0.8] * 6, rtol=0, atol=0.05)  # 0.02 by chance where it is 0.8, on six channels


def test_three_channels_tell_nothing() -> None:
    rng = np.random.default_rng(5)
    assert (autocorrelation([coloured(rng, 0.5, 300, 3)], np.zeros(3, dtype=int)) == 0.0).all()


def test_channels_that_all_share_tell_nothing() -> None:
    """Five channels and two ways to move: three are left, one too few."""
    rng = np.random.default_rng(6)
    residual = [coloured(rng, 0.5, 300, 5) + 20.0 * coloured(rng, 0.0, 300, 2) @ rng.normal(size=(2, 5))]
    assert (autocorrelation(residual, np.zeros(5, dtype=int)) == 0.0).all()


@pytest.mark.parametrize(("channels", "ways"), [(4, 0), (7, 3)])
def test_four_free_directions_are_enough(channels: int, ways: int) -> None:
    rng = np.random.default_rng(9)
    residual = [coloured(rng, 0.5, 600, channels) + 20.0 * coloured(rng, 0.0, 600, ways) @ rng.normal(size=(ways, channels))]
    found = autocorrelation(residual, np.zeros(channels, dtype=int))
    np.testing.assert_allclose(found, 0.5, rtol=0, atol=0.1)  # 2,400 numbers: 0.03 by chance


def test_missing_samples_are_left_out() -> None:
    """Half a percent here and there, and a marker that was hardly seen: the others tell, for it too."""
    rng = np.random.default_rng(7)
    residual = [coloured(rng, 0.5, 300, 24) for _ in range(3)]
    for r in residual:
        r[rng.random(r.shape) < 0.005] = np.nan
        r[:200, 21:] = np.nan
    np.testing.assert_allclose(autocorrelation(residual, MARKERS), 0.5, rtol=0, atol=0.03)


def test_a_trial_of_two_rows_or_none_at_all_says_nothing() -> None:
    assert (autocorrelation([np.zeros((2, 24)), np.full((9, 24), np.nan)], MARKERS) == 0.0).all()
    assert (autocorrelation([np.zeros((60, 24))], MARKERS) == 0.0).all()  # nothing is left, nothing remembers


def test_a_walk_is_taken_for_ninety_percent() -> None:
    rng = np.random.default_rng(8)
    assert (autocorrelation([np.cumsum(rng.normal(size=(400, 24)), axis=0)], MARKERS) == 0.9).all()
