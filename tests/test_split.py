"""Which trials are sealed: about a quarter, by inputs and conditions alone, and never what only one trial shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.test_design import bench
from tools.bench.design import bench_day
from twin.bench import Bench
from twin.diagnose.split import split


@pytest.fixture(scope="module")
def day() -> Bench:
    return bench(bench_day("default", np.random.default_rng(0)))


def altered(day: Bench, trial: int, **loads: object) -> Bench:
    """The day with one trial under loads of its own."""
    inputs = list(day.inputs)
    inputs[trial] = replace(inputs[trial], loads=replace(inputs[trial].loads, **loads))
    return replace(day, inputs=tuple(inputs))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "loads",
    [{"payload": 0.042}, {"gravity": np.array([0.0, 9.81, 0.0])}, {"force": np.array([0.1, 0.0, 0.0])}],
    ids=["payload", "mount", "force"],
)
def test_what_only_one_trial_shows_is_not_sealed(day: Bench, loads: dict[str, object], seed: int) -> None:
    plain = split(day, seed)[1]
    for trial in plain:  # would be sealed, were it like the others
        assert trial not in split(altered(day, trial, **loads), seed)[1]


def test_the_widest_command_and_the_warmest_trial_are_not_sealed(day: Bench) -> None:
    trial = split(day, 0)[1][0]
    inputs = list(day.inputs)
    wide = inputs[trial].command.copy()
    wide[:, 1] *= 3.0 * max(i.command.max() for i in day.inputs) / max(wide[:, 1].max(), 0.1)
    for changed in (replace(inputs[trial], command=wide), replace(inputs[trial], temperature=inputs[trial].temperature + 8.0)):
        inputs[trial] = changed
        assert trial not in split(replace(day, inputs=tuple(inputs)), 0)[1]
        inputs[trial] = day.inputs[trial]


def test_where_every_trial_is_the_only_one_of_its_kind_a_quarter_is_sealed_all_the_same(day: Bench) -> None:
    alone = day
    for k in range(len(day.inputs)):
        alone = altered(alone, k, payload=1e-3 * (k + 1))
    fitted, sealed = split(alone, 0)
    assert len(sealed) == round(0.25 * len(day.inputs))
    assert sorted((*fitted, *sealed)) == list(range(len(day.inputs)))


def test_measurements_do_not_count(day: Bench) -> None:
    rng = np.random.default_rng(1)
    other = replace(day, measured=tuple(rng.normal(size=y.shape) for y in day.measured))
    assert split(other, 3) == split(day, 3)
