"""What a design lacks is named exactly: the poor designs of the bench leave out one thing each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tools.simulators.rod.design import Day, bench_day
from twin.diagnosis.checks.design import shortcomings
from twin.effects import catalogue
from twin.effects.base.effect import DataNeed
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.robots import load

DISPLACEMENTS = "tendon displacements"
TEMPERATURE = "a logged room temperature that varies by 2 K or more"
LACKS = {
    "default": (),
    "hanging": (),
    "sideways": (),
    "mixed": (),
    "no_repeats": (),  # the noise model says so
    "loading_only": ("loading and unloading",),
    "one_payload": ("two payloads, or two mounts",),
    "one_rate": ("two rates of pull, ten times apart",),
    "one_tendon": ("pulls of every tendon, alone and together", "two rates of pull, ten times apart"),  # one fast pull of 21
    "tip_only": ("three markers along the body",),
    "time_ordered": (),  # its fixed order still goes round the tendons and the payloads
}


def bench(day: Day, *, displacement: bool = False, room: bool = False, disks: Sequence[int] = range(1, 9)) -> PreparedRecording:
    """The day as a bench that measured nothing: what a design lacks is to be seen before."""
    drive = "displacement" if day.driven_by_length else "tension"
    outputs = [f"disk_{k}_{a}" for k in ([8] if day.tip_only else disks) for a in "xyz"]
    outputs += [f"tendon_{i}_displacement" for i in (1, 2, 3)] if displacement else []
    channels = [Channel(f"tendon_{i}_{drive}", "input", "mm" if day.driven_by_length else "N") for i in (1, 2, 3)]
    channels += [Channel(name, "output", "mm") for name in outputs]
    channels += [Channel("ambient_temperature", "context", "K")] if room else []
    trials = []
    for t in day.trials:
        values = {name: np.zeros(len(t.time)) for name in outputs}
        values |= {f"tendon_{i + 1}_{drive}": np.interp(t.time, t.fine, t.command[:, i]) for i in range(3)}
        values |= {"ambient_temperature": 273.15 + day.ambient(t.start + t.time)} if room else {}
        gravity = {} if t.gravity is None else {"gravity": np.array(t.gravity)}
        trials.append(Trial(f"{t.name}.csv", t.time, values, {"tip_payload": t.payload, **gravity}, start=t.start))
    recording = Recording("continuum", "a plan", "simulation: none", np.array(day.gravity), tuple(channels), tuple(trials))
    return prepare(recording, load("continuum"))


def words(bench: PreparedRecording) -> list[str]:
    return [str(need) for need in shortcomings(bench)]


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("design", LACKS)
def test_a_poor_design_lacks_just_what_it_leaves_out(design: str, seed: int) -> None:
    day = bench_day(design, np.random.default_rng(seed))
    assert set(words(bench(day))) == {DISPLACEMENTS, TEMPERATURE, *LACKS[design]}


def test_a_full_design_lacks_nothing() -> None:
    day = bench_day("default", np.random.default_rng(0))
    assert np.ptp(day.room[1]) > 3.0  # K: the room was warm and cold
    assert words(bench(day, displacement=True, room=True)) == []


def test_three_markers_are_enough_and_two_are_not() -> None:
    day = bench_day("default", np.random.default_rng(0))
    assert words(bench(day, displacement=True, room=True, disks=(2, 5, 8))) == []
    assert words(bench(day, displacement=True, room=True, disks=(5, 8))) == ["three markers along the body"]


def test_a_steady_room_is_as_good_as_none() -> None:
    day = bench_day("default", np.random.default_rng(0))
    steady = replace(day, room=np.stack([day.room[0], 23.0 + 0.4 * (day.room[1] - day.room[1].mean()) / np.ptp(day.room[1])]))
    assert words(bench(steady, displacement=True, room=True)) == [TEMPERATURE]


def test_motors_that_command_displacements_know_them() -> None:
    assert words(bench(bench_day("by_length", np.random.default_rng(0)))) == [TEMPERATURE]


@pytest.mark.parametrize("by", ["payload", "tendon"])
def test_trials_in_blocks_lack_a_random_order(by: str) -> None:
    day = bench_day("default", np.random.default_rng(0))
    key = {"payload": lambda t: t.payload, "tendon": lambda t: int(np.argmax(np.ptp(t.command, axis=0)))}[by]
    order = sorted(day.trials, key=key)
    ordered = replace(day, trials=tuple(replace(t, start=200.0 * n) for n, t in enumerate(order)))
    assert words(bench(ordered, displacement=True, room=True)) == ["a random order of the trials"]


def test_short_trials_lack_holds() -> None:
    day = bench_day("default", np.random.default_rng(0))
    moving = tuple(t for t in day.trials if not t.name.startswith("hold"))
    assert "holds of a minute" in words(bench(replace(day, trials=moving)))


def test_every_need_hides_some_effect() -> None:
    for need in DataNeed:
        assert any(need in effect.hidden_without for effect in catalogue().values()), need
