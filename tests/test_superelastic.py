"""The superelastic spring: closed forms of helical springs, its published stresses, and what a loop may do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from twin.springs.superelastic import Superelastic, published, stretch


def along(*elongation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    F, xi = stretch(published(), np.concatenate(elongation)[None])
    return F[0], xi[0]


def radius(spring: Superelastic, elongation: float) -> float:
    """Of the narrowing coil (m): the wire's length stays, so 2 pi N R = sqrt(wire^2 - height^2)."""
    wire = np.hypot(spring.length, np.pi * spring.coils * spring.coil_diameter)
    return float(np.sqrt(wire**2 - (spring.length + elongation) ** 2) / (2 * np.pi * spring.coils))


def test_its_first_stiffness_is_a_helical_springs() -> None:
    s = published()
    F, _ = along(np.array([0.0, 1e-6]))
    classical = s.austenite_modulus * s.wire_diameter**4 / (8 * s.coil_diameter**3 * s.coils)
    assert classical == pytest.approx(1406.0, rel=1e-3)  # N/m
    assert F[1] / 1e-6 == pytest.approx(classical, rel=1e-4)


@pytest.mark.parametrize("phase", ["start", "finish"])
def test_it_changes_phase_at_the_published_stresses(phase: str) -> None:
    """Forces at which loading starts and ends the change, from 297 and 772 MPa over sqrt(3), at elongations found by scipy."""
    s = published()
    tau = {"start": 297e6, "finish": 772e6}[phase] / np.sqrt(3)
    xi, G = {"start": (0.0, s.austenite_modulus), "finish": (1.0, s.martensite_modulus)}[phase]
    gamma = tau / G + 0.07 / np.sqrt(3) * xi

    def short(d: float) -> float:
        return 3 / 4 * d * s.wire_diameter / 2 / (2 * np.pi * s.coils * radius(s, d) ** 2) - gamma

    d = brentq(short, 0.0, 0.19)
    F, found = along(np.linspace(0.0, d, 200))
    force = 2 * np.pi * (s.wire_diameter / 2) ** 3 * tau / (3 * radius(s, d))
    assert force == pytest.approx({"start": 34.5, "finish": 100.0}[phase], abs=10.0)  # N: their size
    assert F[-1] == pytest.approx(force, rel=1e-4)  # the published stresses have six digits here
    assert found[-1] == pytest.approx(xi, abs=1e-6)


def test_it_gives_all_its_stretch_back_and_takes_energy() -> None:
    up, down = np.linspace(0.0, 0.1, 2001), np.linspace(0.1, 0.0, 2001)
    F, xi = along(up, down)
    assert F[-1] == 0.0
    assert xi[2000] > 0.9
    assert xi[-1] == 0.0
    lost = float((0.5 * (F[1:] + F[:-1]) * np.diff(np.concatenate([up, down]))).sum())
    work = float((0.5 * (F[1:2001] + F[:2000]) * np.diff(up)).sum())
    assert 0.3 * work < lost < work  # unloading along less than a third of the stress that loading takes


def test_inner_loops_stay_inside_the_outer_one() -> None:
    up, down = np.linspace(0.0, 0.1, 4001), np.linspace(0.1, 0.0, 4001)
    F, _ = along(up, down)
    inner = 0.06 + 0.03 * np.cos(np.linspace(0.0, 40.0, 4000)) * np.linspace(1.0, 0.1, 4000)
    s = along(up, down, np.linspace(0.0, 0.09, 1000), inner)[0][-4000:]
    rounding = 2e-3  # N: 25 um of the grid, at less than 2 N/mm, between straight lines
    assert (s < np.interp(inner, up, F[:4001]) + rounding).all()
    assert (s > np.interp(inner, up, F[4001:][::-1]) - rounding).all()


def test_a_batch_is_its_springs_one_by_one() -> None:
    e = np.random.default_rng(0).uniform(0.0, 0.1, (4, 50))
    F, xi = stretch(published(), e)
    for k in range(4):
        alone = stretch(published(), e[k : k + 1])
        assert np.array_equal(alone[0][0], F[k])
        assert np.array_equal(alone[1][0], xi[k])
