"""Shape sensing on the independent bench: the error, its error bar, and a payload nobody declared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from tests.recorded_days import half, recorded_day
from twin.body import Loads
from twin.diagnosis import Settings
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import fit
from twin.effects import effect_class
from twin.foundation.errors import TwinError
from twin.prediction.kinematics import LoadedRobot
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape import TensionShapeFilter
from twin.shape.estimators.tension_shape import UNMODELLED_TRAVEL


@pytest.fixture(scope="module")
def rubbing() -> tuple[Twin, PreparedRecording]:
    """A bench day with friction and tendon displacements, and the twin fitted to it with all payloads declared."""
    recording, _ = recorded_day("tendon_friction", design="sideways", displacement=True)
    prepared = prepare(half(recording), load("continuum"))
    start, objective, _ = objective_of(prepared, Twin.of(load("continuum")), list(range(len(prepared.inputs))), Settings())
    base = fit(objective, start, refresh=True)
    return fit(objective, base.model.with_effect("tendon_friction", {"mu": 0.1}, ("mu", "presliding"), 3)).model.twin, prepared


def columns(bench: PreparedRecording, group: str) -> list[int]:
    return [j for j, o in enumerate(bench.outputs) if o.group == group]


def sensed(twin: Twin, bench: PreparedRecording, k: int, guess: float) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Errors and error bars (n, 24) m of trial k sensed with a guessed payload, and the payload found last."""
    inputs, measured = bench.inputs[k], bench.measured[k]
    sense = TensionShapeFilter(twin, replace(inputs.loads, payload=guess), {"payload": 0.01, "tendon_friction.mu": 0.02})
    seen, markers = columns(bench, "displacement"), columns(bench, "marker")
    got = [sense.update(T, y[seen] if seen else None) for T, y in zip(inputs.command, measured, strict=True)]
    error = np.array([g.markers[:8].ravel() for g in got]) - measured[:, markers]
    return error, np.array([g.std[:8].ravel() for g in got]), got[-1].parameters["payload"]


def test_unknown_payloads_are_estimated_along_and_the_shape_is_right(rubbing: tuple[Twin, PreparedRecording]) -> None:
    """0, 10 and 20 g, each sensed from a guess of 10 +- 10 g, friction known to 0.02: mean error at most 1 mm, noise and all."""
    twin, bench = rubbing
    for k in (next(k for k, i in enumerate(bench.inputs) if i.loads.payload == p) for p in (0.0, 0.01, 0.02)):
        error, bar, (payload, std) = sensed(twin, bench, k, 0.01)
        distance = np.linalg.norm(error.reshape(-1, 8, 3), axis=2)
        assert np.nanmean(distance) < 1e-3
        assert abs(payload - bench.inputs[k].loads.payload) < 1e-3  # kg: what 0.1 mm of a tendon's travel is worth
        assert std < 5e-4
        spread = np.sqrt(np.nanmean((error / np.hypot(bar, 2.5e-4)) ** 2))
        assert 0.7 < spread < 1.5  # the error bar and the camera's noise make up the error


def test_without_displacements_the_error_bar_says_what_is_not_known(rubbing: tuple[Twin, PreparedRecording]) -> None:
    """Ten grams too many, which tensions alone cannot tell: a centimetre off, and the bar is as long."""
    twin, bench = rubbing
    blind = replace(bench, outputs=tuple(o if o.group == "marker" else replace(o, group="other") for o in bench.outputs))
    k = next(k for k, i in enumerate(bench.inputs) if i.loads.payload == 0.0)
    error, bar, (payload, std) = sensed(twin, blind, k, 0.01)
    assert (payload, std) == pytest.approx((0.01, 0.01))
    assert np.sqrt(np.nanmean(error[:, 21:] ** 2)) > 3e-3
    assert 0.5 < np.sqrt(np.nanmean(error**2) / np.mean(bar**2)) < 2.0


def test_the_error_bar_grows_with_doubt_and_with_load() -> None:
    twin = Twin(load("continuum"), {}, (effect_class("tendon_friction")({"mu": 0.1}, 3),))
    loads = Loads(np.array([0.0, 0.0, 9.81]))

    def tip_bar(tension: float, doubt: float) -> float:
        return float(
            np.linalg.norm(TensionShapeFilter(twin, loads, {"tendon_friction.mu": doubt}).update(tension * np.eye(3)[0]).std[7])
        )

    assert tip_bar(1.0, 0.02) < tip_bar(3.0, 0.02) < tip_bar(3.0, 0.05)


def test_a_doubt_about_nothing_is_refused() -> None:
    with pytest.raises(TwinError, match=r"no number 'tendon_friction.mu' in this twin; doubts may be about payload, backbone"):
        TensionShapeFilter(Twin(load("continuum")), Loads(np.zeros(3)), {"tendon_friction.mu": 0.1})


def test_the_error_bar_is_made_of_doubts_and_load_cells() -> None:
    """Of load cells alone: noise times the markers' change per newton of each tendon, by central differences of the robot itself.
    Of a doubtful payload alone: how far off the markers of a robot with so much more are. Of both: the root of the squares' sum."""
    twin, tension = Twin(load("continuum")), np.array([1.6, 0.5, 0.1])  # N, all taut: no tendon pushes, a slack one has one side
    loads = Loads(np.array([0.0, -9.81, 0.0]), payload=0.01)

    def bar(noise: float, doubt: float) -> np.ndarray:
        return TensionShapeFilter(twin, loads, {"payload": doubt}, tension_noise=noise).update(tension).std

    def markers(more: np.ndarray | float = 0.0, payload: float = 0.0) -> np.ndarray:
        return LoadedRobot(twin, replace(loads, payload=0.01 + payload)).pull(tension + more).markers

    slopes = np.array([(markers(0.01 * e) - markers(-0.01 * e)) / 0.02 for e in np.eye(3)])
    cells = 0.05 * np.sqrt((slopes**2).sum(axis=0))
    doubts = np.abs(markers(payload=0.005) - markers())
    np.testing.assert_allclose(bar(0.05, 1e-9), cells, rtol=1e-3, atol=2e-7)  # m: curvature of 0.01 N; solves within 1e-7 rad
    np.testing.assert_allclose(bar(1e-9, 0.005), doubts, atol=5e-7)
    np.testing.assert_allclose(bar(0.05, 0.005), np.hypot(cells, doubts), rtol=1e-3, atol=5e-7)


def test_the_filter_finds_the_payload_that_made_its_readings() -> None:
    """10 +- 10 g believed, 24 g there: 1.4 standard deviations, so that its robots are given what it finds on the way."""
    twin, loads = Twin(load("continuum")), Loads(np.array([0.0, -9.81, 0.0]), payload=0.01)
    built = LoadedRobot(twin, replace(loads, payload=0.024))
    sense = TensionShapeFilter(twin, loads, {"payload": 0.01})
    pulls = np.array([[1.6, 0.5, 0.1], [2.0, 0.3, 0.2], [0.4, 1.8, 0.2], [0.3, 0.4, 2.2]])
    for tension in pulls:
        true = built.pull(tension)
        found = sense.update(tension, true.displacement)
    assert found.parameters["payload"][0] == pytest.approx(0.024, abs=3e-4)  # 54 um of a tendon's travel is worth 0.5 g
    np.testing.assert_allclose(found.markers, true.markers, atol=3e-4)
    assert sense.robot.loads.payload + 0.0 == 0.01, "as given"
    assert sense.centre[0] == pytest.approx(0.024, abs=0.25 * 0.01), "and carried by the robots"
    lead = sense.perturbed_robots[0].shape().markers - sense.robot.shape().markers
    heavier = LoadedRobot(twin, replace(loads, payload=sense.centre[0] + 0.01))
    plain = LoadedRobot(twin, replace(loads, payload=sense.centre[0]))
    for tension in pulls:
        told = heavier.pull(tension).markers - plain.pull(tension).markers
    np.testing.assert_allclose(lead, told, atol=2e-6)  # two solves within 1e-7 rad; no friction to remember the way


@pytest.mark.parametrize("there", [0.022, 0.03])
def test_between_belief_and_reading_the_filter_finds_the_likeliest_payload(there: float) -> None:
    """By displacements good for a millimetre, of which 10 g are worth about as much: the least of the sum of both squares."""
    twin, loads = Twin(load("continuum")), Loads(np.array([0.0, -9.81, 0.0]), payload=0.01)
    tension, noise = np.array([1.6, 0.5, 0.1]), float(np.hypot(1e-3, UNMODELLED_TRAVEL))

    def shown(payload: float) -> np.ndarray:
        return LoadedRobot(twin, replace(loads, payload=payload)).pull(tension).displacement

    measured = shown(there)

    def unlikely(x: float) -> float:
        return x**2 + float((((measured - shown(0.01 + 0.01 * x)) / noise) ** 2).sum())

    best = minimize_scalar(unlikely, bounds=(-1.0, 3.0), method="bounded", options={"xatol": 1e-4}).x
    assert 0.2 < abs(best) < 0.9 * abs(there - 0.01) / 0.01, "neither alone decides"
    found = (
        TensionShapeFilter(twin, loads, {"payload": 0.01}, displacement_noise=1e-3)
        .update(tension, measured)
        .parameters["payload"][0]
    )
    assert found == pytest.approx(0.01 + 0.01 * best, abs=8e-4)  # kg: slopes are taken over a standard deviation, 10 g


def test_without_a_doubt_it_is_the_robot_itself() -> None:
    """And the error bar that of its load cells, displacements or none."""
    twin, loads = Twin(load("continuum")), Loads(np.array([0.0, -9.81, 0.0]))
    tension, sense = np.array([1.6, 0.5, 0.1]), TensionShapeFilter(twin, loads, {})
    told = LoadedRobot(twin, loads).pull(tension)
    for displacement in (None, told.displacement + 1e-3):
        seen = sense.update(tension, displacement)
        np.testing.assert_allclose(seen.markers, told.markers, atol=1e-9)
        assert seen.std.max() > 1e-6
        assert seen.parameters == {}
