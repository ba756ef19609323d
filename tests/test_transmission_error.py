"""A drive whose take-up is not proportional to its command: found where displacements command, and inverted where tensions do."""

from __future__ import annotations

import numpy as np
import pytest

from twin.bench import Bench, prepare
from twin.calibrate import fit
from twin.diagnose import Settings
from twin.diagnose.objective import objective_of
from twin.effects import Signals, named
from twin.measurements import Channel, Recording, Trial
from twin.robots import load
from twin.twin import Twin, readings, report, simulate

NOISE = 1e-4  # m
TRUE = {"turn": 1.2e-2, "sine_2": -4e-4, "cosine_2": 1e-4, "sine_3": 1e-4, "cosine_3": 2e-4}  # m
MOST = 1e-2  # m of cable


def law(**values: float):
    return named("transmission_error")(values, 3)


def sweeps(effects: tuple = ()) -> Bench:
    """Cable 3 drawn in under several lengths of cable 2; cable 1 is never touched."""
    channels = (
        *(Channel(f"tendon_{i}_displacement", "input", "mm", 5e-6) for i in (1, 2, 3)),
        *(Channel(f"marker_1_{a}", "output", "mm", NOISE) for a in "xyz"),
    )
    steps = np.linspace(0.0, MOST, 21)
    robot, trials = load("three_cable"), []
    for k, held in enumerate(np.linspace(0.0, MOST, 8)):
        drawn = {"tendon_1_displacement": 0.0 * steps, "tendon_2_displacement": held + 0.0 * steps, "tendon_3_displacement": steps}
        zero = {f"marker_1_{a}": 0.0 * steps for a in "xyz"}
        trials.append(Trial(f"{k}.csv", np.arange(21.0), drawn | zero, start=100.0 * k))
    blank = Recording("three_cable", "sweeps", "simulation", None, channels, tuple(trials))
    rng, bench, seen = np.random.default_rng(0), prepare(blank, robot), []
    for trial, trace in zip(trials, simulate(Twin(robot, {}, effects), bench), strict=True):
        tip = readings(bench, report(effects, trace.true)) + rng.normal(0.0, NOISE, (21, 3))
        measured = {f"marker_1_{a}": tip[:, j] for j, a in enumerate("xyz")}
        seen.append(Trial(trial.name, trial.time, {**trial.values, **measured}, start=trial.start))
    return prepare(Recording("three_cable", "sweeps", "simulation", None, channels, tuple(seen)), robot)


def test_it_is_recovered_beside_the_robots_own_parameters() -> None:
    bench = sweeps((law(**TRUE),))
    model, objective, _ = objective_of(bench, Twin.of(bench.robot), list(range(len(bench.inputs))), Settings(jobs=1))
    base = fit(objective, model, refresh=True)
    predicted = [t.true for t in base.evaluation.traces]
    begun = list(named("transmission_error").starts(predicted, 3))
    assert not any("1" in name for start in begun for name in start.free), "a drive that never moves shows nothing"
    fits = [fit(objective, base.model.with_effect("transmission_error", s.values, s.free, 3), J=base.J) for s in begun]
    best = min(fits, key=lambda f: f.cost)
    before, after = (float(np.mean(f.z**2)) for f in (base, best))
    assert before > 5.0
    assert after < 1.15, "white noise has a mean square of one"
    found = best.fitted("transmission_error")
    assert found["turn"].value == pytest.approx(TRUE["turn"], rel=0.1)
    assert found["sine_2"].value == pytest.approx(TRUE["sine_2"], rel=0.25)


def signals(displacement: np.ndarray, by_length: bool) -> Signals:
    n, z = len(displacement), np.zeros
    return Signals(z(n), z(n), z((n, 3)), displacement, z((n, 0, 3)), z(n), np.full(3, by_length))


def test_reporting_inverts_driving() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    bad = law(**TRUE)
    taken_up = bad.drive(signals(u, True)).displacement
    np.testing.assert_allclose(bad.sense(signals(taken_up, False)).displacement, u, atol=1e-9)


def test_it_is_sought_only_where_displacements_command() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    assert not list(named("transmission_error").starts([signals(u, False)], 3))
    assert list(named("transmission_error").starts([signals(u, True)], 3))
