"""Right files raise no suspicion: robots of five kinds from simulators of their own, effects, and what is only unusual."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mechanics.rod.test_transmission import ROBOT as JAW
from tests.mechanics.rod.test_transmission import day as jaw_day
from tools.simulators import two_link
from tools.simulators.rod.bench import run
from tools.simulators.rod.design import Trial as Planned
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.mechanics.rod import Rod
from tools.simulators.rod.nuisance import built
from tools.simulators.rod.sensors import Noise
from tools.simulators.rod.write import write_set
from twin.diagnosis import Settings
from twin.diagnosis.checks.preview import preview_data
from twin.foundation.parameters import Parameter
from twin.measurements import Recording, Trial, read
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import Robot, load
from twin.robots.robot import models_folder

FRIDAY = read(models_folder() / "continuum/samples/friday")
SHOWN = (
    "slow_1",
    "slow_2",
    "fast_3",
    "pair_3",
    "hold_2",
    "wander_1",
    "circle_1",
    "circle_2",
    "heat_1",
    "heat_2",
    "turns_1",
    "turns_2",
)


def said(recording: Recording, robot: Robot | None = None) -> list[str]:
    twin = Twin.of(robot or load(recording.robot))
    return [f"{s.kind}: {s.words}" for s in preview_data(prepare(recording, twin.robot), twin, Settings()).suspicions]


INSTRUMENTS: Any = Noise


def made(
    folder: Path, design: str, seed: int, effect: str | None = None, rod: Rod | None = None,
    change: Callable[[Planned], Planned] = lambda trial: trial,
) -> Recording:  # fmt: skip
    """Seven trials or so of a bench day, every third row."""
    robot, motions, instruments, laws = (np.random.default_rng([seed, n]) for n in range(4))
    day, noise = bench_day(design, motions), INSTRUMENTS.draw(instruments, coloured=False)
    some = [change(replace(t, time=t.time[::3])) for t in day.trials if t.name in SHOWN]
    truth = [] if effect is None else [replace(all_effects()[effect].draw(laws), strength=3.0)]
    day = replace(day, trials=tuple(some))
    write_set(folder, "a few trials", day, run(built(robot, rod), truth, day), noise, instruments, displacement=True)
    return read(folder)


# ---- robots ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("design", "seed"), [("sideways", 1), ("by_current", 3)])
def test_a_continuum_robot_raises_none_however_it_is_driven(design: str, seed: int, tmp_path: Path) -> None:
    """By lengths: among the fine instruments below."""
    assert said(made(tmp_path / "set", design, seed)) == []


@pytest.mark.parametrize(
    "effect", ["camera_misalignment", "load_cell_gain", "base_tilt", "tip_payload", "tendon_routing", "contact"]
)
def test_an_effect_is_no_mistake_in_the_file(effect: str, tmp_path: Path) -> None:
    assert said(made(tmp_path / "set", "hanging", 4, effect)) == []


def test_a_two_link_finger_raises_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = two_link.planned
    monkeypatch.setattr(two_link, "planned", lambda rng: [t for t in every(rng) if t.seconds < 50.0][:7])
    two_link.write_day(tmp_path / "set", None, 5)
    assert said(read(tmp_path / "set")) == []


@pytest.mark.parametrize("play", [0.0, 2.0])
def test_a_jaw_raises_none(play: float) -> None:
    assert said(jaw_day(np.deg2rad(play)), JAW) == []


# ---- what is unusual and right -----------------------------------------------------------------------------------------------


@cache
def friday() -> Recording:
    """Eight trials of the sample, every third row."""
    names = ("slow_1", "slow_2", "fast_3", "pair_3", "hold_2", "wander_1", "circle_1", "circle_2")
    trials = tuple(_every(t, 3) for t in FRIDAY.trials if t.label in names)
    return replace(FRIDAY, trials=trials)


def repeated(step: float) -> Recording:
    """Two trials that read alike but for the camera's noise (m), by a camera that shows whole steps (m)."""
    noise, of = np.random.default_rng(0), friday()
    again = next(t for t in of.trials if t.label == "circle_1")
    shaken = {n: v + 0.25e-3 * noise.normal(size=v.shape) if n.startswith("disk") else v for n, v in again.values.items()}
    other = replace(again, name="circle_2.csv", values=shaken, start=9e4)
    return changed(rounded(step), replace(of, trials=(*(t for t in of.trials if t.label != "circle_2"), other)))


def _every(trial: Trial, step: int) -> Trial:
    return replace(trial, time=trial.time[::step], values={n: v[::step] for n, v in trial.values.items()})


def changed(change: Callable[[Trial], Trial], recording: Recording | None = None) -> Recording:
    of = recording or friday()
    return replace(of, trials=tuple(change(t) for t in of.trials))


def moved(turn: np.ndarray, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Callable[[Trial], Trial]:
    """Markers (m) turned by a matrix and shifted."""

    def change(trial: Trial) -> Trial:
        values = dict(trial.values)
        for k in range(1, 9):
            names = [f"disk_{k}_{a}" for a in "xyz"]
            at = np.stack([values[n] for n in names], axis=1) @ turn.T + shift
            values |= dict(zip(names, at.T, strict=True))
        return replace(trial, values=values)

    return change


def slower(factor: float) -> Callable[[Trial], Trial]:
    """All of a day, pauses too."""
    return lambda t: replace(t, time=t.time * factor, start=None if t.start is None else t.start * factor)


def room(celsius: float) -> Callable[[Trial], Trial]:
    return lambda t: replace(t, conditions={**t.conditions, "ambient_temperature": 273.15 + celsius})


def rounded(step: float) -> Callable[[Trial], Trial]:
    """A camera that shows whole steps (m)."""
    return lambda t: replace(t, values={n: np.round(v / step) * step if n.startswith("disk") else v for n, v in t.values.items()})


def noisier(factor: float) -> Recording:
    """Declared noise too large or too small by a factor that a careless datasheet may be off by."""
    return replace(friday(), channels=tuple(replace(c, noise=c.noise and factor * c.noise) for c in friday().channels))


def touching(recording: Recording) -> Recording:
    """No pause between trials, starts in whole seconds."""
    now, trials = 0.0, []
    for t in recording.trials:
        trials.append(replace(t, start=float(np.floor(now))))
        now += float(t.time[-1] - t.time[0])
    return replace(recording, trials=tuple(trials))


def tilted(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def under(size: float) -> Recording:
    return replace(friday(), gravity=np.array([0.0, 0.0, size]))


UNUSUAL: dict[str, Callable[[], Recording]] = {
    "nothing": friday,
    "a log that takes its time": lambda: changed(slower(75.0)),
    "a log as fast as it goes": lambda: changed(slower(0.21 / 9.0)),
    "trials without a start": lambda: changed(lambda t: replace(t, start=None)),
    "trials without a pause": lambda: touching(friday()),
    "a yard in winter": lambda: changed(room(-14.0)),
    "a room in the sun": lambda: changed(room(48.0)),
    "gravity at the equator": lambda: under(9.78),
    "gravity in round numbers": lambda: under(9.8),
    "a camera nobody has aligned": lambda: changed(moved(tilted(15.0), (2e-3, -2e-3, 1e-3))),
    "markers glued on a tenth too far out": lambda: changed(moved(np.diag([1.0, 1.0, 1.1]))),
    "a camera of one millimetre": lambda: changed(rounded(1e-3)),
    "a repeat by a camera of half a millimetre": lambda: repeated(5e-4),
    "noise said ten times too large": lambda: noisier(10.0),
    "noise said eight times too small": lambda: noisier(0.125),
}


@pytest.mark.parametrize("what", UNUSUAL)
def test_what_is_unusual_and_right_raises_none(what: str) -> None:
    assert said(UNUSUAL[what]()) == []


@dataclass
class Fine:
    """Instruments ten to a hundred times as good as usual: a laser tracker, an encoder of a micrometre."""

    marker: float

    def draw(self, rng: np.random.Generator, coloured: bool) -> Noise:
        return replace(Noise.draw(rng, coloured), marker=self.marker, load_cell=1e-3, displacement=1e-6)


@pytest.mark.parametrize(("design", "rows"), [("sideways", 1), ("hanging", 3), ("by_length", 1)])
def test_an_instrument_that_is_really_that_good_raises_none(
    design: str, rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What neighbouring readings differ by is then the motion, and what the description is off by."""
    monkeypatch.setattr(sys.modules[__name__], "INSTRUMENTS", Fine(1e-5))
    assert said(changed(lambda t: _every(t, rows), made(tmp_path / "set", design, 6))) == []


@pytest.mark.parametrize("size", [0.1, 2.5])
def test_a_robot_that_is_really_small_or_large_raises_none(size: float, tmp_path: Path) -> None:
    """12 mm and 300 mm: the same shapes under tensions as the square of the size, its weight as its volume."""
    whole = Rod()
    rod = replace(
        whole, pitch=size * whole.pitch, backbone_radius=size * whole.backbone_radius, hole_radius=size * whole.hole_radius,
        backbone_mass=size**3 * whole.backbone_mass, disk_mass=size**3 * whole.disk_mass,
    )  # fmt: skip
    described = load("continuum")
    power = {
        "backbone.length": 1,
        "backbone.radius": 1,
        "disks.radius": 1,
        "tendons.radius": 1,
        "backbone.mass": 3,
        "disks.mass": 3,
    }

    def scaled(p: Parameter) -> Parameter:
        by = size ** power.get(re.sub(r"_\d+$", "", p.name), 1 if p.name.startswith(("disks.pitch", "markers.")) else 0)
        return replace(p, value=by * p.value, low=by * p.low, high=by * p.high, std=p.std and by * p.std)

    def loaded(trial: Planned) -> Planned:
        return replace(trial, command=size**2 * trial.command, payload=size**2 * trial.payload)

    robot = replace(described, parameters=tuple(scaled(p) for p in described.parameters))
    assert said(made(tmp_path / "set", "hanging", 9, rod=rod, change=loaded), robot) == []


def test_a_tendon_that_was_not_pulled_is_not_dead_and_alike_tendons_are_not_exchanged(tmp_path: Path) -> None:
    """Tendons 1 and 2 pulled alike, tendon 3 slack: nobody can tell which of the two is which."""

    def alike(trial: Planned) -> Planned:
        return replace(trial, command=np.column_stack([trial.command[:, 0], trial.command[:, 0], np.zeros(len(trial.command))]))

    assert said(made(tmp_path / "set", "sideways", 7, change=alike)) == []
