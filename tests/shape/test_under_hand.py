"""Sensors under a hand, on a day of the independent finite element bench: a sensor that lies is told by the shapes that were seen,
the others are not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.optimize import least_squares

from twin.effects import effect_class
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, read
from twin.mechanics.silicone import SoftStatics
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin
from twin.report.sections.data.under_hand import describe_hand_check
from twin.robots import load
from twin.robots.named_points import named_points
from twin.shape.estimators.modal import ModalNetwork
from twin.shape.pushed_trials import MarkerFit, PushedTrialCheck, check_pushed_trials
from twin.shape.sensing import sensing_finger

DATA = Path(__file__).parents[1] / "data"
WEAK, LYING = 0.3, 2  # a gain, and of which sensor
TOLD = 2.0  # standard errors of the seen strain: twice is what model and bench may differ by, of some 40 shapes in the mean square


@pytest.fixture(scope="module")
def day() -> Recording:
    return read(DATA / "finger_shape")


@pytest.fixture(scope="module")
def built() -> Twin:
    """The finger with its true sensors, as a calibration would leave it."""
    true, values = json.loads((DATA / "finger_shape_truth.json").read_text())["finger"], {}
    for i in range(4):
        values[f"sensors.resistance_{i + 1}"] = true["R0_ohm"][i]
        values[f"sensors.stretch_{i + 1}"] = true["kappa_stretch"][i]
        values[f"sensors.compression_{i + 1}"] = true["kappa_compression"][i]
    return replace(Twin.of(load("finger")), values={**values, "mounting.angle": np.deg2rad(true["phi_deg"])})


def lying(day: Recording) -> Recording:
    """One sensor shows only a part of its strain: sqrt(R / R0) - 1 of each reading, times WEAK."""
    rest = json.loads((DATA / "finger_shape_truth.json").read_text())["finger"]["R0_ohm"][LYING]
    name, trials = f"sensor_{LYING + 1}_resistance", []
    for t in day.trials:
        seen = rest * (1.0 + WEAK * (np.sqrt(t.values[name] / rest) - 1.0)) ** 2
        trials.append(replace(t, values={**t.values, name: seen}))
    return replace(day, trials=tuple(trials))


def with_markers(day: Recording, twin: Twin, rng: np.random.Generator) -> Recording:
    """The second test, a hand on the finger, filmed: markers where the bench's vertices carry them (displacements between named
    points, smooth over 2 mm), to 0.3 mm, two of them hidden in every frame."""
    true, body = np.load(DATA / "finger_shape_truth.npz"), sensing_finger(twin)
    points, turn = named_points(twin.robot).rest, rotation_about_z(body.turn)
    trial = next(t for t in day.trials if t.name.startswith("test_2"))
    shown = np.full((len(trial.time), len(body.marker_rest), 3), np.nan)
    for t, vertices in zip(true["test_2_time"], true["test_2_vertices"] * float(true["unit_mm"]) * 1e-3, strict=True):
        moved = RBFInterpolator(points, vertices @ turn - points, neighbors=40)(body.marker_rest)
        place = (body.marker_rest + moved) @ turn.T + 3e-4 * rng.normal(size=moved.shape)
        place[rng.choice(len(place), 2, replace=False)] = np.nan
        shown[np.abs(trial.time - t).argmin()] = place
    names = [(f"marker_{m + 1}_{axis}", shown[:, m, k]) for m in range(len(body.marker_rest)) for k, axis in enumerate("xyz")]
    channels = (*day.channels, *(Channel(name, "output", "m", 3e-4) for name, _ in names))
    trials = []
    for t in day.trials:
        if t is trial or "external_contact" not in t.other:
            unseen = np.full(len(t.time), np.nan)
            trials.append(replace(t, values={**t.values, **{name: of if t is trial else unseen for name, of in names}}))
    return replace(day, channels=channels, trials=tuple(trials))


def test_true_sensors_feel_what_clouds_show(day: Recording, built: Twin) -> None:
    found = check_pushed_trials(day, built, built)
    assert found is not None
    assert found.trials == ("align_2.csv",)
    assert found.frames > 20
    assert (found.rms_after < TOLD * found.strain_error).all()
    assert (found.strain_error < 5e-3).all()  # a tenth of the strains of a bent finger: else it would tell nothing


def test_a_lying_sensor_is_told_and_its_gain_answers_for_it(day: Recording, built: Twin) -> None:
    after = replace(built, effects=(effect_class("sensor_gain")({f"gain_{LYING + 1}": WEAK}, 4),))
    found = check_pushed_trials(lying(day), built, after)
    assert found is not None
    honest = np.arange(4) != LYING
    assert found.rms_before[LYING] > 2.0 * TOLD * found.strain_error[LYING]
    assert (found.rms_before[honest] < TOLD * found.strain_error[honest]).all()
    assert (found.rms_after < TOLD * found.strain_error).all()


def test_markers_tell_it_too(day: Recording, built: Twin) -> None:
    filmed = with_markers(day, built, np.random.default_rng(0))
    found, lied = check_pushed_trials(filmed, built, built), check_pushed_trials(lying(filmed), built, built)
    assert found is not None
    assert lied is not None
    assert found.trials == ("test_2.csv",)
    assert (found.rms_after < TOLD * found.strain_error).all()
    assert lied.rms_after[LYING] > 2.0 * TOLD * lied.strain_error[LYING]


def test_the_shape_behind_markers_is_the_most_probable_one(day: Recording, built: Twin) -> None:
    """Of markers with the noise their channels declare, two of them hidden: least squares over markers and habit, its slopes by
    differences, ends at the same coordinates and with the same covariance."""
    rng, net = np.random.default_rng(4), ModalNetwork.of(built.robot)
    fit = MarkerFit(with_markers(day, built, np.random.default_rng(0)), built, SoftStatics(sensing_finger(built)), net)
    true = rng.normal(size=len(fit.basis)) * net.modes.spread
    y = fit.mean + true @ fit.basis + 3e-4 * rng.normal(size=len(fit.mean))
    y[:6] = np.nan
    root = np.linalg.cholesky(net.coupling.inverse).T

    def off(z: np.ndarray) -> np.ndarray:
        return np.concatenate([(y - fit.mean - z @ fit.basis)[6:] / 3e-4, root @ net.coupling(z)[0]])

    best = least_squares(off, np.zeros(len(true)), x_scale=net.modes.spread, xtol=1e-12, ftol=1e-12)
    found, covariance = fit(y)
    sure = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    np.testing.assert_allclose(found, best.x, atol=0.02 * sure.max(), rtol=0)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sure, rtol=0.02)


def test_a_row_with_too_few_markers_shows_no_shape(day: Recording, built: Twin) -> None:
    """Six points are enough, five and two coordinates of a sixth are not."""
    filmed = with_markers(day, built, np.random.default_rng(0))
    fit = MarkerFit(filmed, built, SoftStatics(sensing_finger(built)), ModalNetwork.of(built.robot))
    places = np.full((3, len(fit.prepared.outputs)), np.nan)
    for row, seen in enumerate((18, 17, 30)):
        places[row, fit.columns[:seen]] = fit.mean[:seen]
    alone = replace(fit.prepared.inputs[0], name="three rows")
    fit.prepared = replace(fit.prepared, inputs=(alone,), measured=(places,))
    sensed: Any = SimpleNamespace(name="three rows", time=np.array([0.0, 10.0, 20.0]))
    assert fit.fit_trial(sensed)[1] == [0, 2]


def test_without_a_hand_or_a_view_there_is_nothing_to_say(day: Recording, built: Twin) -> None:
    assert check_pushed_trials(day.select(["align_1", "test_1"]), built, built) is None
    assert check_pushed_trials(day.select(["align_1", "test_2"]), built, built) is None


def test_a_sensor_without_a_column_is_named(day: Recording, built: Twin) -> None:
    gone = "sensor_2_resistance"
    trials = tuple(replace(t, values={n: v for n, v in t.values.items() if n != gone}) for t in day.trials)
    poor = replace(day, channels=tuple(c for c in day.channels if c.name != gone), trials=trials)
    with pytest.raises(DataError, match="no column sensor_2_resistance"):
        check_pushed_trials(poor, built, built)


def test_the_sentence_names_the_sensor_that_differs() -> None:
    seen = np.full(3, 0.0025)
    found = PushedTrialCheck(("hand.csv",), 33, np.array([0.002, 0.0132, np.nan]), np.array([0.002, 0.0013, np.nan]), seen)
    assert describe_hand_check(found) == (
        "Under a hand (33 frames of hand.csv, used in no fit): sensor 2 differs from the measured shapes by 1.32 % strain, "
        "with the effects by 0.13 %; sensor 3 has no readings; the others agree with them to within 0.25 %."
    )
    agreed = replace(found, rms_before=np.full(3, 0.002), rms_after=np.full(3, 0.003))
    assert "all sensors agree with the measured shapes to within 0.25 %" in describe_hand_check(agreed)
