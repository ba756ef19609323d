"""A day of the soft finger, written by the bench's finite elements: the drift in it, and errors of sensors planted on it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from twin import Recording, read
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.diagnosis import Settings
from twin.effects import FitStart
from twin.prediction.evaluate import rms
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

SAMPLES = models_folder() / "finger/samples"
TRUTH = json.loads((SAMPLES / "drift_truth.json").read_text())
RATES = np.array(TRUTH["effects"]["sensor_drift"]["rate_per_s"])
REST = np.array(TRUTH["finger"]["R0_ohm"])
NAMES = [f"sensor_{i}_resistance" for i in (1, 2, 3, 4)]
FEW = ("sweep_1.csv", "sweep_3.csv", "pair_13.csv", "pair_24.csv", "hold_1.csv")
FREQUENT = 2  # every other row is enough for sensors, and half the work


@pytest.fixture(scope="module")
def day() -> Recording:
    whole = read(SAMPLES / "drift")
    trials = tuple(
        replace(t, time=t.time[::FREQUENT], values={n: v[::FREQUENT] for n, v in t.values.items()})
        for t in whole.trials
        if t.name in FEW
    )
    return replace(whole, trials=trials)


def resensed(day: Recording, law) -> Recording:  # type: ignore[no-untyped-def]
    """The day with its drift undone, and each trial's resistances (n, 4) passed through `law(resistance, time)`."""
    trials = []
    for t in day.trials:
        R = np.stack([t.values[n] for n in NAMES], axis=1) / (1.0 + RATES * (t.start + t.time - t.time[0])[:, None])
        trials.append(replace(t, values={**t.values, **dict(zip(NAMES, law(R, t.time).T, strict=True))}))
    return replace(day, trials=tuple(trials))


def fitted(data: Recording, effect: str, start: FitStart) -> tuple[Fit, Fit, dict[str, float], tuple[float, float]]:
    """Base, base + effect, the effect's values, and the RMS of resistances (ohm) before and after."""
    robot = load("finger")
    bench = prepare(data, robot)
    trials = list(range(len(bench.inputs)))
    first, objective, _ = objective_of(bench, Twin.of(robot), trials, Settings(jobs=1))
    base = fit(objective, first, refresh=True)
    found = fit(objective, base.model.with_effect(effect, start.values, start.free, 4), J=base.J)
    values = next(e for e in found.model.twin.effects if e.id == effect).values
    return base, found, values, (rms(bench, base.evaluation.raw, "sensor"), rms(bench, found.evaluation.raw, "sensor"))


def all_four(name: str, value: float) -> FitStart:
    names = tuple(f"{name}_{i}" for i in (1, 2, 3, 4))
    return FitStart(dict.fromkeys(names, value), names)


def test_the_drift_of_the_day_is_found(day: Recording) -> None:
    """To 2 %: the law is the bench's own, and noise alone gives 0.2 %."""
    _, _, values, (before, after) = fitted(day, "sensor_drift", all_four("rate", -1e-6))
    np.testing.assert_allclose([values[f"rate_{i}"] for i in (1, 2, 3, 4)], RATES, rtol=0.02)
    assert after < 0.6 < 5.0 < before  # ohm; the cords' noise is 0.3


def test_a_gain_that_no_built_cord_has_is_found(day: Recording) -> None:
    """One cord reads 2.2 times its strain: kappa's range ends below, and the gain is what is left beyond it."""

    def law(R: np.ndarray, time: np.ndarray) -> np.ndarray:
        gain = np.array([1.0, 2.2, 1.0, 1.0])
        return REST * (1.0 + gain * (np.sqrt(R / REST) - 1.0)) ** 2

    _, _, values, (before, after) = fitted(resensed(day, law), "sensor_gain", FitStart({"gain_2": 1.03}, ("gain_2",)))
    kappa = TRUTH["finger"]["kappa_compression"][1]
    assert 2.2 * kappa / 1.35 * 0.97 < values["gain_2"] < 2.2 * kappa / 0.65
    assert after < 0.6 * before


def test_a_lag_of_all_cords_is_found(day: Recording) -> None:
    """share 0.2 over 3 s, planted by a filter of scipy's; 10 %, as noise passes the filter too."""

    def law(R: np.ndarray, time: np.ndarray) -> np.ndarray:
        a, decay = np.sqrt(R / REST) - 1.0, float(np.exp(-np.median(np.diff(time)) / 3.0))
        late = lfilter([1.0 - decay], [1.0, -decay], a, axis=0, zi=decay * a[:1])[0]
        return REST * (1.0 + a - 0.2 * (a - late)) ** 2

    found = fitted(resensed(day, law), "sensor_hysteresis", FitStart({"share": 0.05, "time": 2.0}, ("share", "time")))
    assert found[2]["share"] == pytest.approx(0.2, rel=0.1)
    assert found[2]["time"] == pytest.approx(3.0, rel=0.1)
    assert found[3][1] < 0.6 < found[3][0]


def test_without_a_cause_an_effect_stays_off(day: Recording) -> None:
    """On the day with its drift undone: within four standard errors of zero, which are of some 1e-7 1/s."""
    plain = resensed(day, lambda R, time: R)
    _, found, values, _ = fitted(plain, "sensor_drift", all_four("rate", 1e-6))
    std = [s for s, f in zip(found.std(), found.model.free, strict=True) if f.effect == "sensor_drift"]
    assert np.all(np.abs([values[f"rate_{i}"] for i in (1, 2, 3, 4)]) < 4.0 * np.array(std))
