"""Motion of a backbone whose tendons are held at lengths, by motors or by heated springs: it must settle where statics has it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from twin.body import Drive, Heating, Loads, Problem, Route, Solution
from twin.effects import effect_class
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.tendon_actuation import BACKBONE_COMPLIANCE, LEAST_STRETCH
from twin.mechanics.rod.dynamics import Dynamics
from twin.robots import load

HANGING, SIDEWAYS = Loads(np.array([0.0, 0.0, 9.81]), 0.01), Loads(np.array([9.81, 0.0, 0.0]), 0.02)
FRICTION = Route(0.2, 4e-4)
ROOM = 296.15  # K
REST = [119, 240]  # samples at the end of two holds of four seconds: twenty of the first mode's times of decay at this damping


@cache
def solvers(step: float = 1e-3) -> tuple[Dynamics, Equilibrium]:
    body = load("continuum").build({"damping.time": 0.03})
    body.spec.option.timestep = step
    return Dynamics(body), Equilibrium(load("continuum").build())


def both(
    time: np.ndarray, command: np.ndarray, loads: Loads, route: Route, kind: Drive = Drive.DISPLACEMENT
) -> tuple[Solution, Solution]:
    """The motion, and static equilibria one after another."""
    heating = Heating(np.full(len(time), ROOM), load("continuum").springs(3)) if kind is Drive.CURRENT else None
    problem = Problem(time, command, loads, route, (kind,) * 3, heating=heating)
    moved, still = (solver.solve(problem) for solver in solvers())
    assert moved.end_reason == ""
    assert still.status.all()
    return moved, still


def posed(*poses: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """(t, u): eased from pose to pose (mm) in two seconds, held for four."""
    t = np.linspace(0.0, 12.0, 241)
    way = np.interp(t, [0, 2, 6, 8, 12], [0, 1, 1, 2, 2])
    whole, part = np.divmod(way, 1.0)
    return t, 1e-3 * np.stack([np.interp(whole + part**2 * (3 - 2 * part), range(3), c) for c in np.array(poses).T], axis=1)


# mm. A bent robot's displacements add up to about nothing: three micrometres more pull all three taut.
TAUT_AND_SLACK = posed((0, 0, 0), (8, -20, -20), (-20, 6, 4))
ALL_TAUT = posed((0.003, 0.003, 0.003), (4, -1.95, -1.95), (2, -5.93, 4))


@pytest.mark.parametrize("loads", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
@pytest.mark.parametrize("stretch", [0.0, 1e-5])
@pytest.mark.parametrize("way", [TAUT_AND_SLACK, ALL_TAUT], ids=["slack", "taut"])
def test_it_settles_where_lengths_have_it(way: tuple[np.ndarray, np.ndarray], stretch: float, loads: Loads) -> None:
    moved, still = both(*way, loads, Route(stretch=stretch))
    assert np.ptp(still.markers[REST, -1], axis=0).max() > 0.01  # m: there is a way to go
    # m, N: without friction nothing is remembered; the static solve stops at 1e-7 rad in each of 48 hinges and at gaps of 2e-8 m,
    # which between tendons that pull against each other are 2e-8 / STIFFEST = 0.02 N.
    np.testing.assert_allclose(moved.markers[REST], still.markers[REST], rtol=0, atol=1e-6)
    np.testing.assert_allclose(moved.tension[REST], still.tension[REST], rtol=0, atol=0.02)
    np.testing.assert_array_equal(moved.tension[REST] > 0.0, still.tension[REST] > 0.0)


def test_with_friction_it_settles_where_lengths_have_it() -> None:
    moved, still = both(*ALL_TAUT, HANGING, FRICTION)
    # m: as where tensions drive (test_dynamics.py), slip remembers how far the motion lagged
    np.testing.assert_allclose(moved.markers[REST], still.markers[REST], rtol=0, atol=5e-5)


@pytest.mark.parametrize("loads", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
def test_it_settles_where_tendons_that_bed_in_have_it(loads: Loads) -> None:
    moved, still = both(*TAUT_AND_SLACK, loads, Route(stretch=1e-5, bedding=1e-3, bedding_tension=0.4))
    stiff = solvers()[1].solve(Problem(*TAUT_AND_SLACK, loads, Route(stretch=1e-5), (Drive.DISPLACEMENT,) * 3))
    assert np.abs(stiff.markers[REST] - still.markers[REST]).max() > 1e-3  # m: it shows
    np.testing.assert_allclose(moved.markers[REST], still.markers[REST], rtol=0, atol=1e-6)  # m, N: as above
    np.testing.assert_allclose(moved.tension[REST], still.tension[REST], rtol=0, atol=0.02)


@pytest.mark.parametrize("loads", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
def test_it_settles_where_motors_that_stall_have_it(loads: Loads) -> None:
    moved, still = both(*TAUT_AND_SLACK, loads, Route(stretch=1e-5, stall_tension=0.6))
    assert still.tension[REST].max() == pytest.approx(0.6, abs=2e-3)  # N: it does stall
    np.testing.assert_allclose(moved.markers[REST], still.markers[REST], rtol=0, atol=1e-6)  # m, N: as above
    np.testing.assert_allclose(moved.tension[REST], still.tension[REST], rtol=0, atol=0.02)
    assert moved.tension.max() < 0.65  # N: nor does it pull more on the way, but for the step in which it meets its limit


def test_a_tendon_pulls_at_its_length_or_is_slack_while_it_moves() -> None:
    t = np.linspace(0.0, 3.0, 1501)
    u = np.random.default_rng(1).uniform(-4e-3, 8e-3, (13, 3))
    u = np.stack([np.interp(t * 4.0, np.arange(13), c) for c in u.T], axis=1)
    u[:, 2] = -u[:, 0] - u[:, 1] - 1e-3
    path = solvers()[0].solve(Problem(t, u, SIDEWAYS, Route(), (Drive.DISPLACEMENT,) * 3))
    taut = path.tension > 1e-6  # N
    assert path.end_reason == ""
    assert 0.2 < taut.mean() < 0.9
    assert path.tension.min() == 0.0
    gap = (
        path.path
        - (solvers()[0].straight_path - u)
        - LEAST_STRETCH * path.tension
        - BACKBONE_COMPLIANCE * path.tension.sum(1, keepdims=True)
    )
    # m: what all press out of the backbone, and what its bowing takes, follow within some steps: micrometres. Where a slack tendon
    # is caught at some 50 mm/s, the one step in which that happens ends up to a step's way, 5e-5 m, off.
    assert np.percentile(np.abs(gap[taut]), 99) < 2e-6
    assert np.abs(gap[taut]).max() < 1e-4
    assert gap[~taut].max() < 1e-4


def test_a_jerk_is_survived() -> None:
    """10 mm in 5 ms, faster than any motor, and back."""
    t = np.linspace(0.0, 1.0, 1001)
    u = np.outer(np.interp(t, [0, 0.1, 0.105, 0.5, 0.505], [0, 0, 0.01, 0.01, 0]), [1.0, -1.2, -1.2])
    path = solvers()[0].solve(Problem(t, u, HANGING, FRICTION, (Drive.DISPLACEMENT,) * 3))
    assert path.end_reason == ""
    assert np.linalg.norm(path.markers, axis=2).max() < 0.15  # m: nothing leaves the robot's reach of 0.12 m


def test_the_settled_shape_does_not_depend_on_the_step() -> None:
    problem = Problem(*TAUT_AND_SLACK, HANGING, Route(), (Drive.DISPLACEMENT,) * 3)
    coarse, fine = (solvers(h)[0].solve(problem).markers[REST] for h in (2e-3, 1e-3))
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=1e-6)  # m: no memory


SOFT = Route(stretch=1e-4, bedding=4e-4, bedding_tension=0.4, initial_stretch_share=1.0)
LOOSE = Route(backlash=(3e-4,) * 3, crossing_travel=(3e-4,))


@pytest.mark.parametrize("route", [FRICTION, SOFT, LOOSE], ids=["friction", "toe", "play"])
def test_heated_springs_pull_as_they_do_in_statics(route: Route) -> None:
    t = np.arange(0.0, 30.0, 0.02)
    current = 1.7 * np.stack([np.interp(t, [s, s + 3, s + 9, s + 12], [0, 1, 1, 0], 0, 0) for s in (0.0, 8.0, 16.0)], axis=1)
    moved, still = both(t, current, HANGING, route, Drive.CURRENT)
    assert np.ptp(still.markers[:, -1], axis=0).max() > 1e-3
    assert np.ptp(still.others["temperature"]) > 40.0  # K
    # m: while a spring changes phase the robot moves 10 mm in seconds and lags statics by its damping time of 30 ms; at rest only
    # what the spring's history differs by is left, taken every 20 ms in statics and every one here.
    off = np.linalg.norm(moved.markers - still.markers, axis=2).max(axis=1)
    # At an end of its gap a spring begins to hold what it let go before, and the robot is as late as it was fast: 1.17 mm.
    assert off.max() < (1.5e-3 if route is LOOSE else 1e-3)
    assert off[-1] < 5e-5
    np.testing.assert_allclose(moved.tension[-1], still.tension[-1], rtol=0, atol=2e-3)  # N, as 50 um
    np.testing.assert_allclose(moved.others["temperature"], still.others["temperature"], rtol=0, atol=0.05)  # K, as before


@pytest.mark.parametrize("mounted", [0.0, 1.0])
def test_springs_rest_on_a_bent_robot_as_they_were_put_on_it(mounted: float) -> None:
    """Cold springs on a robot that rests bent: motion begins where statics has it, and stays."""
    law, t = effect_class("backbone_precurvature")({"about_y": 1.0, "mounted": mounted}), np.arange(0.0, 1.0, 0.02)
    body = load("continuum").chain(load("continuum").build({"damping.time": 0.03}))
    body.spec.option.timestep = 1e-3
    law.edit(body)
    heating = Heating(np.full(len(t), ROOM), load("continuum").springs(3))
    problem = Problem(t, np.zeros((len(t), 3)), HANGING, law.route(), (Drive.CURRENT,) * 3, heating=heating)
    moved, still = (solver.solve(problem) for solver in (Dynamics(body), Equilibrium(body)))
    assert moved.end_reason == ""
    assert (np.ptp(still.tension[0]) < 0.05) == bool(mounted)  # N: put on alike they pull alike, but for the payload's press
    np.testing.assert_allclose(moved.tension, still.tension, rtol=0, atol=2e-3)  # N, as above
