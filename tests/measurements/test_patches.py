"""Clouds as something to predict: patches cut by the data alone, the camera's side and the points' scatter read off them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin import read
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.explain.next_experiment import _foreseen
from twin.diagnosis.noise.model import Noise
from twin.foundation.errors import DataError
from twin.measurements import Clouds, Recording, Trial, write
from twin.measurements.patches import (
    MIN_PATCH_POINTS,
    N_BANDS,
    N_NEIGHBOURS,
    N_PATCHES,
    SHARED_NOISE_SHARE,
    camera_direction,
    cut_patches,
    point_scatter,
)
from twin.mechanics.silicone import SoftBody
from twin.mechanics.silicone.skin import GRAZING_COSINE, Skin, expected_patches
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.evaluate import rms
from twin.prediction.prepared import prepare
from twin.prediction.simulate import output_columns, simulate_alone
from twin.prediction.twin import Twin
from twin.robots import load

DAY = Path(__file__).parents[1] / "data/finger_shape"  # of the bench's finite elements; its truth stands beside it
PHI = np.radians(2.675434478296949)
AZIMUTH = 0.3  # rad, of the camera
RADIUS, LENGTH = 7e-3, 0.1
SHIFT = 2e-4  # m, what neighbouring pixels err by alike: of depth cameras


def half(rng: np.random.Generator, n: int, azimuth: float = AZIMUTH, spread: float = np.pi / 2) -> np.ndarray:
    """(n, 3) m of a cylinder, within `spread` of the camera's azimuth."""
    a = azimuth + rng.uniform(-spread, spread, n)
    return np.column_stack([RADIUS * np.cos(a), RADIUS * np.sin(a), rng.uniform(0.0, LENGTH, n)])


def frames(*points: np.ndarray) -> Clouds:
    return Clouds(np.concatenate(points), np.cumsum([0, *map(len, points)]), np.arange(float(len(points))))


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_the_camera_is_half_way_between_the_edges_of_what_it_sees(share: float) -> None:
    """However unevenly the points lie: `share` of them on one half. The one in a hundred left out at either end takes 1.8 degrees
    of each half where both are alike; of nine to one a tenth of the thin half's 80, 9 degrees, half of which moves the middle, and
    those ends scatter by some 3. The mean would be 39 degrees off."""
    rng = np.random.default_rng(0)
    left = half(rng, round(4000 * share), AZIMUTH + 0.25 * np.pi, np.pi / 4)
    points = np.concatenate([left, half(rng, round(4000 * (1.0 - share)), AZIMUTH - 0.25 * np.pi, np.pi / 4)])
    found = camera_direction([frames(points)])
    assert np.arctan2(found[1], found[0]) == pytest.approx(AZIMUTH, abs=np.radians(9.0 if share > 0.5 else 1.5))
    assert np.linalg.norm(found) == pytest.approx(1.0)


def test_points_all_around_are_of_no_side() -> None:
    np.testing.assert_array_equal(camera_direction([frames(half(np.random.default_rng(0), 4000, spread=np.pi))]), np.zeros(3))
    np.testing.assert_array_equal(camera_direction([]), np.zeros(3))


@pytest.mark.parametrize(("spread", "one_sided"), [(1.75, True), (2.05, False)])
def test_more_than_half_around_is_of_a_side_until_little_is_left_out(spread: float, one_sided: bool) -> None:
    """Of 200 and 235 degrees 98 % lie between the edges: 196 and 230, of which 216 are the bound."""
    assert camera_direction([frames(half(np.random.default_rng(0), 4000, spread=spread))]).any() == one_sided


@pytest.mark.parametrize("noise", [2e-4, 6e-4])
def test_the_scatter_of_points_about_a_curved_skin_is_found(noise: float) -> None:
    """Along the normal, some 900 points 2 mm apart on a radius of 7: 10 % covers what a paraboloid leaves of a cylinder and the
    median's bias for 10 degrees of freedom (the chi-square's median is 0.93 of its mean)."""
    rng = np.random.default_rng(1)
    points = half(rng, 900)
    outwards = points * [1, 1, 0] / RADIUS
    assert point_scatter([frames(points + noise * rng.standard_normal((900, 1)) * outwards)]) == pytest.approx(noise, rel=0.1)


def test_the_scatter_is_that_of_the_largest_frame_of_each_trial() -> None:
    """A small noisy frame before and after it has no say; nor has a trial whose largest frame has too few points. All along the
    normal, as above."""
    rng, (noisy, clean) = np.random.default_rng(1), (3e-3, 4e-4)

    def about(n: int, noise: float) -> np.ndarray:
        points = half(rng, n)
        return points + noise * rng.standard_normal((n, 1)) * points * [1, 1, 0] / RADIUS

    day = [frames(about(300, noisy), about(900, clean), about(300, noisy)), frames(about(N_NEIGHBOURS, noisy))]
    assert point_scatter(day) == pytest.approx(clean, rel=0.1)
    assert np.isnan(point_scatter(day[1:]))
    assert np.isfinite(point_scatter([frames(about(N_NEIGHBOURS + 1, noisy))]))


def test_a_patch_whose_points_share_four_errors_is_known_to_half_a_points_scatter() -> None:
    """Neighbouring pixels err alike: in each quarter of a patch, along the axis, all points by one draw. Where the patch stands
    scatters by 0.5 of a draw (median of four: 0.55); 12 patches of 200 clouds tell that to 2 %."""
    rng, camera = np.random.default_rng(7), np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0])
    points = half(rng, 2400)
    true = cut_patches(frames(points), camera)
    across = np.array([-camera[1], camera[0], 0.0])
    outwards = np.tile(np.stack([camera - across, camera + across]) / np.sqrt(2.0), (N_BANDS, 1))
    quarter = np.zeros(len(points), int)
    for j in range(N_PATCHES):
        own = np.flatnonzero(true.patch_of_points[0] == j)
        quarter[own[np.argsort(points[own, 2])]] = 4 * np.arange(len(own)) // len(own)
    off = []
    for _ in range(200):
        error, of = SHIFT * rng.normal(size=(N_PATCHES, 4))[true.patch_of_points[0], quarter], true.patch_of_points[0]
        moved = points + error[:, None] * outwards[of]
        off.append([np.median((moved @ outwards.T)[of == j, j]) for j in range(N_PATCHES)] - true.positions[0])
    at_one_place = np.array([np.std(x) for x in np.array(off).T]) / SHIFT
    assert np.median(at_one_place) == pytest.approx(SHARED_NOISE_SHARE, rel=0.2)


def test_patches_are_bands_in_halves() -> None:
    """Of a cylinder seen straight on: bands of a sixth of its length, each half's median azimuth 45 degrees off the camera's, so
    that along its direction a patch stands at about R cos(0)."""
    points = half(np.random.default_rng(2), 6000)
    camera = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0])
    seen = cut_patches(frames(points), camera)
    of = seen.patch_of_points[0]
    assert np.unique(of).tolist() == list(range(N_PATCHES))
    for band in range(N_BANDS):
        there = points[of // 2 == band]
        # ends of a sixth to the spacing of points, and the radius' share in the distance from the origin at the base
        assert there[:, 2].min() == pytest.approx(band * LENGTH / N_BANDS, abs=2e-3)
    left = np.angle(np.exp(1j * (np.arctan2(points[:, 1], points[:, 0]) - AZIMUTH)))
    assert ((left > 0.02) == (of % 2 == 1))[np.abs(left) > 0.02].all()
    # R cos of what is uniform within 45 degrees of the patch's direction: median R cos(22.5 deg)
    np.testing.assert_allclose(seen.positions[0], RADIUS * np.cos(np.pi / 8), rtol=0.02)


def test_too_few_points_say_nothing() -> None:
    seen = cut_patches(frames(half(np.random.default_rng(3), 30)), np.array([1.0, 0.0, 0.0]))
    assert np.isnan(seen.positions).all()
    assert not len(cut_patches(None, np.array([1.0, 0.0, 0.0])).time)


@pytest.mark.parametrize("missing", [0, 1])
def test_a_patch_of_just_enough_points_says_where_it_is(missing: int) -> None:
    """Six bands of two halves of `FEWEST` points; one fewer in the last."""
    z = np.repeat(np.arange(1.0, N_BANDS + 1), 2 * MIN_PATCH_POINTS) * LENGTH / N_BANDS
    y = np.tile(np.repeat([-RADIUS, RADIUS], MIN_PATCH_POINTS), N_BANDS)
    points = np.column_stack([np.zeros(len(z)), y, z])[: len(z) - missing]
    place = cut_patches(frames(points), np.array([1.0, 0.0, 0.0])).positions[0]
    assert np.isnan(place).tolist() == [False] * (N_PATCHES - 1) + [bool(missing)]
    np.testing.assert_allclose(place[: N_PATCHES - 1], RADIUS / np.sqrt(2.0))


def test_a_frame_stands_on_the_row_next_to_it_and_outside_the_trial_on_none() -> None:
    points = half(np.random.default_rng(4), 2000)
    seen = cut_patches(frames(points, points, points), np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0]))  # at 0, 1 and 2 s
    at = seen.at(np.array([0.1, 0.6, 1.2, 1.6]))
    assert np.isfinite(at).all(axis=1).tolist() == [False, False, True, False]
    assert np.isfinite(seen.at(np.arange(3.0))).all(), "its first and last rows are in the trial"


@pytest.fixture(scope="module")
def finger() -> SoftBody:
    body = load("finger").build()
    assert isinstance(body, SoftBody)
    return body


def skin_seen(body: SoftBody, camera: np.ndarray, moved: np.ndarray, n: int = 3000) -> np.ndarray:
    """(n', 3) m of the cone's own surface (not the twin's mesh of it) that faces the camera, moved by (3,) m."""
    rng, cone = np.random.default_rng(5), body.cone
    a, z = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(0.0, cone.length, n)
    outwards = np.column_stack([np.cos(a), np.sin(a), np.zeros(n)])
    points = cone.radius(z)[:, None] * outwards + np.column_stack([np.zeros((n, 2)), z])
    return points[outwards @ camera > max(GRAZING_COSINE, 0.0)] + moved


@pytest.mark.parametrize("shift", [0.0, 1e-3, -1e-3])
def test_a_skin_predicted_beside_its_points_is_off_by_how_far_it_is(finger: SoftBody, shift: float) -> None:
    """Points moved sideways from the camera: each half is off by `shift` sin(azimuth off the camera's), which has a median of
    sin 45 deg over a half; one half outwards, the other inwards."""
    camera, across = np.array([0.8, 0.6, 0.0]), np.array([-0.6, 0.8, 0.0])
    points = skin_seen(finger, camera, shift * across)
    seen, time = cut_patches(frames(points, points), camera), np.arange(2.0)
    should = expected_patches(Skin.of(finger), seen, time, np.zeros((2, finger.lattice.n_free, 3)), np.eye(3))
    off = (seen.positions - should)[0].reshape(N_BANDS, 2)
    # 0.06 mm: the mesh of the skin is 2 % coarse; 15 %: nearest places slide by the shift itself along a radius of 9 to 15 mm
    for half_, sign in ((0, -1.0), (1, 1.0)):
        np.testing.assert_allclose(off[:, half_], sign * shift * np.sin(np.pi / 4), rtol=0.15, atol=6e-5)


def test_a_turned_finger_is_looked_at_from_where_the_camera_is(finger: SoftBody) -> None:
    """A cone looks the same however it is mounted: the same points stand as well on a finger turned by 40 degrees."""
    camera = np.array([1.0, 0.0, 0.0])
    seen, time = cut_patches(frames(skin_seen(finger, camera, np.zeros(3))), camera), np.arange(2.0)
    should = expected_patches(Skin.of(finger), seen, time, np.zeros((2, finger.lattice.n_free, 3)), rotation_about_z(0.7))
    np.testing.assert_allclose(should[0], seen.positions[0], atol=6e-5)


@pytest.fixture(scope="module")
def day() -> Recording:
    whole = read(DAY)
    return replace(whole, trials=tuple(t for t in whole.trials if t.clouds is not None and not t.other))


def angle(data: Recording) -> tuple[float, float, float]:
    """The mounting angle (rad) fitted to a day without markers, the error of its skin before and after (m)."""
    robot = load("finger")
    bench = prepare(data, robot)
    every = list(range(len(bench.inputs)))
    first, objective, _ = objective_of(bench, Twin.of(robot), every, Settings(jobs=1))
    found = fit(objective, first, refresh=True)
    nominal = [bench.measured[k] - y for k, y in zip(every, objective.predict(Twin.of(robot))[1], strict=True)]
    before, after = rms(bench, nominal, "skin"), rms(bench, found.evaluation.raw, "skin")
    return found.model.twin.values["mounting.angle"], before, after


def test_clouds_alone_tell_how_a_finger_is_mounted(day: Recording) -> None:
    """By the finite elements' clouds, turned by 4 degrees more, no marker beside them: to 0.5 degrees (patches of 0.2 mm on a tip
    that travels 30 mm). As described the finger is off by 6.7 degrees."""
    more = np.radians(4.0)
    trials = []
    for t in day.trials:
        assert t.clouds is not None
        clouds = Clouds(t.clouds.points @ rotation_about_z(more).T, t.clouds.offsets, t.clouds.time)
        some = slice(0, len(t.time) // 2)
        trials.append(replace(t, time=t.time[some], values={n: v[some] for n, v in t.values.items()}, clouds=clouds))
    found, before, after = angle(replace(day, trials=tuple(trials)))
    assert found == pytest.approx(PHI + more, abs=np.radians(0.5))
    assert after < 1.5e-4 < 2e-4 < before


def test_beside_markers_clouds_are_not_fitted(day: Recording) -> None:
    robot = load("finger")
    assert any(o.group == "skin" for o in prepare(day, robot).outputs)
    trial = day.trials[0]
    channels = (*day.channels, *(type(day.channels[0])(f"tip_{a}", "output", "mm", 2e-4) for a in "xyz"))
    seen = {**trial.values, **{f"tip_{a}": np.zeros(len(trial.time)) for a in "xyz"}}
    marked = replace(day, channels=channels, trials=(replace(trial, values=seen),))
    assert not any(o.group == "skin" for o in prepare(marked, robot).outputs)


def test_clouds_from_all_around_are_said_to_be_left_out(day: Recording) -> None:
    rng = np.random.default_rng(6)
    around = [half(rng, 500, spread=np.pi) for _ in day.trials[0].clouds.time]  # type: ignore[union-attr]
    bench = prepare(replace(day, trials=(replace(day.trials[0], clouds=replaced(day.trials[0], around)),)), load("finger"))
    assert not any(o.group == "skin" for o in bench.outputs)
    assert any("do not show one side" in notice for notice in bench.notices)


def replaced(trial: Trial, points: list[np.ndarray]) -> Clouds:
    assert trial.clouds is not None
    return Clouds(np.concatenate(points), np.cumsum([0, *map(len, points)]), trial.clouds.time)


def test_no_file_has_patches_as_a_channel(day: Recording, tmp_path: Path) -> None:
    write(day, tmp_path / "set")
    toml = tmp_path / "set/measurements.toml"
    toml.write_text(toml.read_text().replace('"sensor_1_resistance"', '"skin_1"').replace('"ohm"', '"mm"', 1))
    with pytest.raises(DataError, match="skin_1 is made from point clouds"):
        read(tmp_path / "set")


def test_an_experiment_to_come_shows_the_tip_in_place_of_patches(day: Recording) -> None:
    bench = prepare(day, load("finger"))
    n = len(bench.outputs)
    noise = Noise(np.linspace(1e-4, 2e-4, n), np.zeros(4), np.linspace(0.0, 0.5, n), "made")
    ahead, then = _foreseen(bench, noise)
    assert [o.channel.name for o in ahead.outputs] == [f"sensor_{i}_resistance" for i in (1, 2, 3, 4)] + ["tip_x", "tip_y", "tip_z"]
    np.testing.assert_array_equal(then.sigma, [*noise.sigma[:4], *3 * [noise.sigma[-1]]])  # that of the worst patch
    np.testing.assert_array_equal(then.rho, [*noise.rho[:4], 0.0, 0.0, 0.0])
    short = replace(ahead.inputs[0], clouds=None)
    trace = simulate_alone(Twin.of("finger"), short)
    np.testing.assert_array_equal(output_columns(ahead, trace.true)[:, 4:], trace.true.markers[:, -1])
    assert _foreseen(ahead, then) == (ahead, then)
