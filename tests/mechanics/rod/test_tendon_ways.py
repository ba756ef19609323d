"""Helical and converging tendons, and tendons that end before the tip.

Truths: the rod of tools/simulators/rod (Gauss nodes, no code in common), helices in closed form, a shorter robot.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import fsolve

from tests.other_continua import (
    CLOSE,
    EI,
    GJ,
    HANGING,
    HELICAL,
    LENGTH,
    NOWHERE,
    OUTWARD,
    SEGMENTS,
    SIDEWAYS,
    SIX,
    TURN,
    disks,
    helical_rod,
    off,
    robot,
)
from tools.benchmarks.solvers.tip_wrench import tip_wrench
from tools.simulators.rod.mechanics.rod import Rod, follow
from tools.simulators.rod.mechanics.rod import solve as rod_solve
from twin.body import Drive, Loads, Problem, Route
from twin.foundation.compiled import jit
from twin.foundation.errors import DataError
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.lengths import tension_gradients
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.prediction.kinematics import LoadedRobot, inverse
from twin.prediction.twin import Twin
from twin.report.robot_page import draw_robot
from twin.robots import Robot, load

# ---- holes -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gravity", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
def test_helical_and_converging_tendons_bend_it_as_the_rod(gravity: np.ndarray, tmp_path: Path) -> None:
    solver, plain = Equilibrium(robot(tmp_path, **HELICAL).build()), Equilibrium(load("continuum").build())
    rng = np.random.default_rng(5)
    worst, nearest = 0.0, np.inf
    for _ in range(12):
        tension, payload = rng.uniform(0, 4, 3), rng.uniform(0, 0.03)
        rod = rod_solve(helical_rod(), tension, gravity=gravity, payload=payload)
        worst = max(worst, off(disks(solver, tension, gravity, payload), rod.disks))
        nearest = min(nearest, off(disks(plain, tension, gravity, payload), rod.disks))
    assert worst < CLOSE
    assert nearest > 10 * CLOSE  # straight tendons are another robot


def test_friction_counts_the_helix_too(tmp_path: Path) -> None:
    """A helical tendon turns at its holes even where the robot is straight; both laws of pre-sliding are kept short."""
    solver = Equilibrium(robot(tmp_path, **HELICAL).build())
    t = np.arange(101.0)
    T = np.stack([np.interp(t, [0, 50, 100], [0, 3, 1]), np.interp(t, [0, 100], [0, 1]), 0 * t], axis=1)
    ours = solver.solve(Problem(t, T, Loads(SIDEWAYS, 0.01), Route(0.2, 2e-5))).markers[:, 7]
    lead = np.array([0.25, 0.5, 0.75])
    drive, weight = np.vstack([np.zeros((3, 3)), T]), np.append(lead, np.ones(len(T)))
    rod = follow(helical_rod(), drive, gravity=SIDEWAYS, payload=0.01, weight=weight, mu=0.2, stroke=2e-5).disks[3:, -1]
    # m: as in test_equilibrium; 0.1 mm for the reversal, and the rounded turn angle, 1e-3 rad at each of 7 holes of a 80 mm bend
    assert off(ours, rod) < CLOSE + 1e-4 + 0.2 * 7e-3 * 0.08
    smooth = follow(helical_rod(), drive, gravity=SIDEWAYS, payload=0.01, weight=weight).disks[3:, -1]
    assert off(smooth, rod) > 10 * CLOSE


def helix(tension: float, radius: float, rate: float) -> np.ndarray:
    """Tip (3,) m of the weightless rod under one helical tendon that turns by `rate` (rad/m), in closed form.

    Rod and tendon together carry nothing: K u = -T r x t. In the frame that turns with the tendon all of it is constant: the rod is
    a helix too, a screw motion of twist (e3, u + rate e3).
    """
    r, e3 = np.array([radius, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

    def lack(u: np.ndarray) -> np.ndarray:
        t = e3 + np.cross(u, r) + np.array([0.0, radius * rate, 0.0])
        return np.array([EI, EI, GJ]) * u / EI + tension * np.cross(r, t) / np.linalg.norm(t) / EI

    w = fsolve(lack, np.zeros(3), xtol=1e-14) + rate * e3
    screw = np.zeros((4, 4))
    screw[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    screw[:3, 3] = e3
    return expm(LENGTH * screw)[:3, 3]


def one_helix(folder: Path, n: int, total: float) -> Robot:
    """One tendon through n disks that turns by `total` (rad) on its way."""
    numbers = {"disks__pitch": (1e3 * LENGTH / n, "mm"), "tendons__angle": ([0.0], "deg"), "markers__axial_offset": (0.0, "mm")}
    turn = [np.degrees(total * np.arange(1, n + 1) / n).tolist()]
    return robot(folder, {"disks": n, "tendons": 1}, **numbers, holes__turn=(turn, "deg"))


@pytest.mark.parametrize("tension", [0.5, 2.0])
def test_a_helical_tendon_makes_a_helix(tension: float, tmp_path: Path) -> None:
    total = np.pi
    truth = helix(tension, 8e-3, total / LENGTH)
    coarse, fine = (off(disks(Equilibrium(one_helix(tmp_path, n, total).build()), [tension])[-1], truth) for n in (12, 24))
    assert coarse < 0.02 * LENGTH  # 15 degrees a disk: the tendon's chords lie (1 - cos 7.5 deg) r nearer to the axis, 0.9 %
    assert fine < 0.28 * coarse  # second order: a quarter, and a little of what is left of higher orders
    assert off(helix(tension, 8e-3, 0.0), truth) > 0.1 * LENGTH  # a straight one


def test_a_helical_tendons_path_is_its_chords(tmp_path: Path) -> None:
    solver = Equilibrium(one_helix(tmp_path, 12, 2 * np.pi).build())
    chord = 2 * 8e-3 * np.sin(np.pi / 12)
    assert solver.straight_path[0] == pytest.approx(12 * np.hypot(chord, LENGTH / 12), rel=1e-13)
    assert solver.straight_path[0] == pytest.approx(np.hypot(LENGTH, 2 * np.pi * 8e-3), rel=0.01)  # the helix itself


def test_tips_are_found_with_helical_tendons(tmp_path: Path) -> None:
    """A tip that two tendons reach is reached again, and each tendon's direction is where it moves the tip."""
    turned = LoadedRobot(Twin(robot(tmp_path, holes__turn=((TURN[0] * np.ones((3, 1))).tolist(), "deg"))), Loads(HANGING))
    away = turned.pull(np.array([0.02, 0.0, 0.0])).tip
    # rad: holes make the tendon a polygon, whose moment is not quite the one of its places' mean
    assert np.arctan2(away[1], away[0]) == pytest.approx(turned.directions[0], abs=0.02)
    assert turned.directions[0] > np.radians(30.0)
    wanted = turned.pull(np.array([1.5, 0.7, 0.0])).tip
    turned.rest()
    assert inverse(turned, wanted).distance < 1e-4


def test_the_picture_and_the_reference_know_it(tmp_path: Path) -> None:
    mine = robot(tmp_path, {"tendons_end": [8, 4, 8]}, **HELICAL, disks__thickness=(2.0, "mm"))
    traces = {t.name: t for t in draw_robot(mine).data}
    x, y = (np.array(traces["tendon 1"][a])[:-1] for a in "xy")  # a line ends with no number
    # mm: holes 1, 2, ... a pair each, the last one alone
    k = np.array([0, *np.repeat(np.arange(1, 8), 2), 8])
    radius, angle = 8.0 + np.append(0.0, OUTWARD[0])[k], np.radians(np.append(0.0, TURN[0])[k])
    np.testing.assert_allclose(np.stack([x, y]), radius * np.stack([np.cos(angle), np.sin(angle)]), rtol=0, atol=1e-9)
    assert len(traces["tendon 2"].x) - 1 == 8  # base, three pairs, the last
    with pytest.raises(DataError, match="another"):
        tip_wrench(mine, np.ones(3), Loads(HANGING))


# ---- segments --------------------------------------------------------------------------------------------------------------


def test_two_segments_are_the_rod(tmp_path: Path) -> None:
    solver = Equilibrium(robot(tmp_path, SEGMENTS, **SIX).build())
    rod = Rod(hole_radius=np.full((9, 6), 8e-3), hole_angle=np.tile(np.radians(SIX["tendons__angle"][0]), (9, 1)))
    rng, reach = np.random.default_rng(2), np.arange(8)[:, None] < np.array(SEGMENTS["tendons_end"])
    for gravity in (HANGING, SIDEWAYS):
        tension = rng.uniform(0.5, 3, 6) * [1, 1, 0.2, 1, 0.2, 0.2]
        truth = rod_solve(rod, tension * reach, gravity=gravity, payload=0.01)
        assert off(disks(solver, tension, gravity, 0.01), truth.disks) < CLOSE
        through = rod_solve(rod, np.tile(tension, (8, 1)), gravity=gravity, payload=0.01)
        assert off(through.disks, truth.disks) > 10 * CLOSE


def test_beyond_a_tendons_end_it_stays_straight(tmp_path: Path) -> None:
    """Without weight: up to disk 4 the arcs of a robot of four disks, then a straight line along disk 4's axis."""
    solver = Equilibrium(robot(tmp_path, SEGMENTS, **SIX).build())
    short = {"disks__pitch": ([15.0] * 4, "mm"), "backbone__length": (60.0, "mm"), "markers__axial_offset": (0.0, "mm")}
    (tmp_path / "short").mkdir()
    alone = Equilibrium(robot(tmp_path / "short", {"disks": 4}, **short).build())
    tension = [2.0, 0.5, 0.0]
    found = disks(solver, [*tension, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found[:4], disks(alone, tension), rtol=0, atol=1e-10)  # m: 24 hinges at 1e-11 rad over 0.06 m
    steps = np.diff(found[3:], axis=0) / 0.015
    np.testing.assert_allclose(steps, np.tile(steps[0], (4, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 1.0, rtol=0, atol=1e-9)


def test_tendons_press_what_they_reach_only(tmp_path: Path) -> None:
    """Two opposite tendons press the first, short interval; the second, long one, which a third bends, they do not soften."""
    tension, angles = [1.0, 1.0, 0.5], [0.0, 180.0, 90.0]
    numbers = {"disks__pitch": ([10.0, 60.0], "mm"), "markers__axial_offset": (0.0, "mm"), "tendons__angle": (angles, "deg")}
    rod = Rod(
        pitch=np.array([0.01, 0.06]), disk_mass=np.ones(2), hole_radius=np.full((3, 3), 8e-3), stiffness_profile=np.ones(2),
        hole_angle=np.tile(np.radians(angles), (3, 1)), precurvature=np.zeros((2, 3)), marker_offset=np.zeros(2),
    )  # fmt: skip
    short = rod_solve(rod, [tension, [0.0, 0.0, 0.5]], gravity=NOWHERE, nodes=10).disks
    mine = robot(tmp_path, {"disks": 2, "tendons_end": [1, 1, 2]}, ("backbone.length",), **numbers)
    found = disks(Equilibrium(mine.build()), tension)
    # m: were it pressed by all, it would bend by (P h^2 / EI)^2 / 720, 5 %, more: of 6 mm at its tip 0.3 mm
    assert off(found, short) < CLOSE
    assert 4e-3 < found[1, 1] < 8e-3


@jit
def seen_pulls(at, z, path_gradient, pull):
    tension_gradients(at, np.ones(len(z)), z, path_gradient, pull)


def test_no_joint_beyond_its_end_changes_a_tendon(tmp_path: Path) -> None:
    e = Equilibrium(robot(tmp_path, SEGMENTS, **SIX).build())
    under = e.statics(Problem(np.zeros(1), np.ones((1, 6)), Loads(HANGING)))
    update_kinematics(under, np.random.default_rng(0).normal(0, 0.1, e.model.nv))
    A, B = np.full((6, e.model.nv), np.nan), np.full((6, e.model.nv), np.nan)
    seen_pulls(under, np.zeros((6, 8)), A, B)
    assert np.array_equal(A, B)
    assert not A[:3, 24:].any()  # 24 hinges in the first four intervals
    assert np.all(A[:3, :24] != 0.0)
    assert np.all(A[3:] != 0.0)


@pytest.mark.parametrize("name", ["segments", "tentacle"])
@pytest.mark.parametrize("mu", [0.0, 0.15])
def test_lengths_hold_tendons_that_end_early(name: str, mu: float, tmp_path: Path) -> None:
    """Held at the lengths that tensions gave, they have these tensions, and the robot its shape; the tentacle's end early too."""
    mine = robot(tmp_path, SEGMENTS, **SIX) if name == "segments" else load(name)
    solver, n = Equilibrium(mine.build()), mine.n_tendon
    t = np.arange(20.0)
    tension = np.linspace(0.2, 1.0, 20)[:, None] * np.array([2.0, 0.0, 0.0, 0.0, 1.5, 0.0])[: n if n > 2 else 1]
    tension = tension if n > 2 else np.hstack([tension, 0.5 * tension])
    route, loads = Route(mu, 4e-4), Loads(mine.gravity)
    pulled = solver.solve(Problem(t, tension, loads, route, tolerance=1e-9))
    slack = 1e-6 * (tension + tension.sum(axis=1, keepdims=True))  # m: a held tendon gives by 1 um/N, the backbone by as much
    command = solver.straight_path - pulled.path + slack
    command[:, tension[0] == 0.0] = -5e-3  # paid out
    drives = (Drive.DISPLACEMENT,) * n
    held = solver.solve(Problem(t, command, loads, Route(mu, 4e-4), drives=drives, tolerance=1e-9))
    assert held.status.all()
    # N: 2e-8 m, below which a gap counts as none, of tendons that give by 1 mm/N; with friction the start comes by lengths and not
    # by tensions, another way, which the holes have forgotten but for what still sticks
    np.testing.assert_allclose(held.tension[-1], tension[-1], rtol=0, atol=5e-5 if mu == 0.0 else 5e-3)
    np.testing.assert_allclose(held.markers[-1], pulled.markers[-1], rtol=0, atol=1e-6 if mu == 0.0 else 1e-4)


def test_the_gradient_of_segments_is_that_of_finite_steps(tmp_path: Path) -> None:
    now = LoadedRobot(Twin(robot(tmp_path, SEGMENTS, **SIX)), Loads(SIDEWAYS))
    tension = np.array([1.0, 0.3, 0.0, 0.5, 0.0, 0.4])
    now.pull(tension)
    gradient = now.gradient()
    for t in range(6):
        if tension[t] > 0.0:
            up, down = (now.pull(tension + s * 0.02 * np.eye(6)[t]).markers for s in (1, -1))
            # m/N of 0.03: shapes within 1e-7 rad a hinge over 0.1 m, over 0.04 N; third derivatives of 0.03 m/N^3 times 0.02^2 / 6
            np.testing.assert_allclose(gradient[t], (up - down) / 0.04, rtol=0, atol=1e-5)
