"""Bands of shape estimators: the closed forms behind them, and the widths that clouds ask for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from twin.foundation.errors import DataError
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.band_widening import HAND_SCATTER as DIFFER
from twin.shape.alignment.band_widening import (
    PUSH_DURATION,
    PUSH_SCATTER,
    UNKNOWN_CONTACT_WIDENING,
    BandWidening,
    ShapeReference,
    fit_free_widening,
    fit_widening,
    widen_band,
)
from twin.shape.alignment.report import ALIGNMENT_JSON, CONTACTS_KEY, FREE_KEY, WIDENING_KEY, read_band_widening
from twin.shape.alignment.sensor_fit import StrainSamples, fit_sensors
from twin.shape.estimators.estimator import Estimator, SensorReadings, ShapeEstimates, twin_error
from twin.shape.estimators.learned import interpolate_levels
from twin.shape.estimators.physics import STRENGTH_PRIOR, STRENGTHS, _posterior_variance

FRAMES = 60


def test_what_strains_leave_open_is_the_variance_given_them() -> None:
    """One strain y = 3 a_1 + noise, one point moved by a_2: given y its variance is the mean of s^2, here of draws near that y. 3 %
    is three times the scatter of some 20,000 draws' variance, which has heavy tails."""
    rng, G = np.random.default_rng(0), np.array([[[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]])
    s = rng.choice(STRENGTHS, size=2_000_000, p=STRENGTH_PRIOR / STRENGTH_PRIOR.sum())
    y = 3.0 * s * rng.normal(size=len(s)) + rng.normal(size=len(s))
    for at in (0.0, 4.0):
        drawn = s[np.abs(y - at) < 0.1]
        assert _posterior_variance(G, np.array([[3.0, 0.0]]), np.array([at])) == pytest.approx((drawn**2).mean(), rel=0.03)


def test_what_a_sharp_strain_tells_is_not_left_open() -> None:
    """Of a point that moves with a_1 alone only the strain's own noise is left, 1 / 50^2."""
    G = np.array([[[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]])
    assert _posterior_variance(G, np.array([[50.0, 0.0]]), np.array([40.0])) == pytest.approx(1.0 / 50.0**2, rel=0.01)


def test_a_gross_reading_pulls_an_alignment_no_more_than_one_two_sigmas_off() -> None:
    """Three of 300 resistances read a third too high. Least squares would follow them by 80 sigmas each; held to two each the fit
    moves by (A'A)^-1 A' 2, A the slopes of one sensor's three numbers, to first order."""
    twin, rng, sigma = Twin.of(load("finger")), np.random.default_rng(3), 2e-3
    strain = 0.05 * rng.uniform(-1.0, 1.0, (300, 4))
    resistance = 1000.0 * (1.0 + strain) ** 2
    resistance[[10, 150, 250], 1] *= 1.33
    found = fit_sensors(StrainSamples(strain, resistance, np.tile(sigma**2 * np.eye(4), (300, 1, 1))), twin)
    e = strain[:, 1]
    A = np.stack([np.full(300, 0.5), np.maximum(e, 0.0), np.minimum(e, 0.0)], axis=1) / sigma  # of ln R0, kappa+ and kappa-
    A /= (1.0 + e)[:, None]
    pulled = np.linalg.solve(A.T @ A + np.diag([0.12**-2, 0.2**-2, 0.2**-2]), A[[10, 150, 250]].sum(axis=0))
    moved = np.log(found["sensors.resistance_2"].value / 1000.0)
    assert moved == pytest.approx(2.0 * pulled[0], rel=0.15)
    for other in (1, 3, 4):
        assert found[f"sensors.resistance_{other}"].value == pytest.approx(1000.0, abs=0.1)


def test_widths_between_and_beyond_levels() -> None:
    levels, values = np.array([1.0, 3.0]), np.array([[2.0, 10.0], [4.0, 30.0]])
    got = interpolate_levels(np.array([0.0, 1.0, 2.0, 3.0, 9.0]), levels, values)
    assert got.tolist() == [[2.0, 10.0], [2.0, 10.0], [3.0, 20.0], [4.0, 30.0], [4.0, 30.0]]


class Sure(Estimator):
    """Always the same shape and the same spread."""

    about = "for a test"

    def estimate(self, felt: SensorReadings) -> ShapeEstimates:
        moved = np.full((len(felt), len(self.points.rest), 3), 1e-3)
        return ShapeEstimates(moved, np.hypot(5e-4, twin_error(moved)), np.zeros(len(felt), bool))


def points_off(off: float, cloud: float, frames: int, rng: np.random.Generator) -> tuple[Estimator, ShapeReference]:
    """An estimator and a reference whose points lie apart by `off` times what the band says, along one axis, the reference's own
    scatter beside it: of one axis 1.645 std hold 90 %."""
    law, felt = Sure(Twin.of(load("finger"))), SensorReadings(np.zeros((frames, 4)), np.zeros((frames, 4)))
    found = law.estimate(felt)
    moved = found.displacements.copy()
    moved[..., 0] += off * np.hypot(found.std, cloud) * rng.normal(size=found.std.shape)
    return law, ShapeReference(felt, 16.0, moved, np.full(found.std.shape, cloud))


@pytest.mark.parametrize("off", [0.5, 2.0])
def test_clouds_tell_how_wide_a_band_is_to_be(off: float) -> None:
    """The band is moved towards what the clouds ask for, by the weight that some five pushes have."""
    law, reference = points_off(off, 1e-4, FRAMES, np.random.default_rng(1))
    weight = DIFFER**2 / (DIFFER**2 + PUSH_SCATTER**2 / (16.0 / PUSH_DURATION))
    by = fit_widening(law, [reference])
    assert by == pytest.approx(off**weight, rel=0.02)  # 36,000 points: their 90 % quantile is good to 1 %
    shapes = law.estimate(reference.readings)
    assert np.allclose(widen_band(shapes, by).std, by * shapes.std)


def test_a_band_in_free_motion_is_conformal() -> None:
    """Of n = 19 frames the quantile is 18 / 19, of nine all points, and eight cannot hold 90 %: the band stays as it was."""
    rng = np.random.default_rng(2)
    for frames, level in ((19, 18 / 19), (99, 90 / 99)):
        law, reference = points_off(0.7, 0.0, frames, rng)
        assert fit_free_widening(law, [reference]) == pytest.approx(0.7 * norm.ppf(0.5 + 0.5 * level) / 1.645, rel=0.03)
    law, reference = points_off(0.7, 0.0, 9, rng)
    away = np.linalg.norm(law.estimate(reference.readings).displacements - reference.displacements, axis=2)
    clamped = law.points.rest[:, 2] <= law.body.cone.clamp
    most = (away / law.estimate(reference.readings).std)[:, ~clamped].max() / 1.645
    assert fit_free_widening(law, [reference]) == pytest.approx(most)
    assert fit_free_widening(*_one_fewer(law, reference)) == 1.0


def test_a_shape_by_tendons_lacks_the_twins_own_error() -> None:
    """An estimate that agrees with it altogether may still be off by that error: 0.05 mm, and 1.3 % of a way of 1.73 mm."""
    law, felt = Sure(Twin.of(load("finger"))), SensorReadings(np.zeros((20, 4)), np.zeros((20, 4)), pushed=False)
    moved = law.estimate(felt).displacements
    own = np.hypot(5e-5, 0.013 * np.sqrt(3.0) * 1e-3)
    found = fit_free_widening(law, [ShapeReference(felt, 10.0, moved, np.zeros(moved.shape[:2]))])
    assert found == pytest.approx(own / (1.645 * np.hypot(5e-4, own)))


def _one_fewer(law: Estimator, reference: ShapeReference) -> tuple[Estimator, list[ShapeReference]]:
    readings = SensorReadings(reference.readings.strain[1:], reference.readings.displacement[1:])
    return law, [ShapeReference(readings, 16.0, reference.displacements[1:], reference.std[1:])]


def test_what_pushed_in_no_alignment_is_a_stranger() -> None:
    law = Sure(Twin.of(load("finger")))
    bands = BandWidening({law.name(): 0.7}, ("hand",))
    assert (bands.factor(law, "hand"), bands.factor(law, "two edges"), BandWidening().factor(law, "hand")) == (
        0.7,
        UNKNOWN_CONTACT_WIDENING,
        1.0,
    )


def test_bands_are_read_beside_the_aligned_twin(tmp_path: Path) -> None:
    (tmp_path / ALIGNMENT_JSON).write_text(
        json.dumps({WIDENING_KEY: {"sure": 0.8}, CONTACTS_KEY: ["hand"], FREE_KEY: {"sure": 0.6}})
    )
    assert (
        read_band_widening(str(tmp_path))
        == read_band_widening(str(tmp_path / "twin.toml"))
        == BandWidening({"sure": 0.8}, ("hand",), {"sure": 0.6})
    )
    assert read_band_widening("finger") == BandWidening()
    (tmp_path / ALIGNMENT_JSON).write_text("half a")
    with pytest.raises(DataError, match="twin align"):
        read_band_widening(str(tmp_path))
