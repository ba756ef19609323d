"""A lag told from a delay: tendons whose command and delivery are known, logged at rows with noise."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

from twin.body import Drive
from twin.diagnosis.search.command_spline import smooth_command
from twin.diagnosis.search.lag_or_delay import Given, lag_or_delay, likelihood, rescored, tells_laws, weighed

LAG, DELAY = frozenset({"actuator_lag"}), frozenset({"time_delay"})
SEEN = 0.02  # N, how well outputs show a pull


def trials(rows: int, delay: float = 0.0, lag: float = 0.0, inertia: float = 0.0, noise: float = 0.01) -> list[Given]:
    """Six trials of 9 s: ramps and plateaus, or swings; delivered by scipy's linear systems on a millisecond grid."""
    rng = np.random.default_rng(5)
    fine = np.arange(9001) * 1e-3
    out = []
    for k in range(6):
        if k % 2:
            when = np.sort(rng.uniform(0.0, 9.0, 16))
            command = np.stack([np.interp(fine, when, np.repeat(rng.uniform(0.0, 3.0, 8), 2)) for _ in range(3)], axis=1)
        else:
            command = np.stack([1.5 - 1.5 * np.cos(rng.uniform(1.0, 4.0) * fine) for _ in range(3)], axis=1)
        delivered = command
        if lag > 0.0:
            system = ([1.0], [inertia * lag**2, lag, 1.0] if inertia else [lag, 1.0])
            delivered = np.stack([c[0] + lsim(system, c - c[0], fine)[1] for c in command.T], axis=1)
        time = np.linspace(0.0, 9.0, rows)
        time[1:-1] += rng.uniform(-0.15, 0.15, rows - 2) * time[1]
        pull = np.stack([np.interp(np.maximum(time - delay, 0.0), fine, c) for c in delivered.T], axis=1)
        read = np.stack([np.interp(time, fine, c) for c in command.T], axis=1)
        known = smooth_command(time, read + noise * rng.standard_normal(read.shape), noise)
        variance = SEEN**2 + np.interp(np.maximum(time - delay - lag, 0.0), known.time, known.variance)
        precision = np.eye(3) / variance[:, None, None]
        out.append(Given(time, pull + SEEN * rng.standard_normal(pull.shape), precision, known))
    return out


def by_score(given: list[Given], late: float) -> list[tuple[frozenset[str], float]]:
    weights = weighed(given, late)
    assert weights is not None
    return sorted(((laws, w.score) for laws, w in weights.items()), key=lambda x: -x[1])


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize(
    ("law", "true"),
    [
        ({"delay": 0.1}, DELAY),
        ({"lag": 0.1}, LAG),
        ({"lag": 0.1, "inertia": 0.2}, LAG),
        ({"lag": 0.1, "inertia": 0.36}, LAG),
        ({"delay": 0.15, "lag": 0.15}, LAG | DELAY),
    ],
)
def test_the_law_that_delivered_is_the_likeliest(law: dict[str, float], true: frozenset[str], noise: float) -> None:
    """Rows of 0.11 s, as late as that; also where the reading's noise is larger than what outputs show of a pull, where on straight
    paths whatever smooths wins."""
    given = trials(80, noise=noise, **law)
    late = law.get("delay", 0.0) + law.get("lag", 0.0)
    first, second = by_score(given, 1.5 * late)[:2]
    assert first[0] == true
    assert first[1] > second[1] + (0.0 if true == DELAY else 12.0)


def test_what_is_found_is_what_was() -> None:
    """To 5 %: 480 rows of three tendons of 0.02 N where pulls change by 1 N in 0.3 s tell 0.1 s to some 1 %."""
    weights = weighed(trials(80, lag=0.12, inertia=0.3), 0.2)
    assert weights is not None
    found = weights[LAG].values["actuator_lag"]
    assert found["time"] == pytest.approx(0.12, rel=0.05)
    assert found["inertia"] == pytest.approx(0.3, rel=0.15)
    delayed = weighed(trials(80, delay=0.07), 0.03)
    assert delayed is not None
    assert delayed[DELAY].values["time_delay"]["delay"] == pytest.approx(0.07, rel=0.05)


@pytest.mark.parametrize("law", [{"delay": 0.02}, {"lag": 0.02}])
def test_rows_far_apart_do_not_tell_which(law: dict[str, float]) -> None:
    """Rows of 0.6 s, late by 0.02 s: corners between rows move a pull by more than the laws differ in. No odds of e^6."""
    scores = dict(by_score(trials(16, **law), 0.03))
    assert abs(scores[LAG] - scores[DELAY]) < 12.0


def test_a_robot_that_is_early_has_no_lag() -> None:
    assert weighed(trials(20, delay=0.05), -0.05) is None


def test_what_is_surer_counts_for_more() -> None:
    """Off by the same, at four times the precision a wrong law is worth less."""
    true = trials(40, delay=0.1)[0]
    sure = Given(true.time, true.pull, 4.0 * true.precision, true.command)
    assert likelihood(true, 0.1, 0.0, 0.0) > likelihood(true, 0.2, 0.0, 0.0) > likelihood(sure, 0.2, 0.0, 0.0)


@dataclass(frozen=True)
class Set:
    effects: tuple[str, ...]
    score: float
    form: str = ""

    @property
    def forms(self) -> tuple[tuple[str, str], ...]:
        return tuple((e, self.form if e == "tendon_elasticity" else "") for e in self.effects)


def test_sets_differ_by_what_their_laws_of_lateness_are_worth() -> None:
    """The best of those alike but for these laws keeps its score; sets without one keep theirs."""
    weights = weighed(trials(80, lag=0.1), 0.1)
    assert weights is not None
    behind = weights[LAG].score - weights[DELAY].score
    sets = [
        Set(("time_delay", "tip_payload"), 500.0),
        Set(("actuator_lag", "tip_payload"), 480.0),
        Set(("time_delay",), 90.0),
        Set((), 0.0),
    ]
    after = {w.effects: w.score for w in rescored(sets, weights)}  # type: ignore[arg-type]
    assert after["actuator_lag", "tip_payload"] == 500.0
    assert after["time_delay", "tip_payload"] == pytest.approx(500.0 - behind)
    assert after["time_delay",] == pytest.approx(90.0 - behind)
    assert after[()] == 0.0


def test_sets_of_the_same_effects_in_other_forms_are_not_alike() -> None:
    weights = weighed(trials(80, lag=0.1), 0.1)
    assert weights is not None
    effects = ("tendon_elasticity", "actuator_lag")
    toe, stretch = rescored([Set(effects, 90.0, "toe"), Set(effects, 50.0, "stretch")], weights)  # type: ignore[list-item]
    assert (toe.score, stretch.score) == (90.0, 50.0)


@pytest.mark.parametrize(
    ("effects", "drives"),
    [
        (("tip_payload",), (Drive.TENSION,) * 3),
        (("time_delay",), (Drive.CURRENT,) * 3),
        (("time_delay",), (Drive.TENSION, Drive.DISPLACEMENT, Drive.TENSION)),
    ],
)
def test_where_nothing_is_late_or_springs_remember_the_search_stays(effects: tuple[str, ...], drives: tuple[Drive, ...]) -> None:
    """A study that has nothing but its drives: nothing else is asked for."""
    found: Any = SimpleNamespace(best=Set(effects, 1.0))
    study: Any = SimpleNamespace(prepared=SimpleNamespace(drives=drives))
    assert lag_or_delay(study, found) is found


@pytest.mark.parametrize(
    ("drives", "tells"),
    [
        ((Drive.TENSION,) * 2, True),
        ((Drive.DISPLACEMENT,) * 2, True),
        ((Drive.TENSION, Drive.DISPLACEMENT), False),
        ((Drive.CURRENT,) * 2, False),
        ((Drive.CONTROL,) * 2, False),  # known exactly, so that the fits themselves decide
    ],
)
def test_commands_that_outputs_imply_decide_only_where_commands_are_noisy(drives: tuple[Drive, ...], tells: bool) -> None:
    context: Any = SimpleNamespace(prepared=SimpleNamespace(drives=drives))
    assert tells_laws(context) is tells
