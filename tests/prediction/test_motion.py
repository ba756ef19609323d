"""Motion in statics: damping is left out where shapes are not as late as it says; what steps add is added where it shows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.mechanics.mjcf.models import PENDULUM
from tests.mechanics.mjcf.models import robot as pendulum
from tools.simulators.rod.mechanics.rod import Rod, follow
from twin.measurements import Channel, Recording, Trial
from twin.prediction.motion import in_steps_that_suffice, motion_as_measured, swings, with_swing
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3))
TIP = tuple(Channel(f"disk_8_{a}", "output", "mm", 2.5e-4) for a in "xyz")
SIGMA = np.full(len(TIP), 2.5e-4)  # m
DAMPED = ROBOT.value("damping.time")  # s


@cache
def tips(late: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (n,) s, tensions (n, 3) N at up to 3 N/s, and tips (n, 3) m of the independent rod `late` by a first-order lag (s)."""
    time = np.arange(0.0, 4.0, 0.04)
    fine = np.arange(0.0, 4.0, 0.001)
    pull = 1.0 - np.cos(3.0 * fine)
    felt = np.zeros_like(pull)
    for k in range(1, len(fine)):
        felt[k] = felt[k - 1] + (pull[k] - felt[k - 1]) * (1.0 - np.exp(-1e-3 / late)) if late else pull[k]
    steps = np.column_stack([felt[::40], 0.0 * time, 0.0 * time])
    drive = np.column_stack([pull[::40], 0.0 * time, 0.0 * time])
    return time, drive, follow(Rod(), steps).disks[:, -1]


def left_out(late: float, n: int = 2, stiff: float = 1.0) -> bool:
    """Whether damping is left out of the prediction of n trials, by a twin that is `stiff` times as stiff as the robot; if it is
    not as stiff its camera is 0.15 m off, too."""
    time, drive, tip = tips(late)
    tip = tip + np.array([0.15, -0.1, 0.05]) * (stiff != 1.0)
    rng, trials = np.random.default_rng(1), []
    for k in range(n):
        noisy = tip + rng.normal(0.0, 2.5e-4, tip.shape)
        values = {c.name: drive[:, i] for i, c in enumerate(PULLS)} | {c.name: noisy[:, i] for i, c in enumerate(TIP)}
        trials.append(Trial(f"{k}.csv", time, values, start=100.0 * k))
    day = Recording("continuum", "test", "hardware", np.zeros(3), (*PULLS, *TIP), tuple(trials))
    E = stiff * ROBOT.value("backbone.youngs_modulus")
    prepared, twin = prepare(day, ROBOT), Twin(ROBOT, {"backbone.youngs_modulus": E})
    assert all(i.damped for i in prepared.inputs)
    with_it = [t.outputs(twin, prepared) for t in simulate(twin, prepared)]
    chosen, predicted = motion_as_measured(prepared, twin, with_it, range(n))
    out = not any(i.damped for i in chosen.inputs)
    assert out == any("damping" in words for words in chosen.notices)
    again = next(t.outputs(twin, chosen) for t in simulate(twin, chosen))
    np.testing.assert_allclose(predicted[0], again, rtol=0.0, atol=1e-12)  # rounding, where steps' difference is added
    return out


@pytest.mark.parametrize(("late", "out"), [(0.0, True), (DAMPED, False), (5.0 * DAMPED, False)], ids=["at once", "damped", "later"])
def test_damping_is_left_out_where_shapes_follow_at_once(late: float, out: bool) -> None:
    """10 ms at 3 N/s are 0.03 N, some 0.5 mm at the tip, against 0.25 mm of noise in 200 rows."""
    assert left_out(late) == out


@pytest.mark.parametrize(("late", "out"), [(0.0, True), (DAMPED, False)], ids=["at once", "damped"])
@pytest.mark.parametrize("stiff", [0.9, 1.1])
def test_neither_stiffness_nor_a_camera_off_decides(late: float, out: bool, stiff: float) -> None:
    """A camera 0.15 m off makes errors a hundred times those of the damping, all of one sign."""
    assert left_out(late, 2, stiff) == out


@cache
def swung(E: float) -> tuple[PreparedRecording, tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Two seconds of pulls at 1.5 Hz, and what statics and steps of a robot of `E` times the stiffness show of them."""
    time = np.arange(0.0, 2.0, 0.02)
    pull = 0.6 * (1.0 - np.cos(2.0 * np.pi * 1.5 * time))
    values = {c.name: pull if i == 0 else 0.0 * time for i, c in enumerate(PULLS)} | {c.name: 0.0 * time for c in TIP}
    day = Recording("continuum", "test", "hardware", np.zeros(3), (*PULLS, *TIP), (Trial("0.csv", time, values),))
    prepared, twin = prepare(day, ROBOT), softer(E)
    static, steps = ([t.outputs(twin, prepared) for t in simulate(twin, prepared, dynamic=dynamic)] for dynamic in (False, True))
    return prepared, tuple(static), tuple(steps)


def softer(E: float) -> Twin:
    return Twin(ROBOT, {"backbone.youngs_modulus": E * ROBOT.value("backbone.youngs_modulus")})


def rms(differences: np.ndarray) -> float:
    return float(np.sqrt(np.mean(differences**2)))


def test_what_steps_add_to_statics_makes_up_for_motion() -> None:
    """The addition is exact for the robot it is of, by definition, and for one of 3 % other stiffness leaves a small part."""
    prepared, static, steps = swung(1.0)
    measured = replace(prepared, measured=steps)
    assert swings(prepared, static, SIGMA)
    found = with_swing(measured, softer(1.0), static, [0])
    assert found is not None
    moving, predicted = found
    np.testing.assert_array_equal(predicted[0], steps[0])
    again = simulate(softer(1.0), moving)[0].outputs(softer(1.0), moving)
    np.testing.assert_allclose(again, steps[0], rtol=0.0, atol=1e-12)
    other_static, other_steps = (of[0] for of in swung(0.97)[1:])
    other = simulate(softer(0.97), moving)[0].outputs(softer(0.97), moving)
    assert rms(other - other_steps) < 0.2 * rms(other_static - other_steps)


def test_nothing_is_added_where_statics_is_nearer_or_motion_is_slow() -> None:
    """A robot that follows statics exactly, and commands a hundred times slower."""
    prepared, static, _ = swung(1.0)
    assert with_swing(replace(prepared, measured=static), softer(1.0), static, [0]) is None
    slow = replace(prepared, inputs=(replace(prepared.inputs[0], time=100.0 * prepared.inputs[0].time),))
    assert not swings(slow, static, SIGMA)


def test_long_logs_are_not_stepped_through() -> None:
    """The same two seconds until they last for more than five minutes."""
    prepared, static, steps = swung(1.0)
    n = 160
    long = replace(prepared, inputs=n * prepared.inputs, measured=n * steps)
    assert swings(long, n * static, SIGMA)
    assert with_swing(long, softer(1.0), n * static, [0]) is None


@pytest.mark.parametrize(("step", "taken", "told"), [(2e-2, 5e-3, True), (4e-3, 2e-3, False), (1e-4, 1e-4, False)])
def test_steps_are_halved_until_they_suffice(tmp_path: Path, step: float, taken: float, told: bool) -> None:
    """A pendulum driven at 1 Hz swings by 0.4 rad for 4 s: steps of 20 and of 10 ms are 1.4 mrad (RMS) apart, 1.4 sigma.

    Their error falls with the square: two halvings leave 0.09 sigma, which is told.
    """
    hinge = ' stiffness="1" damping="0.02"'
    swing = pendulum(tmp_path, PENDULUM.format(joint=hinge, key=""), step=step)
    channels = (Channel("actuator.push.ctrl", "input", "1", 1e-6), Channel("joint.hinge.position", "output", "rad", 1e-3))
    time = np.arange(0.0, 4.0, 0.04)
    values = {channels[0].name: 0.4 * np.sin(6.0 * time), channels[1].name: 0.0 * time}
    day = Recording("pendulum", "test", "hardware", swing.gravity, channels, (Trial("0.csv", time, values),))
    prepared, twin = in_steps_that_suffice(prepare(day, swing), Twin.of(swing))
    assert twin.robot.structure["timestep"] == taken
    assert any(f"set timestep = {0.5 * taken:g}" in words for words in prepared.notices) == told
    assert any("steps of" in words for words in prepared.notices) == (taken < step)
    twin.save(tmp_path / "twin.toml")
    assert Twin.load(tmp_path).robot.structure["timestep"] == taken


SLIDE = """<mujoco><option gravity="0 0 0"/><worldbody><geom type="sphere" size="0.01" pos="0.05 0 0"/>
  <body><joint name="way" type="slide" axis="1 0 0" damping="20"/><geom type="sphere" size="0.01" mass="0.1"/></body>
  </worldbody><actuator><position name="push" joint="way" kp="1000" ctrlrange="-1 1"/></actuator></mujoco>"""


def test_bodies_that_touch_in_the_motion_described_are_told(tmp_path: Path) -> None:
    """A ball of 2 cm on a slide is pushed from 0 to 10 cm in 1 s, towards a ball on the world 5 cm away, which it meets at 3 cm.

    It follows 20 ms late, its damping over its kp.
    """
    slide = pendulum(tmp_path, SLIDE)
    channels = (Channel("actuator.push.ctrl", "input", "m", 1e-6), Channel("joint.way.position", "output", "m", 1e-4))
    time = np.linspace(0.0, 1.0, 101)

    def told(way: float) -> list[str]:
        values = {channels[0].name: way * time, channels[1].name: 0.0 * time}
        day = Recording("slide", "test", "hardware", slide.gravity, channels, (Trial("0.csv", time, values),))
        prepared, _ = in_steps_that_suffice(prepare(day, slide), Twin.of(slide))
        return [words for words in prepared.notices if "touch" in words]

    assert told(0.02) == []
    (words,) = told(0.1)
    assert words.startswith("world and body_2 touch in the motion described (0.csv from 0.32 s)")


def test_tensions_at_driven_lengths_show_damping() -> None:
    """Shortened by 1 mm/s at a constant rate, a body of one time constant is pulled by tau x' more, within
    5 %: the first half second, in which it starts, is left out. Inertia is 1e-3 sigma of a good load cell, this 2 sigma."""
    time = np.linspace(0.0, 4.0, 41)
    shorter = tuple(Channel(f"tendon_{i}_displacement", "input", "mm", 1e-6) for i in (1, 2, 3))
    cells = tuple(Channel(c.name, "output", "N", 1e-3) for c in PULLS)
    pull = 1e-3 * time * np.array([1.0, -0.5, -0.5])[:, None]
    values = {c.name: x for c, x in zip(shorter, pull, strict=True)} | {c.name: 0.0 * time for c in cells}
    day = Recording("continuum", "test", "hardware", np.zeros(3), (*shorter, *cells), (Trial("0.csv", time, values),))
    prepared, twin = prepare(day, ROBOT), softer(1.0)
    static, steps = (simulate(twin, prepared, dynamic=dynamic)[0].outputs(twin, prepared)[:, 0] for dynamic in (False, True))
    late = DAMPED * np.gradient(static, time)
    assert np.median((steps - static)[5:]) / np.median(late[5:]) == pytest.approx(1.0, rel=0.05)
    assert swings(prepared, [np.tile(static[:, None], 3)], np.full(3, 1e-3))
