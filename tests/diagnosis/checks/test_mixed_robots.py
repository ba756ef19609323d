"""Two built robots' days in one set are told apart; one robot's, with or without an effect, are not."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.recorded_days import half, recorded_day
from twin.diagnosis import Settings, diagnose
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.calibration.model import Free, Model
from twin.diagnosis.calibration.objective import Evaluation
from twin.diagnosis.checks import mixed_robots as stage
from twin.diagnosis.checks.mixed_robots import MixedRobots, mixed_robots
from twin.foundation.parameters import Parameter
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.twin import Twin
from twin.robots import load


def together(*days: Recording) -> Recording:
    """One session after the other in one set."""
    trials = [
        replace(t, name=f"day_{n}_{t.name}", start=4000.0 * n + (t.start or 0.0)) for n, day in enumerate(days) for t in day.trials
    ]
    return replace(days[0], trials=tuple(trials))


def found(recording: Recording) -> tuple[PreparedRecording, Fit, MixedRobots | None]:
    bench = prepare(recording, load("continuum"))
    trials = list(range(len(bench.inputs)))
    start, objective, _ = objective_of(bench, Twin.of(load("continuum")), trials, Settings())
    base = fit(objective, start, refresh=True)
    return bench, base, mixed_robots(bench, trials, base)


@pytest.mark.parametrize("effect", [None, "stiffness_gradient"])
def test_one_robot_is_one(effect: str | None) -> None:
    assert found(half(recorded_day(effect)[0]))[2] is None


def two_robots() -> Recording:
    return together(*(half(recorded_day(None, seed=seed)[0]) for seed in (5, 6)))


def test_two_robots_are_told_apart_trial_by_trial() -> None:
    prepared, _, apart = found(two_robots())
    assert apart is not None
    days = [{prepared.inputs[k].name.split("_")[1] for k in group} for group in (apart.one, apart.other)]
    assert sorted(map(sorted, days)) == [["0"], ["1"]]


def test_the_diagnosis_says_so_and_claims_nothing() -> None:
    mixed = two_robots()
    short = replace(mixed, trials=tuple(t for t in mixed.trials if t.name.split("_")[2] in ("slow", "circle")))
    d = diagnose(short, Twin.of(load("continuum")))
    assert d.verdict == "unexplained"
    assert not d.claims
    assert "two different robots" in d.description
    assert any("Diagnose the two groups apart" in n for n in d.notices)


def shaped(session: np.ndarray, samples: int = 50, payload: np.ndarray | None = None) -> PreparedRecording:
    """Trials of these sessions, one after the other in each, as far as the check asks for them."""
    weights = np.zeros(len(session)) if payload is None else payload
    inputs: Any = [
        SimpleNamespace(time=np.zeros(samples), clock=[100.0 * s + k], loads=SimpleNamespace(payload=w, gravity=np.zeros(3)))
        for k, (s, w) in enumerate(zip(session, weights, strict=True))
    ]
    made: Any = SimpleNamespace(inputs=inputs, outputs=[None])
    return made


def test_groups_that_alternate_are_no_two_robots_unless_a_condition_parts_them() -> None:
    """Nobody changes a robot seven times within one recording; a load that only some trials carry may hang on another one."""
    odd = np.arange(8) % 2
    one, other = tuple(np.flatnonzero(odd == 0)), tuple(np.flatnonzero(odd))
    assert not stage._separable(shaped(np.zeros(8)), one, other)
    assert stage._separable(shaped(odd), one, other)
    assert stage._separable(shaped(np.zeros(8), payload=0.01 * odd), one, other)
    assert not stage._separable(shaped(np.zeros(8), payload=0.01 * (np.arange(8) > 3)), one, other)


def apart(size: float, trials: int = 8, samples: int = 50) -> tuple[float, float, MixedRobots | None]:
    """A robot of two numbers that half the trials want `size` higher and half as much lower, without noise but for a row that no
    robot explains: the fall of |z|^2 by two robots against one, by least squares; that bought by chance; and what `rigs` says."""
    rng = np.random.default_rng(0)
    J = rng.normal(size=(trials, samples, 2))
    J[:, 10] = 0.0
    side = np.where(np.arange(trials) % 2, 1.0, -1.0)
    z = np.einsum("knp,k->kn", J, size * side)
    z[:, 10] = 1.0
    free = tuple(Free(None, Parameter(n, 0.0, "m", -10.0, 10.0, "by hand", std=2.0, scale=1.0)) for n in ("one", "two"))
    fitted = Fit(Evaluation(Model(Twin.of(load("continuum")), free), [], [], z.ravel()), J.reshape(-1, 2), 0.0)
    made = shaped(side < 0, samples)

    def left(group: np.ndarray) -> float:
        """Least sum of squares of a group of trials, the priors' rows below."""
        A, y = np.vstack([J[group].reshape(-1, 2), 0.5 * np.eye(2)]), np.append(z[group].ravel(), [0.0, 0.0])
        return float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2))

    fall = left(side > -2) - left(side > 0) - left(side < 0)
    # By BIC: two more numbers known from n data; and 2^8 ways to share out the trials, twice their logarithm.
    n = np.count_nonzero(z)
    return fall, 2 * float(np.log(n)) + 2 * trials * float(np.log(2.0)), mixed_robots(made, list(range(trials)), fitted)


def test_the_second_robot_pays_for_its_numbers_and_for_the_choice_of_sides() -> None:
    fall, price, found_ = apart(1.0)
    assert found_ is not None
    assert {found_.one, found_.other} == {(0, 2, 4, 6), (1, 3, 5, 7)}
    assert found_.fall == pytest.approx(fall - price, rel=1e-6)  # 1e-9 is added to the information


def test_two_robots_are_said_only_where_the_fall_beats_its_price_by_a_fifth_of_a_sigma() -> None:
    """The fall goes with the square of what parts them: just above price + 0.2^2 n there are two, just below one."""
    fall, price, _ = apart(1.0)
    bar = price + 0.04 * 8 * 50
    edge = float(np.sqrt(bar / fall))
    assert apart(1.01 * edge)[2] is not None
    assert apart(0.99 * edge)[2] is None


@pytest.mark.parametrize("seed", range(6))
def test_the_groups_are_those_of_all_possible_ones_that_leave_least(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three trials that want one robot and five another, each a little its own, none twice as far on one side as on the other, all
    with noise: of the 119 ways to share out eight trials, two at least on a side, the best by least squares."""
    monkeypatch.setattr(stage, "_separable", lambda *_: True)
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(8, 50, 2))
    wanted = np.where(np.isin(np.arange(8), (1, 4, 5))[:, None], [1.5, 0.5], [-0.5, 0.0]) + 0.2 * rng.normal(size=(8, 2))
    z = np.einsum("knp,kp->kn", J, wanted) + rng.normal(size=(8, 50))
    free = tuple(Free(None, Parameter(n, 0.0, "m", -10.0, 10.0, "by hand", scale=1.0)) for n in ("one", "two"))
    fitted = Fit(Evaluation(Model(Twin.of(load("continuum")), free), [], [], z.ravel()), J.reshape(-1, 2), 0.0)
    made = shaped(np.zeros(8))
    found_ = mixed_robots(made, list(range(8)), fitted)
    assert found_ is not None

    def left(group: tuple[int, ...]) -> float:
        A, y = J[list(group)].reshape(-1, 2), z[list(group)].ravel()
        return float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2))

    def rest(group: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(k for k in range(8) if k not in group)

    least, other = min((left(g) + left(rest(g)), g) for n in (2, 3, 4) for g in combinations(range(8), n))
    assert (found_.one, found_.other) == (rest(other), other)
    price = 2 * np.log(400) + 16 * np.log(2)
    assert found_.fall == pytest.approx(left(tuple(range(8))) - least - price, rel=1e-6)


def test_of_robots_that_scatter_the_search_nearly_always_finds_the_best_of_all_possible_groups(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Trials that each want half as different a robot as the two groups do: a search from eight starts is no proof, but of 40 days
    its groups leave as little as the best of all 119 on 36 at least (of 540 such days tried 5 % fell short; of searches that go
    another way than down the sum of squares a quarter)."""
    monkeypatch.setattr(stage, "_separable", lambda *_: True)
    missed = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        J = rng.normal(size=(8, 50, 2))
        wanted = np.where(np.isin(np.arange(8), (1, 4, 5))[:, None], [1.5, 0.5], [-0.5, 0.0]) + 0.5 * rng.normal(size=(8, 2))
        z = np.einsum("knp,kp->kn", J, wanted) + rng.normal(size=(8, 50))
        free = tuple(Free(None, Parameter(n, 0.0, "m", -10.0, 10.0, "by hand", scale=1.0)) for n in ("one", "two"))
        fitted = Fit(Evaluation(Model(Twin.of("continuum"), free), {}, [], z.ravel()), J.reshape(-1, 2), 0.0)
        made = shaped(np.zeros(8))
        found_ = mixed_robots(made, list(range(8)), fitted)

        def told(group: tuple[int, ...], J: np.ndarray = J, z: np.ndarray = z) -> float:
            """What a robot of its own takes off a group's sum of squares: that of its projection."""
            Q = np.linalg.qr(J[list(group)].reshape(-1, 2))[0]
            return float(((Q.T @ z[list(group)].ravel()) ** 2).sum())

        groups = [g for n in (2, 3, 4) for g in combinations(range(8), n)]
        best = max(told(g) + told(tuple(k for k in range(8) if k not in g)) for g in groups)
        missed += found_ is None or told(found_.one) + told(found_.other) < best * (1.0 - 1e-6)
    assert missed <= 4
