"""Which trials are sealed: about a quarter, by inputs and conditions alone, and never what only one trial shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench
from tools.simulators.rod.design import bench_day
from twin.diagnosis.split import split
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import Inputs, PreparedRecording, prepare
from twin.robots import load


@pytest.fixture(scope="module")
def day() -> PreparedRecording:
    return bench(bench_day("default", np.random.default_rng(0)))


def altered(day: PreparedRecording, trial: int, **loads: object) -> PreparedRecording:
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
def test_what_only_one_trial_shows_is_not_sealed(day: PreparedRecording, loads: dict[str, object], seed: int) -> None:
    plain = split(day, seed)[1]
    for trial in plain:  # would be sealed, were it like the others
        assert trial not in split(altered(day, trial, **loads), seed)[1]


@pytest.mark.parametrize(("name", "less"), [("payload", 4e-7), ("gravity", 4e-4), ("force", 4e-4)])
def test_what_no_scale_level_or_gauge_tells_is_no_condition_of_its_own(day: PreparedRecording, name: str, less: float) -> None:
    """0.4 mg, 40 microradians and 0.4 mN: bench instruments read to a milligram, a tenth of a milliradian and a millinewton."""
    plain = split(day, 0)
    for trial in plain[1]:
        assert split(altered(day, trial, **{name: getattr(day.inputs[trial].loads, name) + less}), 0) == plain


def test_the_widest_command_and_the_warmest_trial_are_not_sealed(day: PreparedRecording) -> None:
    trial = split(day, 0)[1][0]
    inputs = list(day.inputs)
    wide = inputs[trial].command.copy()
    wide[:, 1] *= 3.0 * max(i.command.max() for i in day.inputs) / max(wide[:, 1].max(), 0.1)
    for changed in (replace(inputs[trial], command=wide), replace(inputs[trial], temperature=inputs[trial].temperature + 8.0)):
        inputs[trial] = changed
        assert trial not in split(replace(day, inputs=tuple(inputs)), 0)[1]
        inputs[trial] = day.inputs[trial]


def test_where_every_trial_is_the_only_one_of_its_kind_a_quarter_is_sealed_all_the_same(day: PreparedRecording) -> None:
    alone = day
    for k in range(len(day.inputs)):
        alone = altered(alone, k, payload=1e-3 * (k + 1))
    fitted, sealed = split(alone, 0)
    assert len(sealed) == round(0.25 * len(day.inputs))
    assert sorted((*fitted, *sealed)) == list(range(len(day.inputs)))


def test_measurements_do_not_count(day: PreparedRecording) -> None:
    rng = np.random.default_rng(1)
    other = replace(day, measured=tuple(rng.normal(size=y.shape) for y in day.measured))
    assert split(other, 3) == split(day, 3)


def pulls(tops: list[float], resting: int | None = None, nudged: tuple[tuple[int, int], ...] = ()) -> PreparedRecording:
    """Trials in each of which tendon 1 is pulled to one of `tops` (N) and let go, each with a payload of its own: none repeats
    another, and each shows what no other does. One may rest for 25 s on the way, some (trial, tendon) be nudged, by 1 mN."""
    channels = [Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)] + [Channel("disk_8_x", "output", "mm")]
    trials = []
    for k, top in enumerate(tops):
        time = np.arange(41.0)
        values = {c.name: np.zeros(41) for c in channels} | {"tendon_1_tension": top * np.sin(np.pi * time / 40.0) ** 2}
        if k == resting:
            time = time + 25.0 * (time > 20.0)
        values |= {f"tendon_{i}_tension": 1e-3 * (time == 20.0) for trial, i in nudged if trial == k}
        trials.append(Trial(f"{k}.csv", time, values, {"tip_payload": 1e-3 * k}, start=100.0 * k))
    recording = Recording("continuum", "a plan", "simulation: none", np.zeros(3), tuple(channels), tuple(trials))
    return prepare(recording, load("continuum"))


def sealed_of(bench: PreparedRecording) -> set[int]:
    """Trials that one of 30 seeds seals: of eight alike each with a chance of 1 - 0.75^30."""
    return {k for seed in range(30) for k in split(bench, seed)[1]}


def test_the_only_hold_and_the_only_end_of_a_range_are_not_sealed_and_an_end_that_two_show_is() -> None:
    """A load cell tells 10 mN, so that 4.000 and 3.999 N are one end of the range and 4.0 and 3.9 N are not."""
    alike = [2.0] * 6
    assert sealed_of(pulls([2.0, 2.0, *alike])) == set(range(8))
    assert sealed_of(pulls([2.0, 2.0, *alike], resting=0)) == set(range(1, 8))
    assert sealed_of(pulls([2.0, 2.0, *alike], nudged=((0, 2), (0, 3), (1, 2), (2, 3)))) == set(range(8)), "a nudge is no motion"
    assert sealed_of(pulls([4.0, 3.999, *alike])) == set(range(8))
    assert sealed_of(pulls([4.0, 3.9, *alike])) == set(range(1, 8))


def test_the_trial_that_turns_a_motor_furthest_either_way_is_fitted() -> None:
    """Eight trials turn a motor to and fro about its home, alike but for one that goes further forth and one further back: what
    begins there, a stop or a slack tendon, shows in no other. The one that goes back least is no end."""
    far = pulls([2.0] * 8)

    def turned(k: int, low: float, high: float) -> Inputs:
        command = far.inputs[k].command.copy()
        command[:, 0] = np.where(np.arange(len(command)) % 2, high, low)
        return replace(far.inputs[k], command=command, home=np.zeros(3), reach=np.full(3, 2.0))

    ways = [(-1.5, 1.6), (-1.7, 1.5), (-1.4, 1.5), *[(-1.5, 1.5)] * 5]
    bench = replace(far, inputs=tuple(turned(k, *way) for k, way in enumerate(ways)))
    assert sealed_of(bench) == set(range(2, 8))


@pytest.mark.parametrize(
    "loads",
    [{"payload": 0.01}, {"gravity": np.array([0.0, 9.81, 0.0])}, {"force": np.array([0.1, 0.0, 0.0])}],
    ids=["payload", "mount", "force"],
)
def test_a_load_stays_in_sight_though_all_trials_without_it_repeat_another(loads: dict[str, object]) -> None:
    """Four pairs of repeats and, once each, three under a load, as labs do it: two of them, and one of a pair, are sealed."""
    once = pulls([1.0, 1.0, 1.3, 1.3, 1.6, 1.6, 2.0, 2.0, 1.0, 1.5, 2.0])
    inputs = [replace(i, loads=replace(i.loads, payload=0.0)) for i in once.inputs]
    bench = replace(once, inputs=tuple(inputs))
    for k in (8, 9, 10):
        bench = altered(bench, k, **loads)
    for seed in range(30):
        fitted, sealed = split(bench, seed)
        assert len(sealed) == 3
        assert set(fitted) & {8, 9, 10}
