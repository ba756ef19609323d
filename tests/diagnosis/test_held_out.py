"""The sealed trials' errors: their interval, and trials a twin has no equilibrium for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench
from tools.simulators.rod.design import bench_day
from twin.diagnosis import held_out as seal
from twin.diagnosis.calibration.first_calibration import noise_under
from twin.diagnosis.conclusion import Conclusion
from twin.diagnosis.held_out import HeldOut, interval
from twin.diagnosis.noise.estimate import repeats
from twin.effects import effect_class
from twin.foundation.errors import SolveError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import SolveOptions, simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")


def test_the_interval_covers_as_often_as_it_says() -> None:
    """95 % of 400 intervals of the RMS of white noise in eight trials of 100: 378 to 392 by chance, and a bootstrap over 80 blocks
    is some 2 % short. One cut at the quartiles would cover half."""
    covered = 0
    for seed in range(400):
        squares = np.random.default_rng(seed).normal(size=(8, 100)) ** 2
        low, high = interval(list(squares), seed)
        covered += low < 1.0 < high
    assert 0.90 < covered / 400 < 0.98


def test_blocks_keep_neighbours_together() -> None:
    """Errors alike over ten samples are known ten times worse than as many independent ones."""
    rng = np.random.default_rng(0)
    alike, white = np.repeat(rng.normal(size=(8, 10)), 10, axis=1) ** 2, rng.normal(size=(8, 100)) ** 2
    width = [np.subtract(*interval(list(x), 0)[::-1]) for x in (alike, white)]
    assert 2.0 < width[0] / width[1] < 5.0  # sqrt(10) = 3.2, from 80 blocks known to some 15 %


@pytest.mark.parametrize(("length", "alike"), [(12, 12), (19, 19), (20, 10), (40, 10)])
def test_rows_that_err_alike_are_one_draw(length: int, alike: int) -> None:
    """Trials that err alike throughout, shorter than two blocks, or ten rows at a time: known as well as one row for each of those,
    to the last digit. Half as many blocks would be sqrt(2) wider, twice as many as much narrower."""
    draws = np.random.default_rng(2).normal(size=80) ** 2
    rows = np.repeat(draws, alike).reshape(-1, length)
    assert interval(list(rows), 0) == pytest.approx(interval([np.array([x]) for x in draws], 0), rel=1e-12)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> HeldOut:
    """Trials 1 and 3 sealed; the final twin, "after", has no equilibrium on trial 3. Every twin is 1 mm off in x."""
    day: PreparedRecording = bench(bench_day("default", np.random.default_rng(0)))

    def simulate(twin: Any, bench: PreparedRecording, trials: Any) -> list[Any]:
        if twin.name == "after" and 3 in trials:
            raise SolveError("no equilibrium")
        return [SimpleNamespace(outputs=lambda twin, bench, k=k: bench.measured[k] - off) for k in trials]

    monkeypatch.setattr(seal, "simulate", simulate)
    off = np.array([1e-3 if o.axis == 0 else 0.0 for o in day.outputs])
    monkeypatch.setattr(seal, "sensitivity", lambda bench, trials, twin, predicted: [np.array([trials[0]])])
    base, final = (SimpleNamespace(name=n, effects=()) for n in ("base", "after"))
    noise = SimpleNamespace(floor=lambda bench, G: {"marker": 4e-4 * float(G[0].max())})
    monkeypatch.setattr(seal, "predict_by_polynomial", lambda bench, known, wanted: [bench.measured[k] - 3.0 * off for k in wanted])
    context = SimpleNamespace(prepared=day, trials=[0, 2])
    conclusion: Any = SimpleNamespace(base=base, final=final, noise=lambda: noise, context=context)
    return HeldOut.of(day, [y - 2.0 * off for y in day.measured], [(conclusion, [1, 3])])


def test_a_sealed_trial_without_equilibrium_is_named_and_counts_for_no_stage(opened: HeldOut) -> None:
    errors = opened.errors(0)
    assert errors.lost == (3,)
    assert errors.nominal["marker"] == pytest.approx(2e-3)
    assert errors.calibrated["marker"] == pytest.approx(1e-3)
    assert errors.without_physics["marker"] == pytest.approx(3e-3)
    assert errors.after["marker"] == pytest.approx(1e-3)
    assert errors.floor == {"marker": pytest.approx(4e-4)}
    assert np.isnan(opened.error(lambda c: c.final))
    assert opened.error(lambda c: c.base) == pytest.approx(1e-3)


def test_a_trial_off_by_more_than_noise_and_the_description_is_missed(opened: HeldOut) -> None:
    """1 mm in x with a floor of 0.4 mm; a description good for 0.25 mm a coordinate allows 2 hypot(0.4, 0.43) = 1.2 mm."""

    def missed(accuracy: float) -> list[tuple[int, str]]:
        declared = replace(opened.prepared, robot=replace(opened.prepared.robot, accuracy=accuracy))
        return [(m.trial, m.group) for m in replace(opened, prepared=declared).errors(0).missed]

    assert missed(0.0) == [(1, "marker")]
    assert missed(0.25e-3) == []


def test_only_sealed_trials_are_opened(opened: HeldOut) -> None:
    assert opened.trials == [1, 3]
    assert [k for k, y in enumerate(opened.prepared.measured) if np.isfinite(y).any()] == [1, 3]


SIGMA, CELL, ROWS = 2.5e-4, 1e-6, 80  # m of a marker; m of a motor's reading, too little to be felt; rows a trial


def held_by_lengths() -> PreparedRecording:
    """Two trials with the same lengths of tendon (m), the robot on its side, the second in a room 20 K warmer; nothing measured."""
    names = [f"disk_{k}_{a}" for k in (4, 8) for a in "xyz"]
    channels = (
        *(Channel(f"tendon_{i}_displacement", "input", "mm", CELL) for i in (1, 2, 3)),
        *(Channel(n, "output", "mm") for n in names),
    )
    t = np.linspace(0.0, 40.0, ROWS)
    pull = 1e-2 * np.sin(0.4 * t[:, None] - np.arange(3) * 2.0 * np.pi / 3.0)  # one or two taut, the others paid out
    columns = {f"tendon_{i + 1}_displacement": pull[:, i] for i in range(3)} | {n: np.zeros(ROWS) for n in names}
    trials = [
        Trial(f"{k}.csv", t, columns, {"ambient_temperature": 296.15 + 20.0 * k, "tip_payload": 0.02}, start=100.0 * k)
        for k in range(2)
    ]
    return prepare(Recording("continuum", "made", "simulation: none", np.array([9.81, 0.0, 0.0]), channels, tuple(trials)), ROBOT)


def test_what_a_known_effect_changes_between_repeats_is_no_noise() -> None:
    """A robot that is softer in a warm room sags anew, and no offset, gain or drift of an input says so: to the robot without the
    effect the repeat shows several times the noise that was drawn, and to the one with it that noise (480 differences: 3 %, and 2 %
    less for what is taken out with them)."""
    day, rng = held_by_lengths(), np.random.default_rng(3)
    assert repeats(day) == [(0, 1)]
    twins = {"without": Twin(ROBOT), "with": Twin(ROBOT, {}, (effect_class("temperature_softening")({"rate": 0.02}, 3),))}
    traces = {n: dict(enumerate(simulate(t, day, options=SolveOptions(keep=True)))) for n, t in twins.items()}
    seen = {n: [traces[n][k].outputs(t, day) for k in (0, 1)] for n, t in twins.items()}
    measured = [y + SIGMA * rng.normal(size=y.shape) for y in seen["with"]]
    objective: Any = SimpleNamespace(prepared=replace(day, measured=tuple(measured)), trials=[0, 1])
    sigma = {}
    for name, twin in twins.items():
        raw = [m - y for m, y in zip(measured, seen[name], strict=True)]
        found: Any = SimpleNamespace(model=SimpleNamespace(twin=twin), traces=traces[name], raw=raw)
        sigma[name] = float(noise_under(objective, found).sigma.mean())
    assert sigma["without"] > 2.0 * SIGMA
    assert sigma["with"] == pytest.approx(SIGMA, rel=0.12)


def test_where_a_command_beside_has_no_equilibrium_the_floor_is_by_the_noise_of_the_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(objective: Any, found: Any) -> Any:
        raise SolveError("no equilibrium")

    monkeypatch.setattr("twin.diagnosis.conclusion.noise_under", lost)
    weighed, of_the_fit = SimpleNamespace(fit=SimpleNamespace(evaluation=None)), object()
    study: Any = SimpleNamespace(objective=SimpleNamespace(whitener=SimpleNamespace(noise=of_the_fit)))
    judged: Any = SimpleNamespace(final=weighed)
    unused: Any = None
    assert Conclusion(study, unused, unused, unused, judged, ()).noise() is of_the_fit
