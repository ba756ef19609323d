"""Faults of trackers, encoders and loggers planted in good days of a rod, a finger and two joint robots are told before any fit."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.diagnosis.faults import FAULTS
from tools.simulators.articulated import day as articulated
from tools.simulators.articulated.robots import ROBOTS as ARTICULATED
from tools.simulators.articulated.trials import session
from tools.simulators.two_link import write_day
from twin.diagnosis.checks.suspicions import Case, Suspicion
from twin.diagnosis.checks.suspicions.no_readings import jumps, repeats
from twin.foundation.errors import DataError
from twin.measurements import Recording, read, write
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

KINDS = (repeats.lost_markers, repeats.fills, repeats.stuck, repeats.frozen, jumps.exchanged, jumps.rolled)
SAMPLES = {"rod": "continuum/samples/friday", "finger": "finger/samples/drift"}
ROBOTS = ("rod", "finger", "joint robot", "leg")  # the leg: an MJCF and logged commands, which it follows late
KIND = {
    "zeros": "lost markers", "as -1": "filled cells", "as 9999": "filled cells", "stays": "stuck value", "is stuck": "stuck value",
    "names": "swapped labels", "rolls over": "roll-over", "rows that repeat": "frozen rows",
}  # fmt: skip


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Six trials of each robot, the ones that move most."""
    folder = tmp_path_factory.mktemp("days")
    write_day(folder / "whole joint robot", None, 41002)
    found = {"joint robot": folder / "whole joint robot"} | {n: models_folder() / s for n, s in SAMPLES.items()}
    for name, path in found.items():
        day = read(path)
        travel = [sum(float(np.nanstd(t.values[c.name])) for c in day.outputs()) for t in day.trials]
        write(day.select(sorted(np.argsort(travel)[-6:].tolist())), folder / name)
    return {name: folder / name for name in found} | {"leg": leg(folder / "leg")}


def leg(folder: Path) -> Path:
    """Four trials of an articulated leg, of an MJCF of its own, which is driven by commands without noise."""
    planned = session(ARTICULATED["leg"](), np.random.default_rng([101, 1]))
    short = tuple(t for t in planned.trials if t.name in ("steps", "fast_hip", "random_1", "hold", "held_steps"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(articulated, "session", lambda *_, **__: replace(planned, trials=short))
        articulated.make_set(folder, articulated.Recipe("leg", seed=101))
    return folder / "measured"


@cache
def predicted(robot: str, commands: bytes) -> tuple[np.ndarray, ...]:
    day = TO_PREDICT[robot, commands]
    twin = Twin.of(load(day.robot, day.folder))
    prepared = prepare(day, twin.robot)
    return tuple(t.outputs(twin, prepared) for t in simulate(twin, prepared))


TO_PREDICT: dict[tuple[str, bytes], Recording] = {}


def told(day: Recording) -> list[Suspicion]:
    """What the files and the prediction of the robot as described show; a prediction of the same inputs is made once."""
    twin = Twin.of(load(day.robot, day.folder))
    commands = np.concatenate([t.values[c.name] for t in day.trials for c in day.inputs()]).tobytes()
    TO_PREDICT[day.robot, commands] = day
    return [s for kind in KINDS for s in kind(Case(prepare(day, twin.robot), twin, predicted(day.robot, commands)))]


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_good_day_raises_nothing(robot: str, days: dict[str, Path]) -> None:
    assert told(read(days[robot])) == []


@pytest.mark.parametrize("fault", [f for f in FAULTS if not f.startswith("a drive drops out as 9999")])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_fault_is_refused_or_told(robot: str, fault: str, days: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(days[robot], tmp_path / "set")
    try:
        FAULTS[fault](tmp_path / "set")
    except ValueError as nothing:
        pytest.skip(f"{nothing} in this set")
    try:
        found = told(read(tmp_path / "set"))
    except DataError as error:
        refused = str(error)
    else:
        refused = ""
    if refused:
        assert "time" in refused or "missing" in refused
        return
    assert found
    wanted = next((kind for words, kind in KIND.items() if words in fault), "")
    assert not wanted or wanted in {s.kind for s in found}


def test_what_the_file_then_declares_is_no_suspicion(days: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(days["rod"], tmp_path / "set")
    FAULTS["a lost marker as zeros, four rows at a time"](tmp_path / "set")
    file = tmp_path / "set/measurements.toml"
    (found,) = told(read(tmp_path / "set"))
    assert "write missing = [0, 0, 0] at the top of measurements.toml" in found.change
    file.write_text(f"missing = [0, 0, 0]\n{file.read_text()}")
    assert told(read(tmp_path / "set")) == []


def stepped(day: Recording, levels: tuple[float, ...]) -> Recording:
    """One trial whose first command goes through these levels, 20 rows to the last digit at each, with the others near rest."""
    name, n = day.inputs()[0].name, len(day.trials[0].time)
    quiet = {c.name: np.round(np.linspace(0.0, 0.3, n), 3) for c in day.inputs()}
    quiet[name] = np.resize(np.repeat(levels, 20), n)
    return replace(day, trials=(replace(day.trials[0], values={**day.trials[0].values, **quiet}),))


def told_of(commanded: Recording, share: float) -> list[Suspicion]:
    """What is told of a robot that goes this share of the way, from where it begins, that commands ask for."""
    twin = Twin.of(load(commanded.robot))
    prepared = prepare(commanded, twin.robot)
    shown = tuple(t.outputs(twin, prepared) for t in simulate(twin, prepared))
    seen = {o.channel.name: y[0] + share * (y - y[0]) for o, y in zip(prepared.outputs, shown[0].T, strict=True)}
    followed = prepare(commanded.with_values([seen], "simulation"), twin.robot)
    return [s for kind in KINDS for s in kind(Case(followed, twin, shown))]


def test_a_command_that_is_held_is_not_stuck(days: dict[str, Path]) -> None:
    """The robot follows when it is let go."""
    assert told_of(stepped(read(days["rod"]), (0.1, 1.0)), share=1.0) == []


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_command_in_steps_is_not_stuck_where_the_robot_hardly_follows(days: dict[str, Path], share: float) -> None:
    """A robot that hits something, or whose drive is weak, is no fault of its commands."""
    levels = (0.1, 0.9, 0.4, 1.0, 0.6, 0.2, 0.8, 0.5, 0.3, 0.7)
    assert told_of(stepped(read(days["rod"]), levels), share) == []


def test_a_command_out_of_range_that_a_leg_does_not_follow_is_told(days: dict[str, Path], tmp_path: Path) -> None:
    """A servo at its limit for two rows moves the leg as described, and the leg did not move."""
    shutil.copytree(days["leg"], tmp_path / "set")
    FAULTS["a drive drops out as 9999"](tmp_path / "set")
    (found,) = told(read(tmp_path / "set"))
    assert found.kind == "filled cells"
    assert "exactly 9999 in 4 rows" in found.words


def pulsed(day: Recording) -> Recording:
    """The day with a command that goes to zero for three rows, twice in each trial, as a drop-out would."""
    name, trials = day.inputs()[0].name, []
    for t in day.trials:
        command = t.values[name].copy()
        for row in (len(command) // 3, 2 * len(command) // 3):
            command[row : row + 3] = 0.0
        trials.append(replace(t, values={**t.values, name: command}))
    return replace(day, trials=tuple(trials))


@pytest.mark.parametrize("follows", [True, False])
def test_pulses_of_a_command_are_told_where_the_leg_does_not_follow(follows: bool, days: dict[str, Path]) -> None:
    """The same cells are readings where the outputs, with their noise, show them; else none, and what is beside them is."""
    day = pulsed(read(days["leg"]))
    twin = Twin.of(load(day.robot, day.folder))
    prepared = prepare(day, twin.robot)
    shown = tuple(t.outputs(twin, prepared) for t in simulate(twin, prepared))
    rng = np.random.default_rng(0)
    seen = [
        {o.channel.name: y + (o.channel.noise or 0.0) * rng.normal(size=len(y)) for o, y in zip(prepared.outputs, p.T, strict=True)}
        for p in shown
    ]
    if follows:
        prepared = prepare(day.with_values(seen, "simulation"), twin.robot)
    found = [s for kind in KINDS for s in kind(Case(prepared, twin, shown))]
    assert [s.words.partition(" in ")[0] for s in found] == ([] if follows else [f"{day.inputs()[0].name}: exactly 0"])
