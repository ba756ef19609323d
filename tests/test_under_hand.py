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

from twin.effects import named
from twin.errors import DataError
from twin.factory import named_points
from twin.measurements import Channel, Recording, read
from twin.report.sections.under_hand import words
from twin.robots import load
from twin.shape.modal import Network
from twin.shape.sensing import feeling
from twin.shape.under_hand import MarkerFit, UnderHand, under_hand
from twin.soft import SoftStatics
from twin.soft.statics import turned
from twin.twin import Twin

DATA = Path(__file__).parent / "data"
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
    true, body = np.load(DATA / "finger_shape_truth.npz"), feeling(twin)
    points, turn = named_points(twin.robot).rest, turned(body.turn)
    trial = next(t for t in day.trials if t.name.startswith("test_2"))
    shown = np.full((len(trial.time), len(body.seen), 3), np.nan)
    for t, vertices in zip(true["test_2_time"], true["test_2_vertices"] * float(true["unit_mm"]) * 1e-3, strict=True):
        moved = RBFInterpolator(points, vertices @ turn - points, neighbors=40)(body.seen)
        place = (body.seen + moved) @ turn.T + 3e-4 * rng.normal(size=moved.shape)
        place[rng.choice(len(place), 2, replace=False)] = np.nan
        shown[np.abs(trial.time - t).argmin()] = place
    names = [(f"marker_{m + 1}_{axis}", shown[:, m, k]) for m in range(len(body.seen)) for k, axis in enumerate("xyz")]
    channels = (*day.channels, *(Channel(name, "output", "m", 3e-4) for name, _ in names))
    trials = []
    for t in day.trials:
        if t is trial or "external_contact" not in t.other:
            unseen = np.full(len(t.time), np.nan)
            trials.append(replace(t, values={**t.values, **{name: of if t is trial else unseen for name, of in names}}))
    return replace(day, channels=channels, trials=tuple(trials))


def test_true_sensors_feel_what_clouds_show(day: Recording, built: Twin) -> None:
    found = under_hand(day, built, built)
    assert found is not None
    assert found.trials == ("align_2.csv",)
    assert found.frames > 20
    assert (found.after < TOLD * found.seen).all()
    assert (found.seen < 5e-3).all()  # a tenth of the strains of a bent finger: else it would tell nothing


def test_a_lying_sensor_is_told_and_its_gain_answers_for_it(day: Recording, built: Twin) -> None:
    after = replace(built, effects=(named("sensor_gain")({f"gain_{LYING + 1}": WEAK}, 4),))
    found = under_hand(lying(day), built, after)
    assert found is not None
    honest = np.arange(4) != LYING
    assert found.before[LYING] > 2.0 * TOLD * found.seen[LYING]
    assert (found.before[honest] < TOLD * found.seen[honest]).all()
    assert (found.after < TOLD * found.seen).all()


def test_markers_tell_it_too(day: Recording, built: Twin) -> None:
    filmed = with_markers(day, built, np.random.default_rng(0))
    found, lied = under_hand(filmed, built, built), under_hand(lying(filmed), built, built)
    assert found is not None
    assert lied is not None
    assert found.trials == ("test_2.csv",)
    assert (found.after < TOLD * found.seen).all()
    assert lied.after[LYING] > 2.0 * TOLD * lied.seen[LYING]


def test_the_shape_behind_markers_is_the_most_probable_one(day: Recording, built: Twin) -> None:
    """Of markers with the noise their channels declare, two of them hidden: least squares over markers and habit, its slopes by
    differences, ends at the same coordinates and with the same covariance."""
    rng, net = np.random.default_rng(4), Network.of(built.robot)
    fit = MarkerFit(with_markers(day, built, np.random.default_rng(0)), built, SoftStatics(feeling(built)), net)
    true = rng.normal(size=len(fit.basis)) * net.modes.spread
    y = fit.mean + true @ fit.basis + 3e-4 * rng.normal(size=len(fit.mean))
    y[:6] = np.nan
    root = np.linalg.cholesky(net.habit.inverse).T

    def off(z: np.ndarray) -> np.ndarray:
        return np.concatenate([(y - fit.mean - z @ fit.basis)[6:] / 3e-4, root @ net.habit(z)[0]])

    best = least_squares(off, np.zeros(len(true)), x_scale=net.modes.spread, xtol=1e-12, ftol=1e-12)
    found, covariance = fit(y)
    sure = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    np.testing.assert_allclose(found, best.x, atol=0.02 * sure.max(), rtol=0)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sure, rtol=0.02)


def test_a_row_with_too_few_markers_shows_no_shape(day: Recording, built: Twin) -> None:
    """Six points are enough, five and two coordinates of a sixth are not."""
    filmed = with_markers(day, built, np.random.default_rng(0))
    fit = MarkerFit(filmed, built, SoftStatics(feeling(built)), Network.of(built.robot))
    places = np.full((3, len(fit.bench.outputs)), np.nan)
    for row, seen in enumerate((18, 17, 30)):
        places[row, fit.columns[:seen]] = fit.mean[:seen]
    alone = replace(fit.bench.inputs[0], name="three rows")
    fit.bench = replace(fit.bench, inputs=(alone,), measured=(places,))
    sensed: Any = SimpleNamespace(name="three rows", time=np.array([0.0, 10.0, 20.0]))
    assert fit.trial(sensed)[1] == [0, 2]


def test_without_a_hand_or_a_view_there_is_nothing_to_say(day: Recording, built: Twin) -> None:
    assert under_hand(day.select(["align_1", "test_1"]), built, built) is None
    assert under_hand(day.select(["align_1", "test_2"]), built, built) is None


def test_a_sensor_without_a_column_is_named(day: Recording, built: Twin) -> None:
    gone = "sensor_2_resistance"
    trials = tuple(replace(t, values={n: v for n, v in t.values.items() if n != gone}) for t in day.trials)
    poor = replace(day, channels=tuple(c for c in day.channels if c.name != gone), trials=trials)
    with pytest.raises(DataError, match="no column sensor_2_resistance"):
        under_hand(poor, built, built)


def test_the_sentence_names_the_sensor_that_differs() -> None:
    seen = np.full(3, 0.0025)
    found = UnderHand(("hand.csv",), 33, np.array([0.002, 0.0132, np.nan]), np.array([0.002, 0.0013, np.nan]), seen)
    assert words(found) == (
        "Under a hand (33 frames of hand.csv, fitted to nothing): sensor 2 felt 1.32 % strain off the shapes that were seen, "
        "with the effects 0.13 %; sensor 3 says nothing; the others agree with these to within 0.25 %."
    )
    agreed = replace(found, before=np.full(3, 0.002), after=np.full(3, 0.003))
    assert "all sensors agree with the shapes that were seen to within 0.25 %" in words(agreed)
