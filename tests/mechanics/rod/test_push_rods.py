"""Rods, which push as well as pull: closed forms of a planar rod, mirror images, friction's loss, motion, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.other_continua import EI, LENGTH, NOWHERE, disks, off, robot
from twin.body import Drive, Loads, Problem, Route, Signals, Solution
from twin.effects import effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import DataError
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.chain import ChainState, force_balance
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.mechanics.rod.balance.tendon_actuation import BACKBONE_COMPLIANCE, LEAST_STRETCH
from twin.mechanics.rod.dynamics import Dynamics
from twin.prediction.kinematics import LoadedRobot
from twin.prediction.rollout import draw_controls
from twin.prediction.twin import Twin
from twin.robots import Robot

R, N_DISK = 8e-3, 8
PITCH = LENGTH / N_DISK
OPPOSITE = ([0.0, 180.0], "deg")
PULLED = np.linspace(0.0, 1.5, 16)  # N
BY_LENGTH = (Drive.DISPLACEMENT,) * 2


def pair(folder: Path, n_disk: int = N_DISK, rods: bool = True) -> Robot:
    """Two rods (or tendons) at 0 and 180 degrees, of a robot with `n_disk` disks."""
    even = ([1e3 * LENGTH / n_disk] * n_disk, "mm")
    return robot(
        folder, {"tendons": 2, "disks": n_disk, "rods": rods}, ("markers.axial_offset",), tendons__angle=OPPOSITE, disks__pitch=even
    )


@pytest.fixture(scope="module")
def rods(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return pair(tmp_path_factory.mktemp("rods"))


@pytest.fixture(scope="module")
def solver(rods: Robot) -> Equilibrium:
    return Equilibrium(rods.build())


def solved(solver: Equilibrium, command: np.ndarray, drives: tuple[Drive, ...] = (), **route: float) -> Solution:
    path = solver.solve(Problem(np.arange(float(len(command))), command, Loads(NOWHERE), Route(**route), drives))
    assert path.status.all()
    return path


def circle(turn: np.ndarray, n_disk: int = N_DISK) -> np.ndarray:
    """Disk centres (n, n_disk, 3) m of arcs that turn by `turn` (n,) rad, above zero, over the length."""
    s = np.arange(1, n_disk + 1) / n_disk
    angle = turn[:, None] * s
    return (LENGTH / turn)[:, None, None] * np.stack([1.0 - np.cos(angle), 0.0 * angle, np.sin(angle)], axis=2)


def test_a_pure_couple_bends_to_a_circle(solver: Equilibrium) -> None:
    """A pull T and a push T at +-r of rods that follow the backbone: the moment is 2 r T everywhere, so that it turns by
    theta = 2 r T L / EI. Arcs are longer than their chords by theta^2/24; the next order, 7 theta^4/5760 in an interval's 0.23 rad,
    is 3e-6 of a lever's length, 1e-5 of the travel of 100 mm."""
    T = PULLED[1:]
    turn = 2.0 * R * T * LENGTH / EI
    found = solved(solver, np.outer(T, [1.0, -1.0])).markers[:, :N_DISK]
    assert np.abs(found - circle(turn)).max() < 1e-6
    assert np.degrees(turn[-1]) > 100.0


def test_a_push_of_one_rod_is_the_mirrored_pull_of_the_other(solver: Equilibrium) -> None:
    """A rod that follows the backbone bends it by the moment r T alone, whatever it does along it: push 1 and pull 2 differ by
    nothing but their axial forces, which a backbone that does not stretch bears. Through the robot's axis both mirror."""
    for T in (0.1, 1.0):
        push, pull = (solved(solver, np.array([c])).markers[0, :N_DISK] for c in ([-T, 0.0], [0.0, T]))
        assert push[-1, 0] < -30e-3 * T
        np.testing.assert_allclose(push, pull, atol=5e-7)  # as above
    one, other = solved(solver, np.array([[-0.3, 0.8], [0.8, -0.3]])).markers[:, :N_DISK]
    np.testing.assert_allclose(one * [-1.0, 1.0, 1.0], other, atol=1e-7)  # 1e-7 rad of every hinge


@pytest.mark.parametrize("stretch", [0.0, 1e-4])
def test_a_rod_pushed_by_a_length_gives_way_by_its_compliance(solver: Equilibrium, stretch: float) -> None:
    """Rod 1 is let out by d, rod 2 bears nothing: d = |T| c, c = r^2 L / EI + stretch + compression, whatever the bend."""
    d = np.linspace(0.1e-3, 8e-3, 9)
    path = solved(solver, np.outer(d, [-1.0, 0.0]), (Drive.DISPLACEMENT, Drive.TENSION), stretch=stretch)
    c = R**2 * LENGTH / EI + max(stretch, LEAST_STRETCH) + BACKBONE_COMPLIANCE
    np.testing.assert_allclose(path.tension[:, 0], -d / c, rtol=5e-5)  # the next order of arcs; 2e-8 m count as closed
    assert not path.tension[:, 1].any()


def test_opposite_lengths_need_no_force_along_the_robot(solver: Equilibrium) -> None:
    """Rod 1 let out by d and rod 2 drawn in by d bend it by d / r: their forces are opposite, d / (2 r^2 L / EI + stretch)."""
    d = np.linspace(0.1e-3, 6e-3, 7)
    path = solved(solver, np.outer(d, [-1.0, 1.0]), BY_LENGTH)
    T = d / (2.0 * R**2 * LENGTH / EI + LEAST_STRETCH)
    # Held together the two give by no more than 3e-6 m/N: 3e-6 of their length, 2e-8 m and more, are 0.03 N alike in both.
    np.testing.assert_allclose(0.5 * np.diff(path.tension, axis=1)[:, 0], T, rtol=1e-4)
    np.testing.assert_allclose(path.tension.sum(axis=1), 0.0, atol=0.2)


def test_tangent_and_path_gradients_of_rods_belong_to_one_energy(solver: Equilibrium) -> None:
    """Under a push and a pull: J is the slope of r, and dr/dT is dpath/dq, at any shape."""
    q, T = np.random.default_rng(0).normal(0.0, 0.1, solver.model.nv), np.array([-2.0, 3.0])
    shape = (2, N_DISK)

    def balance(q: np.ndarray, T: np.ndarray, tangent: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        at = solver.statics(Problem(np.zeros(1), T[None], Loads(NOWHERE)))
        z, s, r, J = np.zeros(shape), np.zeros(shape), np.empty(q.size), np.empty((q.size if tangent else 0,) * 2)
        update_kinematics(at, q)
        force_balance(at, ChainState(T, q, np.zeros(shape), np.zeros(shape)), z, s, r, J)
        return r, J, s[:, 0].copy()

    e = 1e-5  # rad
    sides = [(balance(q + x, T), balance(q - x, T)) for x in e * np.eye(q.size)]
    slope = np.stack([(a[0] - b[0]) / (2 * e) for a, b in sides], axis=1)
    # N m/rad of 0.24: third derivatives times 1e-10, and the elastic part's own difference over 1e-6 rad
    np.testing.assert_allclose(balance(q, T, tangent=True)[1], slope, atol=1e-6)
    path = np.stack([(a[2] - b[2]) / (2 * e) for a, b in sides], axis=1)
    by_tension = np.stack([balance(q, T + x)[0] - balance(q, T - x)[0] for x in 0.5 * np.eye(2)])  # r is linear in T
    np.testing.assert_allclose(by_tension, path, atol=1e-9)


def test_held_rods_have_the_tensions_that_hold_the_same_shape(solver: Equilibrium) -> None:
    """Lengths taken from shapes under tensions of either sign give these tensions back, with tendons' friction too."""
    t = np.linspace(0.0, 2.0 * np.pi, 60)
    T = np.column_stack([0.8 * np.sin(t), -0.5 * np.sin(1.3 * t)])
    for mu in (0.0, 0.2):
        given = solved(solver, T, mu=mu, stretch=1e-4)
        u = solver.straight_path - given.path + 1e-4 * given.tension + BACKBONE_COMPLIANCE * given.tension.sum(axis=1)[:, None]
        held = solved(solver, u, BY_LENGTH, mu=mu, stretch=1e-4)
        # The first lengths are approached from zero alike. 2e-8 m of a gap are 2e-4 N for each 1e-4 m/N that rods give.
        np.testing.assert_allclose(held.tension, T, atol=5e-4)
        assert off(held.markers, given.markers) < 5e-6
        assert held.tension.min() < -0.3


def test_rods_hold_a_robot_that_gravity_would_buckle(solver: Equilibrium, tmp_path: Path) -> None:
    """Upright under a payload past buckling, P L^2 / EI > pi^2 / 4: between tendons paid out no straight shape is stable; rods at
    zero hold it, and it is not called unstable."""
    loads = Loads(np.array([0.0, 0.0, -9.81]), 0.035)
    at_zero = Problem(np.arange(2.0), np.zeros((2, 2)), loads, Route(stretch=4e-6), BY_LENGTH)
    held = solver.solve(at_zero)
    assert held.status.all()
    assert not held.unstable_start
    assert off(held.markers[-1, :N_DISK], circle(np.array([1e-9]))[0]) < 1e-6
    bare = solver.solve(Problem(np.zeros(1), np.zeros((1, 2)), loads))
    assert bare.unstable_start


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_friction_along_a_rod_takes_work_whether_it_pulls_or_pushes(solver: Equilibrium, sign: float) -> None:
    """Pulled or pushed to 0.7 N and back: the loop of tension over shortening encloses the work that friction takes, none without
    friction. To first order it is mu |T| theta times the travel past each of seven holes, there and back. Friction itself takes
    some of the bend, which makes it less: a quarter at mu 0.1, and less than twice as much at mu 0.2."""
    T = sign * 0.7 * np.concatenate([np.linspace(0.0, 1.0, 60), np.linspace(1.0, 0.0, 60)])
    area = []
    for mu in (0.0, 0.1, 0.2):
        path = solved(solver, np.column_stack([T, 0.0 * T]), mu=mu, presliding=2e-5)
        area.append(float(np.trapezoid(path.tension[:, 0], -path.path[:, 0])))
    assert abs(area[0]) < 1e-3 * area[1]
    assert 0.0 < 1.7 * area[1] < area[2] < 2.0 * area[1]
    theta = R * 0.7 * PITCH / EI  # of an interval at the end
    travel = R * theta * np.arange(N_DISK - 1, 0, -1)  # of the rod past each hole
    assert area[1] == pytest.approx(
        2.0 * 0.1 * 0.7 * theta * travel.sum() / 3.0, rel=0.25
    )  # int T theta dx, all growing alike: a third


def test_motion_of_rods_comes_to_the_statics(rods: Robot, solver: Equilibrium) -> None:
    """Stepped for 3 s towards lengths, and tensions, that are then held: at rest as by statics, with pushes in both."""
    t = np.linspace(0.0, 3.0, 31)
    ramp = np.minimum(t, 1.0)[:, None]
    dynamics = Dynamics(rods.build())
    for command, drives in ((ramp * [-1e-3, 1e-3], BY_LENGTH), (ramp * [-0.5, 0.2], ())):
        problem = Problem(t, command, Loads(NOWHERE), Route(stretch=2e-5), drives)
        moved, still = dynamics.solve(problem), solver.solve(problem)
        assert moved.status.all()
        assert off(moved.markers[-1], still.markers[-1]) < 0.1e-3
        np.testing.assert_allclose(moved.tension[-1], still.tension[-1], atol=5e-3)
        assert still.tension[-1].min() < -0.05


def test_tendons_of_the_same_robot_are_slack_where_rods_push(tmp_path: Path) -> None:
    tendons = Equilibrium(pair(tmp_path, rods=False).build())
    np.testing.assert_allclose(disks(tendons, [-1.0, 0.5]), disks(tendons, [0.0, 0.5]), atol=0)
    held = solved(tendons, np.array([[-1e-3, 0.5e-3]]), BY_LENGTH)
    assert held.tension[0, 0] == 0.0
    assert held.tension[0, 1] > 0.0


def test_what_needs_rope_or_slack_is_not_for_rods(rods: Robot, tmp_path: Path) -> None:
    body, tendons = rods.build(), pair(tmp_path, rods=False).build()
    assert body.pushes
    assert not tendons.pushes
    play = effect_class("tendon_backlash")
    assert play.needs <= body.features
    assert not play.extended_needs <= body.features
    assert play.extended_needs <= tendons.features
    for effect in (effect_class("tendon_elasticity")(toe=1e-4), effect_class("actuator_saturation")(stall=1.0, n_tendon=2)):
        EffectChain((effect,)).check_body(tendons, "tendons")
        with pytest.raises(DataError, match=r"leave `(toe|stall)` out"):
            EffectChain((effect,)).check_body(body, "rods")


def test_a_drive_saturates_under_push_as_under_pull() -> None:
    T = np.array([[2.0, -2.0], [0.5, -0.5]])
    stall = effect_class("actuator_saturation")(loss=1.0, limit=1.0, corner=1e-4, n_tendon=2)
    z = np.zeros
    s = Signals(z(2), z(2), T, z((2, 2)), z((2, 0, 3)), z(2), (Drive.TENSION,) * 2)
    np.testing.assert_allclose(stall.drive(s).tension, [[1.0, -1.0], [0.5, -0.5]], atol=1e-6)


def test_kinematics_and_drawn_controls_push(rods: Robot) -> None:
    twin = Twin(rods)
    moved = LoadedRobot(twin, Loads(NOWHERE))
    assert moved.pull(np.array([-0.5, 0.5])).tip[0] < -5e-3
    np.testing.assert_allclose(moved.tension, [-0.5, 0.5])
    (drawn,) = draw_controls(twin, 1, seed=3).trials
    first, second = (drawn.values[f"tendon_{i}_tension"] for i in (1, 2))
    np.testing.assert_allclose(first, -second, atol=1e-9)  # of a bend each takes its part
    assert first.min() < 0.0
