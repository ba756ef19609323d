"""The path of a command between its rows, against paths that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from twin.diagnosis.search.command_spline import smooth_command

NOISE = 0.01


def logged(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows (uneven by 15 %), what is logged, moments between, and what three commands were then."""
    time = np.linspace(0.0, 9.0, 80)
    time[1:-1] += rng.uniform(-0.15, 0.15, 78) * time[1]
    fine = np.linspace(0.0, 9.0, 901)
    if kind == "smooth":
        true = np.stack([2.0 - 2.0 * np.cos(1.3 * fine + a) for a in range(3)], axis=1)
    else:
        knots = np.sort(rng.uniform(0.0, 9.0, 14))
        true = np.stack([np.interp(fine, knots, level) for level in np.repeat(rng.uniform(0.0, 4.0, (3, 7)), 2, axis=1)], axis=1)
    rows = np.stack([np.interp(time, fine, c) for c in true.T], axis=1)
    return time, rows + NOISE * rng.standard_normal(rows.shape), fine, true


def at(fine: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(fine, time, v) for v in values.T], axis=1)


def test_a_smooth_command_is_known_better_than_it_is_read() -> None:
    """Its error between rows is below the reading's noise; straight lines between readings are off by more than that noise."""
    rng = np.random.default_rng(1)
    time, rows, fine, true = logged("smooth", rng)
    found = smooth_command(time, rows, NOISE)
    error = np.sqrt(np.mean((at(fine, found.time, found.mean) - true) ** 2))
    assert error < 0.8 * NOISE
    assert np.sqrt(np.mean((at(fine, time, rows) - true) ** 2)) > 0.8 * NOISE


@pytest.mark.parametrize(("kind", "least"), [("smooth", 0.85), ("corners", 0.75)])
def test_the_true_path_is_where_it_is_said_to_be(kind: str, least: float) -> None:
    """90 % intervals over eight logs. The looseness is found from these rows too, which costs some of their
    cover; a true corner is no draw of any spline."""
    inside = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        time, rows, fine, true = logged(kind, rng)
        found = smooth_command(time, rows, NOISE)
        true = at(found.time, fine, true)
        inside.append(np.abs(true - found.mean) < norm.ppf(0.95) * np.sqrt(found.variance)[:, None])
    assert least < np.mean(inside) < 0.99


def test_readings_without_noise_are_kept() -> None:
    """Down to a ten-thousandth of the range, and a command that does not move at all is fine."""
    time = np.linspace(0.0, 2.0, 21)
    rows = np.stack([np.sin(3.0 * time), np.zeros(21), time], axis=1)
    found = smooth_command(time, rows, 0.0)
    assert np.abs(found.mean[::4] - rows).max() < 5e-4
    assert np.isfinite(found.variance).all()
    still = smooth_command(time, np.zeros((21, 3)), 0.0)
    assert np.abs(still.mean).max() < 1e-9


def test_a_jump_among_still_rows_leaves_no_variance_below_zero() -> None:
    """Looseness that differs by ten decades from one interval to the next cost a covariance by differences all its digits."""
    rng = np.random.default_rng(3)
    for n in (40, 75, 160):
        time = np.cumsum(rng.uniform(0.3, 0.6, n))
        level = np.repeat([0.4, 5.0, 2.5], [n // 3, n // 2 - n // 3, n - n // 2])
        rows = level[:, None] + 1e-4 * rng.standard_normal((n, 3))
        found = smooth_command(time, rows, 5e-4)
        assert np.all(found.variance > 0.0)
