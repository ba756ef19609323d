"""Parts of shape sensing that have a closed form: the skin at rest, an arc, bands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from tools.benchmarks.shape.baselines.constant_curvature import (
    ERROR_SHARE,
    LEAST_ERROR,
    UNEXPLAINED_STRAIN,
    ConstantCurvatureEstimator,
)
from twin.mechanics.silicone.skin import FACE_RINGS, SKIN_AROUND, SKIN_RINGS, Skin, is_visible, signed_distances
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.band_widening import UNKNOWN_CONTACT_WIDENING, BandWidening, widen_band
from twin.shape.estimators.estimator import TWIN_ERROR_FLOOR, TWIN_ERROR_SHARE, SensorReadings, ShapeEstimates
from twin.shape.predict import apply_band_widening
from twin.shape.training import held_out_evaluation as judge
from twin.shape.training.held_out_evaluation import _band_levels, _strain_domain

FINGER = load("finger")
BODY = FINGER.silicone(FINGER.build())
SKIN = Skin.of(BODY)
ARC = ConstantCurvatureEstimator(Twin.of(FINGER))


def test_the_skin_at_rest_is_the_cone_and_the_tips_face() -> None:
    """Rings of the cone's radius with normals (cos t, sin t, -dr/dz), then rings on the face with normals along the axis."""
    x, n = SKIN.points_and_normals(np.zeros((SKIN.weights.shape[1], 3)))
    np.testing.assert_array_equal(x, SKIN.rest)
    cone, mantle = BODY.cone, SKIN_RINGS * SKIN_AROUND
    assert len(x) == mantle + FACE_RINGS * SKIN_AROUND
    radius, t = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    np.testing.assert_allclose(
        x[:mantle, 2].reshape(SKIN_RINGS, SKIN_AROUND), np.linspace(0, cone.length, SKIN_RINGS)[:, None].repeat(SKIN_AROUND, 1)
    )
    np.testing.assert_allclose(radius[:mantle], cone.radius(x[:mantle, 2]))
    np.testing.assert_allclose(x[mantle:, 2], cone.length)
    rings = cone.tip * 0.98 * (1.0 - np.arange(FACE_RINGS) / FACE_RINGS)
    np.testing.assert_allclose(radius[mantle:].reshape(FACE_RINGS, SKIN_AROUND), rings[:, None].repeat(SKIN_AROUND, 1))
    np.testing.assert_allclose(np.mod(t[:SKIN_AROUND], 2 * np.pi), 2 * np.pi * np.arange(SKIN_AROUND) / SKIN_AROUND, atol=1e-12)
    slope = (cone.radius(cone.length) - cone.radius(0.0)) / cone.length
    out = np.stack([np.cos(t), np.sin(t), np.full(len(t), -slope)], axis=1)[:mantle]
    np.testing.assert_allclose(n[:mantle], out / np.linalg.norm(out, axis=1, keepdims=True), atol=1e-9)
    np.testing.assert_allclose(n[mantle:], np.broadcast_to([0.0, 0.0, 1.0], (FACE_RINGS * SKIN_AROUND, 3)), atol=1e-9)


def test_a_cloud_is_as_far_from_the_skin_as_it_was_put() -> None:
    x, n = SKIN.points_and_normals(np.zeros((SKIN.weights.shape[1], 3)))
    side = np.array([0.8, 0.6, 0.0])
    seen = is_visible(n, np.eye(3), side)
    np.testing.assert_array_equal(seen, n @ side > -0.05)
    inner = seen & (np.abs(np.hypot(x[:, 0], x[:, 1]) - BODY.cone.tip) + BODY.cone.length - x[:, 2] > 2e-3)  # away from the rim
    for off in (3e-4, -3e-4):
        away, nearest = signed_distances(x[inner] + off * n[inner], x, n, seen)
        np.testing.assert_allclose(away, off, atol=1e-6)
        assert seen[nearest].all()


def strains(axial: float, kx: float, ky: float) -> np.ndarray:
    """Of the cords at their mean distance r and azimuth a: axial - r (kx cos a + ky sin a)."""
    middle = BODY.cord_paths.mean(axis=1)
    return axial - middle[:, 0] * kx - middle[:, 1] * ky


def test_an_arc_is_an_arc() -> None:
    """From the clamp on, s away: the axis stretched by 1 + axial, at (1 - cos k s) / k and sin(k s) / k of it, sections rigid; also
    with a cord missing. Bent by less than 1e-6 rad it is straight."""
    rest, clamp, axial = ARC.points.rest, BODY.cone.clamp, 0.03
    s = np.maximum(rest[:, 2] - clamp, 0.0)
    for kx, ky in ((12.0, 0.0), (-6.0, 9.0), (1e-7, 0.0)):
        eps = strains(axial, kx, ky)
        lost = np.where(np.arange(len(eps)) == 1, np.nan, eps)
        found = ARC.estimate(SensorReadings(np.stack([eps, lost]), np.zeros((2, 4))))
        k = np.hypot(kx, ky)
        u = np.array([kx, ky]) / k
        out = rest[:, :2] @ u
        sag = (1.0 + axial) * (1.0 - np.cos(k * s)) / k if k > 1e-3 else 0.0 * s
        place = np.column_stack(
            [
                rest[:, :2] + (sag + out * (np.cos(k * s) - 1.0))[:, None] * u,
                np.minimum(rest[:, 2], clamp) + (1.0 + axial) * np.sin(k * s) / k - out * np.sin(k * s),
            ]
        )
        for moved in found.displacements:
            np.testing.assert_allclose(moved, place - rest, atol=1e-8)
        np.testing.assert_allclose(
            found.std[0], np.hypot(ERROR_SHARE * np.linalg.norm(place - rest, axis=1), LEAST_ERROR), atol=1e-8
        )
        assert not found.outside.any()
    odd = strains(0.0, 5.0, 0.0) + 2.1 * UNEXPLAINED_STRAIN * np.array([1.0, -1.0, 1.0, -1.0])
    assert ARC.estimate(SensorReadings(odd[None], np.zeros((1, 4)))).outside.all()


def shapes(outside: bool, pressed: bool | None = None) -> ShapeEstimates:
    moved = np.zeros((1, 2, 3))
    moved[0, 1, 0] = 0.01
    return ShapeEstimates(moved, np.full((1, 2), 1e-3), np.array([outside]), None if pressed is None else np.array([pressed]))


def test_a_band_is_no_narrower_than_the_twins_own_error() -> None:
    own = np.hypot(TWIN_ERROR_FLOOR, TWIN_ERROR_SHARE * np.array([0.0, 0.01]))
    np.testing.assert_allclose(widen_band(shapes(False), 2.0).std[0], 2e-3)
    np.testing.assert_allclose(widen_band(shapes(False), 1e-3).std[0], own)


def test_who_pushes_decides_the_band() -> None:
    """A free frame has the factor of free motion, unless strains say that something presses: then that of an unknown contact where
    hands are known; a pushed one its own hand's factor; what pushed in no alignment is a stranger, and where it presses outside."""
    law: Any = SimpleNamespace(name=lambda: "arc")
    known = BandWidening({"arc": 1.3}, ("a hand",), {"arc": 0.7})

    def factor(found: ShapeEstimates) -> float:
        return float(found.std[0, 0] / 1e-3)

    for outside, bands, by in ((True, known, UNKNOWN_CONTACT_WIDENING), (False, known, 0.7), (True, BandWidening(), 1.0)):
        assert factor(apply_band_widening(shapes(outside), None, law, bands)) == pytest.approx(by)
    own = apply_band_widening(shapes(False, True), "a hand", law, known)
    assert (factor(own), own.outside.tolist()) == (pytest.approx(1.3), [False])
    for pressed, outside in ((True, True), (False, False), (None, True)):
        other = apply_band_widening(shapes(False, pressed), "an edge", law, known)
        assert (factor(other), other.outside.tolist()) == (pytest.approx(UNKNOWN_CONTACT_WIDENING), [outside])


def test_what_is_known_is_all_but_a_thousandth_of_the_strains() -> None:
    """Of normal ones the square of Mahalanobis' distance is a chi-square with four degrees of freedom."""
    rng = np.random.default_rng(0)
    mix = rng.normal(size=(4, 4))
    data: Any = SimpleNamespace(strain=rng.normal(size=(40_000, 4)) @ mix + 1.0)
    found = _strain_domain(data)
    np.testing.assert_allclose(found["known_inverse"] @ (mix.T @ mix), np.eye(4), atol=0.1)
    assert float(found["known_far"]) == pytest.approx(chi2.ppf(0.999, 4), rel=0.08)  # 40 strains lie beyond it


def test_spreads_are_widened_to_hold_nine_of_ten_at_each_level() -> None:
    """Errors over their spread twice as large on the upper half of the levels, of normal ones: 1.645 and twice that over 1.645."""
    rng = np.random.default_rng(1)
    level = rng.uniform(size=12_000)
    ratio = np.abs(rng.normal(size=(12_000, 3))) * np.where(level < 0.5, 1.0, 2.0)[:, None]
    levels, widen = _band_levels(ratio, level)
    np.testing.assert_allclose(levels, (np.arange(6) + 0.5) / 6, atol=0.02)
    np.testing.assert_allclose(widen, np.where(levels < 0.5, 1.0, 2.0)[:, None].repeat(3, 1), rtol=0.06)  # 2,000 each: 2 %
    few = _band_levels(ratio[:200], level[:200])[1]
    assert np.ptp(few, axis=0).max() == 0.0, "too few: all levels are taken for one"
    assert _band_levels(0.0 * ratio, level)[1].min() == 0.05


@pytest.mark.parametrize(("rest", "least"), [(5e-4, 5e-4), (2e-5, 1e-4)])
def test_an_error_is_a_share_of_the_way_and_a_rest(rest: float, least: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Squared errors of 0.1^2 of a point's way squared and rest^2, found by least squares; the rest is 0.1 mm at least."""
    rng = np.random.default_rng(2)
    size = rng.uniform(0.0, 0.02, size=(100, 3))
    tried = SimpleNamespace(
        displacement=size, error=np.hypot(0.1 * size, rest), std=np.full(size.shape, 1e-3), level=rng.uniform(size=100)
    )
    monkeypatch.setattr(judge, "_held_out_errors", lambda *_: tried)
    monkeypatch.setattr(judge, "_estimator_quantiles", lambda *_: {})
    data: Any = SimpleNamespace(
        held_out=np.ones(100, bool), pushed=np.arange(100) < 50, kind=np.where(np.arange(100) < 50, "hand", "free"),
        point_weights=np.zeros((3, 5)), strain=rng.normal(size=(100, 4)),
    )  # fmt: skip
    law: Any = SimpleNamespace(weights_format=lambda: "made")
    arrays, errors = judge.evaluate_held_out(law, {}, data, FINGER)
    np.testing.assert_allclose(arrays["error"], [0.1, least], rtol=1e-6)
    assert errors["held_out_mm"] == pytest.approx(1e3 * tried.error.mean())
    assert errors["by_kind_mm"]["hand"] == pytest.approx(1e3 * tried.error[:50].mean())
    assert errors["in_band_by_kind"]["free"] == pytest.approx(0.9, abs=0.03)  # as the band was made from these fifty
