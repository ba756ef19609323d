"""Forward and inverse kinematics against the twin's own prediction, each other, and a rod under a tip wrench with closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tools.benchmarks.solvers.tip_wrench import tip_wrench
from twin.body import Drive, Loads, Problem, Route
from twin.effects import effect_class
from twin.foundation.errors import TwinError
from twin.mechanics.rod import Equilibrium
from twin.prediction.kinematics import HeatedRobot, LoadedRobot, inverse
from twin.prediction.kinematics.inverse import _enclosed
from twin.prediction.twin import Twin
from twin.robots import load

HANGING = Loads(np.array([0.0, 0.0, 9.81]))
SIDEWAYS = Loads(np.array([0.0, -9.81, 0.0]), payload=0.01)
PLAIN = Twin(load("continuum"))
RUBBING = Twin(load("continuum"), {}, (effect_class("tendon_friction")({"mu": 0.15}, 3),))
both = pytest.mark.parametrize("twin", [PLAIN, RUBBING], ids=["plain", "rubbing"])


@both
def test_forward_is_what_a_trial_gives(twin: Twin) -> None:
    """The same tensions as a log, through the trial's own solve."""
    when = np.linspace(0.0, 1.0, 120)
    tension = np.stack([2.5 * np.sin(3 * when) ** 2, 1.5 * when, 0.3 * np.cos(2 * when) ** 2], axis=1)
    robot = LoadedRobot(twin, SIDEWAYS)
    route = effect_class("tendon_friction")({"mu": 0.15}, 3).route() if twin is RUBBING else Route()
    path = Equilibrium(load("continuum").build()).solve(Problem(when, tension, SIDEWAYS, route))
    stepped = np.array([robot.pull(T).markers for T in tension])
    # The trial ramps its first tensions in other parts, which friction remembers (RAMP in equilibrium/trial.py: 0.015 mm).
    np.testing.assert_allclose(stepped, path.markers, atol=2e-5 if twin is RUBBING else 2e-7)  # two solves within 1e-7 rad


def test_the_stride_on_the_way_does_not_matter() -> None:
    """One long pull against the same in hundredths: what friction remembers differs by less than the twin's own accuracy."""
    rng = np.random.default_rng(0)
    far, fine = LoadedRobot(RUBBING, SIDEWAYS), LoadedRobot(RUBBING, SIDEWAYS)
    way = [np.zeros(3), *(rng.uniform(0.0, 3.5, 3) * rng.permutation([1.0, 1.0, 0.1]) for _ in range(8))]
    for a, b in pairwise(way):
        there = far.pull(b).tip
        for k in range(1, 101):
            slowly = fine.pull(a + k / 100 * (b - a)).tip
        assert np.linalg.norm(there - slowly) < 1e-4  # m: 0.08 % of the length


@both
@pytest.mark.parametrize("by_sector", [True, False])
def test_what_the_robot_reaches_is_found(twin: Twin, by_sector: bool) -> None:
    rng = np.random.default_rng(1)
    robot, other = LoadedRobot(twin, SIDEWAYS), LoadedRobot(twin, SIDEWAYS)
    for _ in range(20):
        tension = rng.uniform(0.0, 3.8, 3)
        tension[rng.integers(3)] = 0.0
        there = other.pull(tension).tip
        answer = inverse(robot, there, limit=4.0, by_sector=by_sector)
        assert answer.reason is None
        assert np.linalg.norm(robot.pull(answer.tension).tip - there) < 1e-4
        if by_sector:
            assert (answer.tension > 1e-9).sum() <= 2
            assert answer.tension == pytest.approx(tension, abs=0.02)  # one answer: that which led there
        other.restore(robot.state())


def test_a_point_on_a_tendons_own_line_needs_that_tendon_alone() -> None:
    robot = LoadedRobot(PLAIN, HANGING)
    for i in range(3):
        tension = 2.0 * np.eye(3)[i]
        answer = inverse(robot, robot.pull(tension).tip)
        robot.rest()
        np.testing.assert_allclose(answer.tension, tension, atol=1e-3)  # 1e-5 m where a newton moves the tip by centimetres


def test_friction_makes_the_answer_depend_on_where_one_comes_from() -> None:
    """More tension is needed on the way up than on the way down: by the capstan's loss there and back."""
    robot = LoadedRobot(RUBBING, HANGING)
    tip = robot.pull(np.array([2.0, 0.0, 0.0])).tip
    robot.pull(np.array([3.5, 0.0, 0.0]))
    from_above = inverse(robot, tip, within=1e-3)
    assert from_above.reason is None
    robot.rest()
    from_below = inverse(robot, tip)
    assert from_below.tension[0] == pytest.approx(2.0, abs=1e-3)
    turned = np.radians(70.0)  # what physics.md gives for 2 N without friction; the far holes have hardly slid back yet
    assert 2.0 * np.exp(-2 * 0.15 * turned) < from_above.tension[0] < 2.0 * np.exp(-0.25 * 0.15 * turned)


@pytest.mark.parametrize(
    ("tip", "why"),
    [([0.1, 0.0, 0.1], "mm from the base; the robot is 120.0 mm long"), ([0.0, 0.04, 0.05], "surface"), ([0.06, 0.06, 0.1], "mm")],
)
def test_what_is_out_of_reach_is_said(tip: list[float], why: str) -> None:
    answer = inverse(LoadedRobot(PLAIN, HANGING), np.array(tip))
    assert answer.reason is not None
    assert why in answer.reason
    assert answer.distance > 1e-4


def test_a_limit_is_kept_and_named() -> None:
    robot = LoadedRobot(PLAIN, HANGING)
    tip = robot.pull(np.array([0.0, 3.0, 0.0])).tip
    robot.rest()
    answer = inverse(robot, tip, limit=2.0)
    assert answer.tension.max() <= 2.0 + 1e-9
    assert answer.reason is not None
    assert "tendon 2 would need more than the 2 N allowed" in answer.reason


@both
def test_tendons_that_need_not_pull_keep_what_they_rest_at(twin: Twin) -> None:
    """Springs are never slack: what three resting tendons and two that pull more reach is found again, none below its rest."""
    rng = np.random.default_rng(6)
    robot, other = LoadedRobot(twin, SIDEWAYS), LoadedRobot(twin, SIDEWAYS)
    for _ in range(10):
        resting = rng.uniform(0.5, 1.5, 3)
        tension = resting + rng.uniform(0.0, 2.0, 3) * rng.permutation([1.0, 1.0, 0.0])
        there = other.pull(tension).tip
        answer = inverse(robot, there, resting=resting)
        assert answer.reason is None
        assert answer.tension.min() >= resting.min() - 1e-9
        assert (answer.tension - resting > 1e-9).sum() <= 2
        assert answer.tension == pytest.approx(tension, abs=0.02)  # one answer, as without resting tensions
        robot.pull(tension)


def test_no_point_is_refused() -> None:
    with pytest.raises(TwinError, match="three finite numbers"):
        inverse(LoadedRobot(PLAIN), np.array([0.0, np.nan, 0.1]))


def test_load_cells_that_misread_are_followed() -> None:
    """A cell that shows 10 % more must be pulled to 10 % more for the same shape."""
    gain = Twin(load("continuum"), {}, (effect_class("load_cell_gain")({"gain_1": 1.1}, 3),))
    plain, off = LoadedRobot(PLAIN, HANGING), LoadedRobot(gain, HANGING)
    there = plain.pull(np.array([2.0, 0.5, 0.0]))
    np.testing.assert_allclose(off.pull(np.array([2.2, 0.5, 0.0])).tip, there.tip, atol=1e-9)
    off.rest()
    np.testing.assert_allclose(inverse(off, there.tip).tension, [2.2, 0.5, 0.0], atol=1e-3)


@both
def test_the_gradient_is_the_difference(twin: Twin) -> None:
    robot = LoadedRobot(twin, SIDEWAYS)
    start = np.array([2.0, 1.0, 0.2])
    robot.pull(start)
    robot.pull(start + 0.05)  # all slide towards the base, and go on doing so
    gradient, here, step = robot.gradient(), robot.state(), 1e-4
    for t in range(3):
        robot.restore(here)
        before = robot.shape().markers
        moved = (robot.pull(start + 0.05 + step * np.eye(3)[t]).markers - before) / step
        scale = np.abs(moved).max()
        np.testing.assert_allclose(gradient[t], moved, atol=0.02 * scale)  # some holes leave pre-sliding within the step


@settings(max_examples=10, deadline=None)
@given(force=st.floats(0.2, 4.0), tendon=st.integers(0, 2))
def test_the_tip_wrench_rod_is_a_circle_without_weight(force: float, tendon: int) -> None:
    """One tendon, no gravity: constant curvature F L_0 / EI, the closed form of physics.md 1.6."""
    robot = load("continuum")
    v = {p.name: p.value for p in robot.parameters}
    bending = v["backbone.youngs_modulus"] * np.pi * v["backbone.radius"] ** 4 / 4
    curvature, length = force * v["tendons.radius"] / bending, 0.12
    angle = v[f"tendons.angle_{tendon + 1}"]
    across = (1 - np.cos(curvature * length)) / curvature
    circle = [across * np.cos(angle), across * np.sin(angle), np.sin(curvature * length) / curvature]
    tip = tip_wrench(robot, force * np.eye(3)[tendon], Loads(np.zeros(3)))[-1]
    np.testing.assert_allclose(tip, circle, atol=1e-7)


def test_the_tip_wrench_rod_is_near_the_twin_where_both_hold() -> None:
    """Small loads: tendons at eight disks pull as one at the tip does. At large ones they part, which is what the paper shows."""
    for tension in ([0.3, 0.0, 0.0], [0.2, 0.4, 0.0]):
        rod = tip_wrench(load("continuum"), np.array(tension), HANGING)[-1]
        twin = LoadedRobot(PLAIN, HANGING).pull(np.array(tension)).tip
        assert np.linalg.norm(rod - twin) < 5e-4  # m: 0.4 % of the length


def test_springs_step_by_step_are_a_trial_of_currents() -> None:
    """The same currents as a log, through the trial's own solve: heat, tensions and shape."""
    rng = np.random.default_rng(2)
    when = np.arange(0.0, 40.0, 0.5)
    current = np.repeat(rng.uniform(0.0, 2.0, (8, 3)), 10, axis=0)
    robot = HeatedRobot(RUBBING, SIDEWAYS)
    assert robot.shape().markers.shape == (9, 3)
    solved = Equilibrium(load("continuum").build()).solve(Problem(
        when, current, SIDEWAYS, effect_class("tendon_friction")({"mu": 0.15}, 3).route(), (Drive.CURRENT,) * 3,
        heating=RUBBING.heating(np.full(len(when), 296.15)),
    ))  # fmt: skip
    for i in range(1, len(when)):
        tension = robot.step(current[i - 1], when[i] - when[i - 1])
        np.testing.assert_allclose(robot.spring_temperature, solved.others["temperature"][i], atol=1e-6)  # K
        np.testing.assert_allclose(tension, solved.tension[i], atol=1e-5)  # N: two solves within 1e-7 rad
        np.testing.assert_allclose(robot.shape().markers, solved.markers[i], atol=5e-7)
    assert np.ptp(solved.tension) > 1.0


def test_a_soft_robot_is_one_of_a_softer_material() -> None:
    """At 10 K above where stiffness is quoted and 2 % a kelvin: as a backbone of 0.8 E, in shape, tensions, their derivatives and
    the tensions a point needs."""
    soft = Twin(load("continuum"), {}, (effect_class("temperature_softening")({"rate": 0.02}, 3),))
    nominal = next(p.value for p in load("continuum").parameters if p.name == "backbone.youngs_modulus")
    softer = Twin(load("continuum"), {"backbone.youngs_modulus": 0.8 * nominal})
    loads = Loads(np.array([0.0, -9.81, 2.0]), payload=0.01, force=np.array([0.02, 0.0, 0.01]))
    warm, other = LoadedRobot(soft, loads, temperature=306.15), LoadedRobot(softer, loads)
    for tension in ([0.0, 0.0, 0.0], [1.5, 0.0, 0.4], [0.5, 2.0, 0.0]):
        a, b = warm.pull(np.array(tension)), other.pull(np.array(tension))
        np.testing.assert_allclose(a.markers, b.markers, atol=5e-7)  # m: two solves within 1e-7 rad
        np.testing.assert_allclose(a.displacement, b.displacement, atol=5e-8)
        np.testing.assert_allclose(a.tension, tension, atol=1e-12)
        np.testing.assert_allclose(warm.gradient(), other.gradient(), atol=5e-6)  # m/N, of some 3e-2
    warm.set_payload(0.02)
    other.set_payload(0.02)
    np.testing.assert_allclose(warm.shape().markers, other.shape().markers, atol=5e-7)
    tip = warm.shape().tip
    for robot in (warm, other):
        robot.rest()
    resting = np.array([0.3, 0.4, 0.6])
    further = warm.pull(np.array([0.9, 2.0, 0.6])).tip
    warm.rest()
    some = [inverse(robot, further, resting=resting).tension for robot in (warm, other)]
    for found in some:
        assert found == pytest.approx([0.9, 2.0, 0.6], abs=0.02)  # one answer: the third tendon keeps what it rests at
    answers = [inverse(robot, tip) for robot in (warm, other)]
    np.testing.assert_allclose(answers[0].tension, answers[1].tension, atol=2e-3)  # N: 1e-5 m where 1 N moves centimetres
    assert answers[0].tension == pytest.approx([0.5, 2.0, 0.0], abs=0.05)


def test_a_straight_tendons_lever_is_its_holes_place() -> None:
    """By which it shortens and by which it moves the tip; and one newton per EI / (L r) of bend."""
    robot = LoadedRobot(PLAIN, HANGING)
    v = {p.name: p.value for p in load("continuum").parameters}
    angle = np.array([v[f"tendons.angle_{t}"] for t in (1, 2, 3)])
    hole = v["tendons.radius"] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for lever in robot.lever_arms:
        np.testing.assert_allclose(lever, hole, atol=1e-12)
    np.testing.assert_allclose(robot.directions, angle, atol=1e-6)
    bending = v["backbone.youngs_modulus"] * np.pi * v["backbone.radius"] ** 4 / 4
    assert robot.pull_per_bend == pytest.approx(bending / (robot.length * v["tendons.radius"]), rel=1e-6)


@pytest.mark.parametrize(
    ("a", "b", "direction", "inside"),
    [
        (0, 120, 30, 30),
        (0, 120, 100, 20),
        (0, 120, 150, -30),
        (0, 120, -20, -20),
        (300, 60, 350, 50),
        (300, 60, 100, -40),
        (240, 0, 250, 10),
    ],
)
def test_how_far_inside_a_sector_a_direction_lies(a: float, b: float, direction: float, inside: float) -> None:
    """In degrees; also of sectors that pass zero."""
    assert np.degrees(_enclosed(*np.radians([a, b, direction]))) == pytest.approx(inside)


def test_a_heated_robot_is_shown_as_a_trial_of_one_sample() -> None:
    robot = HeatedRobot(PLAIN, HANGING)
    path = robot.solution()
    assert [len(x) for x in (path.status, path.q, path.tension, path.markers, path.path, path.others["temperature"])] == [1] * 6
    np.testing.assert_array_equal(path.markers[0][:8], robot.shape().markers[:8])
