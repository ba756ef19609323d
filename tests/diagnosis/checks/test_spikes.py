"""Marker samples that stand alone are left out and said; what moves the body is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.recorded_days import half, recorded_day
from twin.diagnosis.checks.spikes import without_spikes
from twin.diagnosis.thresholds import MOST_SPIKES_SHARE, SPIKE_SIZE
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load


@pytest.fixture(scope="module")
def quiet() -> tuple[PreparedRecording, list[np.ndarray]]:
    """A day without effect, markers with 0.25 mm of noise, and what the nominal robot predicts of it."""
    prepared = prepare(recorded_day(None)[0], load("continuum"))
    twin = Twin.of(load("continuum"))
    return prepared, [t.outputs(twin, prepared) for t in simulate(twin, prepared)]


def of_marker(bench: PreparedRecording, m: int) -> list[int]:
    return [j for j, o in enumerate(bench.outputs) if o.group == "marker" and o.index == m]


def missing(bench: PreparedRecording) -> int:
    return sum(int(np.isnan(y).sum()) for y in bench.measured)


def planted(bench: PreparedRecording, trial: int, rows: list[int], columns: list[int], off: np.ndarray) -> PreparedRecording:
    measured = [y.copy() for y in bench.measured]
    measured[trial][np.ix_(rows, columns)] += off
    return replace(bench, measured=tuple(measured))


def test_noise_alone_has_no_spikes(quiet: tuple[PreparedRecording, list[np.ndarray]]) -> None:
    bench, predicted = quiet
    found, words = without_spikes(bench, predicted)
    assert not words
    assert missing(found) == missing(bench)


@pytest.mark.parametrize(("marker", "rows"), [(0, 1), (4, 1), (7, 1), (4, 3)])
def test_a_spike_is_left_out_whole_and_said(quiet: tuple[PreparedRecording, list[np.ndarray]], marker: int, rows: int) -> None:
    bench, predicted = quiet
    columns = of_marker(bench, marker)
    clean = [k for k in range(20, 60) if np.isfinite(bench.measured[0][k - 6 : k + 7]).all()][:1]
    clean = [clean[0] + k for k in range(rows)]
    found, words = without_spikes(planted(bench, 0, clean, columns, np.array([9e-3, -9e-3, 6e-3])), predicted)
    assert np.isnan(found.measured[0][np.ix_(clean, columns)]).all()
    assert missing(found) == missing(bench) + 3 * rows
    assert len(words) == 1
    assert f"{bench.outputs[columns[0]].channel.name.rsplit('_', 1)[0]} {rows})" in words[0]
    far = float(words[0].rsplit("up to ")[1].removesuffix(" mm"))
    assert far == pytest.approx(np.sqrt(9.0**2 + 9.0**2 + 6.0**2), abs=1.5)  # four sigma of a row's noise and its window's, 0.25 mm


def test_a_trial_too_short_to_have_neighbours_is_left_as_it_is_and_one_not_measured_too(
    quiet: tuple[PreparedRecording, list[np.ndarray]],
) -> None:
    bench, predicted = quiet
    short = replace(bench, measured=(bench.measured[0], bench.measured[1][:3]))
    spiky = planted(planted(short, 0, [30], of_marker(bench, 4), np.full(3, 9e-3)), 1, [1], of_marker(bench, 4), np.full(3, 9e-3))
    found, words = without_spikes(spiky, [predicted[0], predicted[1][:3]])
    assert missing(found) == missing(spiky) + 3
    np.testing.assert_array_equal(found.measured[1], spiky.measured[1])
    assert len(words) == 1
    blind = replace(bench, measured=tuple(np.full_like(y, np.nan) for y in bench.measured))
    assert without_spikes(blind, predicted) == (blind, [])


def test_what_moves_the_whole_body_stays(quiet: tuple[PreparedRecording, list[np.ndarray]]) -> None:
    """A jolt of one row, as large at each marker as the robot's own travel there."""
    bench, predicted = quiet
    moved = np.concatenate([y - y.mean(axis=0) for y in predicted])
    jolt = np.where([o.group == "marker" for o in bench.outputs], 3.0 * moved.std(axis=0), 0.0)
    _, words = without_spikes(planted(bench, 0, [30], list(range(len(bench.outputs))), jolt), predicted)
    assert not words


def test_a_marker_that_is_wrong_too_often_is_left_in_and_named(quiet: tuple[PreparedRecording, list[np.ndarray]]) -> None:
    bench, predicted = quiet
    columns, rng, worse = of_marker(bench, 4), np.random.default_rng(1), bench
    for k, y in enumerate(bench.measured):
        rows = np.flatnonzero(rng.random(len(y)) < 2.0 * MOST_SPIKES_SHARE).tolist()
        worse = planted(worse, k, rows, columns, np.array([8e-3, 8e-3, 0.0]))
    found, words = without_spikes(worse, predicted)
    assert missing(found) == missing(worse)
    assert len(words) == 1
    assert "left in" in words[0]


def test_a_delay_of_fast_motion_leaves_no_spikes() -> None:
    recording = half(recorded_day("time_delay", 8.0)[0])
    prepared, twin = prepare(recording, load("continuum")), Twin.of(load("continuum"))
    predicted = [t.outputs(twin, prepared) for t in simulate(twin, prepared)]
    off = np.concatenate([y - p for y, p in zip(prepared.measured, predicted, strict=True)])[:, of_marker(prepared, 7)]
    assert np.nanmax(np.abs(np.diff(off, axis=0))) > SPIKE_SIZE * 2.5e-4, "the delay must jump further than a spike has to"
    assert not without_spikes(prepared, predicted)[1]


def test_a_camera_of_a_tenth_of_a_millimetre_has_no_spikes_where_nothing_moves(
    quiet: tuple[PreparedRecording, list[np.ndarray]],
) -> None:
    """Most rows depart by nothing at all; one step of the camera is still no spike."""
    bench, predicted = quiet
    rng = np.random.default_rng(2)
    still = tuple(p + 1e-4 * (rng.random(p.shape) < 0.02) for p in predicted)
    assert not without_spikes(replace(bench, measured=still), predicted)[1]
