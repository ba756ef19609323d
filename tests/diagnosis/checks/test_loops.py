"""Loops between pull and release: by hand, where the loop is what was put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.recorded_days import recorded_day
from twin.diagnosis.checks.loops import Loops, _along, loops
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.robots import load

HALF = 1.5e-3  # m: half the width of the loop
NOISE = 1e-4  # m
OUT = np.concatenate([np.linspace(0.0, 2.0, 60), np.linspace(2.0, 0.0, 60)[1:]])  # N: pull and release
TWICE = np.interp(np.arange(240), [0, 80, 120, 160, 239], [0.0, 2.0, 1.0, 2.0, 0.0])


def recorded(
    pull: np.ndarray, *, lag: float = HALF, drift: float = 0.0, noise: float = NOISE, share: tuple[float, ...] = (1.0, 0.0, 0.0)
) -> PreparedRecording:
    """Three trials whose tip goes 20 mm/N along x, less `lag` on the way out and more on the way back, plus `drift` (m/s)."""
    rng = np.random.default_rng(0)
    t = np.arange(len(pull), dtype=float)
    side = -np.sign(np.gradient(pull))  # -1 when pulled
    channels = [Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3)]
    channels += [Channel(f"disk_{k}_{a}", "output", "m", NOISE) for k in (4, 8) for a in "xyz"]
    trials = []
    for k in range(3):
        values = {f"tendon_{i + 1}_tension": s * pull for i, s in enumerate(share)}
        for disk in (4, 8):
            part = (disk / 8) ** 2
            values[f"disk_{disk}_x"] = part * (2e-2 * pull + lag * side + drift * t) + rng.normal(0, noise, len(t))
            values[f"disk_{disk}_y"] = rng.normal(0, noise, len(t))
            values[f"disk_{disk}_z"] = np.full(len(t), 0.015 * disk) + rng.normal(0, noise, len(t))
        trials.append(Trial(f"t{k}.csv", t, values, {}, start=1000.0 * k))
    recording = Recording("continuum", "by hand", "simulation", None, tuple(channels), tuple(trials))
    return prepare(recording, load("continuum"))


@pytest.mark.parametrize("lag", [HALF, -HALF], ids=["lags", "leads"])
@pytest.mark.parametrize("share", [(1.0, 0.0, 0.0), (0.7, 1.0, 0.0)], ids=["one tendon", "two that retrace"])
def test_the_width_and_the_sign_are_what_was_put_in(lag: float, share: tuple[float, ...]) -> None:
    found = loops(recorded(OUT, lag=lag, share=share))
    assert (found.group, found.name) == ("marker", "disk_8")
    assert len(found.by_trial) == 3
    # Release less pull is twice `lag`; the pairs next to the turn, 2 of 57, may mix both sides: 4 % and the noise of 170 pairs.
    assert found.lag == pytest.approx(2.0 * lag, rel=0.05)
    assert found.seen
    assert all(loop.seen for loop in found.by_trial)


def test_no_loop_is_none_and_its_noise_is_that_of_the_readings() -> None:
    found = loops(recorded(OUT, lag=0.0))
    assert not found.seen
    pairs = sum(loop.pairs for loop in found.by_trial)
    # Each pair is the difference of two readings, one of them at a row or half way to the next: sqrt(1.5) to sqrt(2) sigma; of
    # 170 pairs that is known to 6 %, three times of which is allowed.
    assert 1.0 * NOISE < found.noise * np.sqrt(pairs) < 1.67 * NOISE


def test_one_visit_in_each_direction_leaves_time_and_direction_confounded() -> None:
    """A drift of 15 um/s alone looks like a lag; a second pull after a release tells them apart."""
    once = loops(recorded(OUT, lag=0.0, drift=1.5e-5))
    assert once.seen
    assert once.confounded
    assert all(loop.drift is None for loop in once.by_trial)
    again = loops(recorded(TWICE, lag=0.0, drift=1.5e-5))
    assert not again.confounded
    both = loops(recorded(TWICE, lag=HALF, drift=1.5e-5))
    assert both.seen
    # Times between the visits differ by order (200 s at most against some 80): half of what the drift does stays in the lag.
    assert abs(again.lag) < 0.5 * once.lag
    assert both.lag == pytest.approx(2.0 * HALF + again.lag, rel=0.05)


def test_a_drift_is_half_the_difference_of_pairs_that_begin_pulling_and_that_begin_releasing() -> None:
    """The pulls of TWICE come back after 199, 40 and 40 s in the mean of 80, 80 and 40 rows, 93 s; its release after 40 s."""
    for rate in (1.5e-5, -4e-5):
        each = loops(recorded(TWICE, lag=HALF, drift=rate, noise=1e-9)).by_trial
        assert [loop.drift for loop in each] == pytest.approx([rate * 0.5 * (93.0 + 40.0)] * 3, rel=0.05)


def test_the_way_of_a_pull_is_from_the_least_fifth_to_the_largest() -> None:
    rng = np.random.default_rng(1)
    u, y = rng.permutation(100)[:, None] / 100.0, rng.normal(size=(100, 3))
    order = np.argsort(u[:, 0])
    way = y[order[80:]].mean(axis=0) - y[order[:20]].mean(axis=0)
    np.testing.assert_allclose(_along(u, y), way / np.linalg.norm(way), atol=1e-12)


def test_commands_that_never_come_back_show_no_loop() -> None:
    found = loops(recorded(np.linspace(0.0, 2.0, 100)))
    assert found == Loops("marker", "disk_8", ())
    assert not found.seen
    assert not found.confounded
    assert np.isnan(found.lag)


def test_what_was_not_measured_is_not_compared() -> None:
    bench = recorded(OUT)
    blind = replace(bench, measured=(np.full_like(bench.measured[0], np.nan), *bench.measured[1:]))
    assert [loop.trial for loop in loops(blind).by_trial] == [1, 2]


def test_friction_lags_on_a_day_of_the_bench_and_a_day_without_effect_does_not() -> None:
    names = ["slow_1", "slow_2", "slow_3"]
    days = (recorded_day("tendon_friction", 2.5)[0], recorded_day(None)[0])
    rubbing, free = (loops(prepare(day.select(names), load("continuum"))) for day in days)
    assert rubbing.seen
    assert rubbing.lag > 1e-3  # m: mu 0.25 over some 20 mm of travel
    assert abs(free.lag) < 0.2 * rubbing.lag
