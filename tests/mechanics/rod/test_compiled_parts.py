"""The smallest compiled functions as plain Python, against linear algebra, scipy's rotations and differences of energies."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.foundation.compiled import report_compiling
from twin.mechanics.rod.balance import elastic, hyperelastic, linear


def plain(function: Any) -> Any:
    """What numba compiles, uncompiled."""
    return function.py_func


@pytest.mark.parametrize("n", [1, 3, 4, 5, 8, 11])
def test_factors_solve_what_numpy_solves(n: int) -> None:
    """Blocks of four pivots, whole and not; the matrix need not be symmetric."""
    rng = np.random.default_rng(n)
    A = rng.normal(size=(n, n)) + 2.0 * n * np.eye(n)
    LU, b = A.copy(), rng.normal(size=n)
    x = b.copy()
    assert plain(linear.factorise)(LU)
    np.testing.assert_allclose((np.tril(LU, -1) + np.eye(n)) @ np.triu(LU), A.T, atol=1e-12 * n)
    plain(linear.substitute)(LU, x)
    np.testing.assert_allclose(A @ x, b, atol=1e-12 * n)


@pytest.mark.parametrize("at", range(6))
def test_what_is_no_minimum_has_no_factors(at: int) -> None:
    """A saddle, its negative direction any pivot; a flat direction; what is no number."""
    rng = np.random.default_rng(at)
    L = np.tril(rng.normal(size=(6, 6)), -1) + np.eye(6)
    for value in (-1.0, 0.0, np.nan):
        pivots = np.where(np.arange(6) == at, value, 1.0 + rng.random(6))
        # Where nothing is to be eliminated a zero pivot stays exactly zero.
        assert not plain(linear.factorise)(np.diag(pivots) if value == 0.0 else L @ np.diag(pivots) @ L.T)
    assert plain(linear.factorise)(L @ L.T)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("stretch", [0.7, 1.0, 1.3])
def test_a_body_that_stretches_has_the_forces_of_its_energy(stretch: float, share: float) -> None:
    """w = EA/6 (s^2 + 2/s - 3) + EI/2 b kappa^2 + GJ/2 t tau^2 with b = (1 + 2/s^3)/(3 s), t = 1/s, of the neo-Hookean share."""

    def energy(s: float) -> float:
        return share * (s**2 + 2.0 / s - 3.0) / 6.0 + (1.0 - share) * 0.5 * (s - 1.0) ** 2

    def b(s: float) -> float:
        return 1.0 - share + share * (1.0 + 2.0 / s**3) / (3.0 * s)

    def t(s: float) -> float:
        return 1.0 - share + share / s

    h = 1e-4  # differences good for h^2 times third derivatives of 100 at most; second ones for 1e-8 of fourths of 1000

    def first(f: Any) -> float:
        return (f(stretch + h) - f(stretch - h)) / (2.0 * h)

    def second(f: Any) -> float:
        return (f(stretch + h) - 2.0 * f(stretch) + f(stretch - h)) / h**2

    assert plain(hyperelastic.axial_force)(stretch, share) == pytest.approx((first(energy), second(energy)), abs=2e-6)
    assert plain(hyperelastic.bending_factor)(stretch, share) == pytest.approx((b(stretch), first(b), second(b)), abs=1e-5)
    assert plain(hyperelastic.twisting_factor)(stretch, share) == pytest.approx((t(stretch), first(t), second(t)), abs=1e-5)


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.1, 0.15, 0.2, 0.6, 1.2])
@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_a_set_is_bent_by_the_rotation_vector_of_its_hinges(size: float, hand: float) -> None:
    """Right- and left-handed sets, below and beyond the angle up to which series serve."""
    axes = np.eye(3) if hand > 0.0 else np.eye(3)[[1, 0, 2]]
    for q in np.random.default_rng(0).normal(size=(4, 3)):
        q = size * q / np.linalg.norm(q)

        def phi(q: np.ndarray) -> np.ndarray:
            turned = (
                Rotation.from_rotvec(axes[0] * q[0]) * Rotation.from_rotvec(axes[1] * q[1]) * Rotation.from_rotvec(axes[2] * q[2])
            )
            return axes @ turned.as_rotvec()

        found, D = np.empty(3), np.empty((3, 3))
        plain(elastic.rotation_vector)(q, 0, hand, found, D)
        np.testing.assert_allclose(found, phi(q), atol=1e-9)
        slope = np.stack([(phi(q + e) - phi(q - e)) / 2e-5 for e in 1e-5 * np.eye(3)], axis=1)
        np.testing.assert_allclose(D, slope, atol=1e-8)  # of differences over 1e-5 rad
        shifted = np.concatenate([[9.0], q])
        plain(elastic.rotation_vector)(shifted, 1, hand, found, D)
        np.testing.assert_allclose(found, phi(q), atol=1e-9)


def test_it_is_told_while_anything_compiles_and_not_when_it_is_there() -> None:
    @numba.njit
    def inside(x: float) -> float:
        return 2.0 * x

    @numba.njit
    def outside(x: float) -> float:
        return inside(x) + 1.0

    told: list[bool] = []
    with report_compiling(told.append):
        assert outside(1.0) == 3.0
        assert told[:2] == [True, True], "the inner one compiles within the outer"
        assert told[-2:] == [True, False], "it is over when the outer one is"
        told.clear()
        outside(2.0)
    assert not told
    outside(2)  # an integer: compiled anew
    assert not told
