"""Two built robots' days in one set are told apart; one robot's, with or without an effect, are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.conftest import Day
from twin.bench import Bench, prepare
from twin.calibrate import Fit, fit
from twin.diagnose import Settings, diagnose
from twin.diagnose.objective import objective_of
from twin.diagnose.rigs import Rigs, rigs
from twin.measurements import Recording
from twin.robots import load
from twin.twin import Twin


def together(*days: Recording) -> Recording:
    """One session after the other in one set."""
    trials = [
        replace(t, name=f"day_{n}_{t.name}", start=4000.0 * n + (t.start or 0.0)) for n, day in enumerate(days) for t in day.trials
    ]
    return replace(days[0], trials=tuple(trials))


def found(recording: Recording) -> tuple[Bench, Fit, Rigs | None]:
    bench = prepare(recording, load("continuum"))
    trials = list(range(len(bench.inputs)))
    start, objective, _ = objective_of(bench, Twin.of(load("continuum")), trials, Settings())
    base = fit(objective, start, refresh=True)
    return bench, base, rigs(bench, trials, base)


@pytest.mark.parametrize("effect", [None, "stiffness_gradient"])
def test_one_robot_is_one(bench: Day, effect: str | None) -> None:
    assert found(bench(effect, seed=5)[0])[2] is None


def test_two_robots_are_told_apart_trial_by_trial(bench: Day) -> None:
    prepared, _, apart = found(together(bench(None, seed=5)[0], bench(None, seed=6)[0]))
    assert apart is not None
    days = [{prepared.inputs[k].name.split("_")[1] for k in group} for group in (apart.one, apart.other)]
    assert sorted(map(sorted, days)) == [["0"], ["1"]]


def test_the_diagnosis_says_so_and_claims_nothing(bench: Day) -> None:
    mixed = together(bench(None, seed=5)[0], bench(None, seed=6)[0])
    short = replace(mixed, trials=tuple(t for t in mixed.trials if t.name.split("_")[2] in ("slow", "circle")))
    d = diagnose(short, Twin.of(load("continuum")))
    assert d.verdict == "unexplained"
    assert not d.claims
    assert "two different robots" in d.description
    assert any("Diagnose the two groups apart" in n for n in d.notices)
