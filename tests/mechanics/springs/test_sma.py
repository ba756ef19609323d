"""SMA springs: the laws alone against closed forms and thermodynamics; with the robot against solutions found another way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from tests.command_line import twin
from tools.simulators.rod.bench import run
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.effects.tendon import TendonElasticity
from tools.simulators.rod.mechanics.rod import Rod, follow
from tools.simulators.rod.mechanics.springs import GF, Springs
from tools.simulators.rod.sensors import Noise
from tools.simulators.rod.write import write_set
from twin.body import Drive, Heating, Loads, Problem, Route
from twin.body.drives.spring import Spring
from twin.effects import Effect, effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial, read
from twin.mechanics.rod import ChainSolution, Equilibrium
from twin.mechanics.rod.drawing import _spring_elongations
from twin.mechanics.springs import spring_response
from twin.mechanics.springs.heat import LEAST_LOSS, heat_loss, heated_temperature
from twin.prediction.kinematics.heated_robot import HeatedRobot
from twin.prediction.prepared import prepare
from twin.prediction.simulate import output_columns, simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROOM = 296.15  # K
HANGING, SIDEWAYS = Loads(np.array([0.0, 0.0, 9.81]), 0.01), Loads(np.array([9.81, 0.0, 0.0]), 0.02)
HEATED = (Drive.CURRENT,) * 3


@cache
def robot() -> Equilibrium:
    return Equilibrium(load("continuum").build())


def springs(n: int = 3) -> Spring:
    return load("continuum").springs(n)


def drive(time: np.ndarray, current: np.ndarray, loads: Loads, route: Route | None = None, spring: Spring | None = None):
    path = robot().solve(
        Problem(time, current, loads, route or Route(), HEATED, heating=Heating(np.full(len(time), ROOM), spring or springs()))
    )
    assert path.status.all()
    assert path.start_status == 1
    return path


def turns(time: np.ndarray, hot: float = 1.25) -> np.ndarray:
    """Currents (n, 3): each spring in turn for 20 s, then a rest."""
    return hot * (np.minimum(time[:, None] // 20.0, 4.0) == np.arange(3))


# ---- heat ----------------------------------------------------------------------------------------------------------------


def test_the_heat_step_is_exact_where_the_loss_is_constant() -> None:
    spring = springs(1)._replace(loss_warm=np.zeros(1), loss_warm_2=np.zeros(1), loss_warm_open=np.zeros(1))
    h, c, R = heat_loss(spring.records, 0, 0.0, 9e-3, ROOM), 0.1155, 0.45
    for dt in (0.02, 1.0, 300.0):
        found = heated_temperature(spring.records, 0, ROOM + 12.0, 9e-3, 0.9, ROOM, dt)
        end = R * 0.9**2 / h
        assert found - ROOM == pytest.approx(end + (12.0 - end) * np.exp(-h * dt / c), rel=1e-12)


def test_first_law() -> None:
    """c dT = (R I^2 - h (T - T_a)) dt over 60 s of heating and 60 s of cooling, each term summed by itself."""
    spring, dt = springs(1), 0.02
    time = np.arange(0.0, 120.0, dt)
    current = np.where(time < 60.0, 1.0, 0.0)
    elongation = 9e-3 - 3e-3 * np.sin(time / 20.0) ** 2
    T, _ = spring_response(spring, time, current[None], elongation[None], ROOM)
    lost = [heat_loss(spring.records, 0, x - ROOM, e, ROOM) * (x - ROOM) for x, e in zip(T[0], elongation, strict=True)]
    inflow = 0.45 * (current[:-1] ** 2).sum() * dt
    outflow = float(np.sum(0.5 * (np.array(lost)[1:] + np.array(lost)[:-1])) * dt)
    # The step holds h: of first order, 3e-4 of 27 J at 20 ms.
    assert inflow - outflow == pytest.approx(0.1155 * (T[0, -1] - T[0, 0]), abs=3e-4 * inflow)


def test_halving_the_step_halves_the_error_against_the_differential_equation() -> None:
    spring = springs(1)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return (0.45 * 1.1**2 - heat_loss(spring.records, 0, x[0] - ROOM, 9e-3, ROOM) * (x[0] - ROOM)) / np.array([0.1155])

    exact = solve_ivp(rate, (0.0, 30.0), [ROOM], rtol=1e-10, atol=1e-10).y[0, -1]
    error = []
    for n in (30, 60, 120, 240):
        time = np.linspace(0.0, 30.0, n + 1)
        error.append(spring_response(spring, time, np.full((1, n + 1), 1.1), np.full((1, n + 1), 9e-3), ROOM)[0][0, -1] - exact)
    ratio = np.array(error[:-1]) / np.array(error[1:])
    np.testing.assert_allclose(ratio, 2.0, atol=0.1)
    assert abs(error[-1]) < 0.5  # K at 0.125 s


def test_it_heats_on_finitely_where_the_fitted_loss_is_negative() -> None:
    time = np.arange(0.0, 400.0, 0.5)
    T, s = spring_response(springs(1), time, np.full((1, len(time)), 3.0), np.full((1, len(time)), 9e-3), ROOM)
    assert heat_loss(springs(1).records, 0, 500.0, 9e-3, ROOM) == LEAST_LOSS
    assert np.isfinite(T).all()
    assert np.isfinite(s).all()


# ---- force ---------------------------------------------------------------------------------------------------------------


def along(temperature: np.ndarray, elongation: np.ndarray, spring: Spring | None = None) -> np.ndarray:
    """Tension (n,) N at given temperatures (n,) K and elongations (n,) m: heat without inertia holds the spring there."""
    spring = (spring or springs(1))._replace(capacity=np.array([1e-12]), loss=np.array([1.0]), resistance=np.array([1e-9]))
    zero = {name: np.zeros(1) for name in ("loss_warm", "loss_warm_2", "loss_open", "loss_open_2", "loss_warm_open")}
    spring = spring._replace(**zero)
    n = len(temperature)
    time = np.arange(n, dtype=float)
    ambient = np.append(temperature[1:], temperature[-1])[None]  # the temperature a step ends at
    ambient[0, 0] = temperature[1] if n > 1 else temperature[0]
    return spring_response(spring, time, np.zeros((1, n)), elongation[None], ambient)[1][0]


def by_the_source(temperature: np.ndarray, elongation: np.ndarray) -> np.ndarray:
    """Tension (n,) N after the bench's own code of the law."""
    now, out = Springs(), []
    for T, e in zip(temperature, elongation, strict=True):
        now = now.at(T - 273.15).rested(np.full(3, 1e3 * e))
        out.append(GF * now.force[0])
    return np.array(out)


def test_it_is_the_sources_operator() -> None:
    rng = np.random.default_rng(2)
    T = np.repeat(rng.uniform(290.0, 400.0, 400), 3)
    e = rng.uniform(-2e-3, 34e-3, 1200)
    T[:2] = T[0]
    np.testing.assert_allclose(along(T, e), by_the_source(T, e), rtol=0, atol=1e-9)  # N: rounding


@pytest.mark.parametrize("celsius", [25.0, 75.0, 95.0, 130.0])
def test_a_loop_of_elongation_takes_energy(celsius: float) -> None:
    """Work on the spring over closed loops of elongation at one temperature, the second time round: lost, never gained."""
    e = 1e-3 * (10.0 + 9.0 * np.sin(np.linspace(0.0, 4.0 * np.pi, 4001)))
    s = along(np.full(len(e), 273.15 + celsius), e)[2000:]
    work = float((0.5 * (s[1:] + s[:-1]) * np.diff(e[2000:])).sum())
    assert work > 1e-3  # J, of some 20 mJ; a trapezoid's error at 2000 steps is 1e-7


def test_a_loop_of_temperature_under_a_weight_lifts_late() -> None:
    """Heating and cooling at a held length: the tension follows later both ways, so the loop runs clockwise and closes."""
    T = 273.15 + 75.0 + 40.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, 6001))
    s = along(T, np.full(len(T), 9e-3))
    np.testing.assert_allclose(s[4001:], s[2001:-2000], rtol=0, atol=1e-12)
    T, s = T[2001:4002], s[2001:4002]
    assert float((0.5 * (s[1:] + s[:-1]) * np.diff(T)).sum()) < -5.0  # N K: some 25 K wide and 2 N high


def test_minor_loops_stay_inside_the_major_one() -> None:
    cold_to_hot = 273.15 + np.concatenate([np.linspace(20.0, 140.0, 2001), np.linspace(140.0, 20.0, 2001)])
    major = along(np.concatenate([cold_to_hot, cold_to_hot]), np.full(8004, 9e-3))[4002:]
    up, down = major[:2001], major[2001:][::-1]
    grid = cold_to_hot[:2001]
    inner = 273.15 + 80.0 + 30.0 * np.cos(np.linspace(0.0, 60.0, 5000)) * np.linspace(1.0, 0.1, 5000)
    s = along(np.concatenate([cold_to_hot, inner]), np.full(4002 + 5000, 9e-3))[4002:]
    rounding = 0.104 * 0.06  # N: the grid is 0.06 K wide, and a branch climbs by 10.6 gf/K at most
    assert (s > np.interp(inner, grid, up) - rounding).all()
    assert (s < np.interp(inner, grid, down) + rounding).all()
    assert ((s > np.interp(inner, grid, up) + 0.1) & (s < np.interp(inner, grid, down) - 0.1)).any()


def test_a_batch_is_its_springs_one_by_one() -> None:
    rng = np.random.default_rng(0)
    time, current, e = np.arange(0.0, 50.0, 0.5), rng.uniform(0.0, 1.3, (5, 100)), rng.uniform(0.0, 12e-3, (5, 100))
    T, s = spring_response(springs(5), time, current, e, ROOM)
    for k in range(5):
        alone = spring_response(springs(1), time, current[k : k + 1], e[k : k + 1], ROOM)
        assert np.array_equal(alone[0][0], T[k])
        assert np.array_equal(alone[1][0], s[k])


# ---- with the robot ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loads", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
def test_body_and_springs_meet_where_another_solver_finds_them(loads: Loads) -> None:
    """Tensions that are the law's at the body's lengths under them: found by scipy's root, sample by sample, from the drive by
    tension and the bench's law."""
    time = np.arange(0.0, 100.0, 4.0)
    found = drive(time, turns(time), loads)
    straight = robot().straight_path
    weight = np.arange(1, 9) / 8.0  # gravity and payload come on in steps, as in `twin.mechanics.rod.held_trials`
    now = Springs().at(ROOM - 273.15)
    for i in range(-len(weight), len(time)):
        part = Loads(loads.gravity * (weight[i] if i < 0 else 1.0), loads.payload)
        if i > 0:
            now = now.stepped(turns(time)[i - 1], ROOM - 273.15, 4.0)

        def elongation(T: np.ndarray, part: Loads = part) -> np.ndarray:
            return 9.0 + 1e3 * (robot().solve(Problem(np.zeros(1), np.maximum(T, 0.0)[None], part)).path[0] - straight)

        def lacks(T: np.ndarray, now: Springs = now, elongation=elongation) -> np.ndarray:
            return np.maximum(0.0, GF * now.pull(elongation(T))) - T

        start = GF * now.force if i < 0 else found.tension[i] + 1e-3
        T = root(lacks, start, method="hybr", options={"xtol": 1e-10, "eps": 1e-6}).x
        assert np.abs(lacks(T)).max() < 2e-5
        now = now.rested(elongation(T))
        if i >= 0:
            # 1e-4 N: lengths are closed to 2e-8 m in either solver, 16 uN at the springs' 785 N/m, and add up over the samples
            np.testing.assert_allclose(found.tension[i], T, rtol=0, atol=1e-4)
            np.testing.assert_allclose(found.others["temperature"][i] - 273.15, now.temperature, rtol=0, atol=1e-3)


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_it_is_the_rod_with_springs(mu: float) -> None:
    """The bench's rod and springs share no code with the twin's; its friction slides from the first 1e-6 m."""
    time = np.arange(0.0, 100.0, 0.5)
    found = drive(time, turns(time), SIDEWAYS, Route(mu, 2e-5))
    lead = 15
    truth = follow(
        Rod(), np.vstack([np.zeros((lead, 3)), turns(time)]), gravity=SIDEWAYS.gravity, payload=SIDEWAYS.payload, mu=mu,
        stroke=2e-5, weight=np.minimum(np.arange(1, len(time) + lead + 1) / 8.0, 1.0),
        dt=np.append(np.zeros(lead + 1), np.diff(time)),
        springs=Springs(), ambient=ROOM - 273.15, keep=np.arange(len(time) + lead) >= lead,
    )  # fmt: skip
    assert np.ptp(truth.markers[:, -1], axis=0).max() > 5e-3  # m: they do move it
    error = np.linalg.norm(found.markers[:, :8] - truth.markers, axis=2)
    # 0.01 mm is what the description is good for; pre-sliding is another law there, for which 0.05 mm
    assert np.sqrt(np.mean(error**2)) < (1e-5 if mu == 0.0 else 5e-5)
    np.testing.assert_allclose(found.others["temperature"] - 273.15, truth.temperature, rtol=0, atol=2e-3 if mu == 0.0 else 0.05)


def test_where_a_single_step_is_lost_the_neighbours_own_shape_stays() -> None:
    """To first order: a neighbour one of whose samples stands a radian off at a hinge, farther than a step may go. That one stays
    as it is there, those before are as they were, and a fit is told of no failure."""
    time = np.arange(0.0, 60.0, 2.0)
    heating = Heating(np.full(len(time), ROOM), springs())
    problem = Problem(time, turns(time), HANGING, Route(), HEATED, heating=heating, keep=True)
    kept = robot().solve(problem)
    astray = kept.q.copy()
    astray[20, 0] += 1.0
    found = robot().solve(replace(problem, neighbour=replace(kept, q=astray), keep=False, once=True))
    assert found.status.all()
    np.testing.assert_array_equal(found.q[20], astray[20])
    np.testing.assert_allclose(found.q[:20], kept.q[:20], rtol=0, atol=1e-6)
    assert np.isfinite(found.q).all()


@pytest.mark.parametrize("more", [1e-3, 4e-3])
@pytest.mark.parametrize("after", [0.85, 0.9])
def test_a_neighbour_is_to_first_order_what_it_is_in_full(after: float, more: float) -> None:
    """Springs that lose a little more heat: less current, or the end of their heat, lets them rest within their loops, each where
    its own past has it. What a sample loses there, all that follow multiply."""
    time = np.arange(0.0, 160.0, 1.0)
    current = np.where(time < 80.0, 0.9, after)[:, None] * np.array([1.0, 0.9, 0.95])

    def problem(factor: float) -> Problem:
        spring = effect_class("sma_cooling")({"factor": factor}, 3).spring(springs())
        return Problem(time, current, SIDEWAYS, Route(), HEATED, heating=Heating(np.full(len(time), ROOM), spring))

    kept = robot().solve(replace(problem(1.0), keep=True))
    full = robot().solve(problem(1.0 + more))
    once = robot().solve(replace(problem(1.0 + more), neighbour=kept, once=True))
    moved = np.abs(full.tension - kept.tension).max()
    assert moved > 1e-3  # N: it is seen
    # of the second order: a share of the change that is some share `more` of it; neighbours' pieces left it 0.2 to 20 of the change
    assert np.abs(once.tension - full.tension).max() < max(more, 2e-3) * moved


@pytest.mark.parametrize("loads", [HANGING, SIDEWAYS], ids=["hanging", "sideways"])
def test_a_body_that_softens_slowly_moves_its_springs(loads: Loads) -> None:
    """Of a body that loses 2 permille in 200 rows each row's change, some 10 uN, is less than a rough guess is let off; their sum
    is not. A Newton step from what was found, of the same robot, adds nothing: 2e-6 N, a fifth of one row's."""
    n = 201
    heating = Heating(np.full(n, ROOM), springs())
    softer = np.linspace(1.0, 0.998, n)
    problem = Problem(np.arange(0.0, n), np.zeros((n, 3)), loads, Route(), HEATED, heating=heating, stiffness=softer, keep=True)
    found = robot().solve(problem)
    again = robot().solve(replace(problem, neighbour=found, keep=False, once=True))
    np.testing.assert_allclose(again.tension, found.tension, rtol=0, atol=2e-6)


@pytest.mark.parametrize("bedding", [0.0, 5e-4])
def test_springs_pull_in_what_tendons_of_a_toe_give_way(bedding: float) -> None:
    """A spring's elongation is the path's and the stiff tendon's share of it: the springs by themselves, given elongations so
    reckoned from the paths and tensions found, pull with these tensions."""
    time = np.arange(0.0, 100.0, 2.0)
    route = Route(stretch=1e-4, bedding=bedding, bedding_tension=0.4)
    found = drive(time, turns(time), SIDEWAYS, route)
    alone = springs()
    stretched = alone.initial_elongation + found.path - robot().straight_path - route.stretch * found.tension
    stretched -= bedding * (1.0 - np.exp(-found.tension / 0.4))
    temperature, tension = spring_response(alone, time, turns(time).T, stretched.T, ROOM)
    # A trial starts from springs at rest under their own weight of 0.7 N, and its load comes on in eight steps: what history that
    # leaves is gone where a spring has been heated through. 2e-3 N: 0.01 K at 10.6 gf/K are 1e-3.
    warm = temperature.max(axis=1) > 273.15 + 85.0
    assert warm.any()
    np.testing.assert_allclose(temperature.T, found.others["temperature"], rtol=0, atol=1e-2)
    np.testing.assert_allclose(tension.T[5:, warm], found.tension[5:, warm], rtol=0, atol=2e-3)


@pytest.mark.parametrize("swap", [1e-4, 4e-4])
def test_springs_that_follow_with_play_stand_still_while_their_tendons_turn_back(swap: float) -> None:
    """Half a millimetre of play: elongations by a play operator along the paths found, row by row, give springs by themselves the
    tensions found. All of a turn that lies within the gap stays with the tendon, or the share that a softer gap leaves."""
    time, half = np.arange(0.0, 100.0, 1.0), 2.5e-4
    route = Route(backlash=(half,) * 3, crossing_travel=(swap,))
    found = drive(time, turns(time), SIDEWAYS, route)
    alone, swap = springs(), max(swap, half / 0.99)
    path = found.path - robot().straight_path
    # Where the first row stands within the gap the solve knows from the load that came on before it, without currents; its own
    # tensions tell: one of the two ends or between, by least squares.
    side = np.zeros_like(path)
    for t in range(3):

        def played(z: float, t: int = t) -> np.ndarray:
            out = np.empty(len(path))
            out[0] = z
            for i in range(1, len(path)):
                out[i] = z = min(1.0, max(-1.0, z + (path[i, t] - path[i - 1, t]) / swap))
            return out

        def error(z: float, t: int = t, played=played) -> float:
            stretched = alone.initial_elongation[:1] + path[:, t] - half * played(z)
            one = Spring(*(field[t : t + 1] for field in alone))
            return float(
                np.abs(spring_response(one, time, turns(time).T[t : t + 1], stretched[None], ROOM)[1][0] - found.tension[:, t])[
                    10:
                ].max()
            )

        best = min(np.linspace(-1.0, 1.0, 81), key=error)
        side[:, t] = played(best)
    stretched = alone.initial_elongation + path - half * side
    tension = spring_response(alone, time, turns(time).T, stretched.T, ROOM)[1]
    # N: a step of the first side is 6 um of a spring of 785 N/m
    np.testing.assert_allclose(tension.T[10:], found.tension[10:], rtol=0, atol=5e-3)
    assert np.ptp(side, axis=0).max() > 1.5, "the gap is crossed"
    without = spring_response(alone, time, turns(time).T, (alone.initial_elongation + path).T, ROOM)[1]
    assert np.abs(without.T - found.tension).max() > 0.1


def bent(mounted: float) -> tuple[Twin, Equilibrium]:
    """A robot that rests with a radius of half a metre, and its springs put on it so."""
    law = effect_class("backbone_precurvature")({"about_y": 2.0, "mounted": mounted})
    twin = Twin(load("continuum"), {}, (law,))
    return twin, Equilibrium(twin.robot.chain(twin.body()))


def cold(twin: Twin, solver: Equilibrium, current: float = 0.0) -> ChainSolution:
    """Unloaded; 20 s later, a current in all springs."""
    heating = Heating(np.full(2, ROOM), springs())
    currents = np.full((2, 3), current)
    path = solver.solve(
        Problem(np.array([0.0, 20.0]), currents, Loads(np.zeros(3)), twin.effect_chain.route, HEATED, heating=heating)
    )
    assert path.status.all()
    return path


def test_springs_put_on_a_bent_robot_begin_alike_and_leave_it_as_it_is() -> None:
    """All pull with 0.7 N: three alike about the axis turn no disk. To 2 %, 18 um of a spring's 785 N/m: pressed by 2.1 N the bent
    backbone bows between disks, and a path that bows is longer or shorter by some micrometres."""
    twin, solver = bent(1.0)
    path = cold(twin, solver)
    np.testing.assert_allclose(path.tension[0], 0.7, rtol=2e-2)
    rest = solver.solve(Problem(np.zeros(1), np.zeros((1, 3)), Loads(np.zeros(3))))
    np.testing.assert_allclose(path.markers[0], rest.markers[0], rtol=0, atol=2e-4)
    assert rest.markers[0, -1, 0] > 0.01  # m, the tip aside: bent indeed
    np.testing.assert_allclose(solver.rest_path, rest.path[0], rtol=0, atol=1e-9)


def test_springs_put_on_a_robot_held_straight_pull_it_straighter() -> None:
    """The one that its bend leaves short pulls less, the two across from it more."""
    twin, solver = bent(0.0)
    path = cold(twin, solver)
    off = path.path[0] - solver.straight_path
    assert off[0] < -1e-4  # m
    assert off[1] == pytest.approx(off[2], abs=1e-7)
    assert path.tension[0, 0] < 0.7 - 0.1
    assert path.tension[0, 1] > 0.7 + 0.05
    kept = cold(*bent(1.0))
    assert path.markers[0, -1, 0] < kept.markers[0, -1, 0] - 1e-3
    half = cold(*bent(0.5))  # in between, whatever the springs' law
    assert path.tension[0, 0] < half.tension[0, 0] < kept.tension[0, 0]


def corded(hooked: float) -> tuple[Twin, Equilibrium]:
    """Cords that 0.7 N, the springs' first pull, stretch by 0.21 mm and by a toe of 0.4 (1 - exp(-0.7/0.4)) = 0.33 mm."""
    law = effect_class("tendon_elasticity")({"stretch": 3e-4, "toe": 4e-4, "toe_tension": 0.4, "hooked": hooked})
    twin = Twin(load("continuum"), {}, (law,))
    return twin, Equilibrium(twin.robot.chain(twin.body()))


def test_springs_hooked_in_under_their_first_tension_are_as_long_as_described() -> None:
    """Else they are shorter by what that tension stretches, and pull the less: by some 0.4 mm at 785 N/m, 0.3 N."""
    twin, solver = corded(1.0)
    path = cold(twin, solver)
    np.testing.assert_allclose(path.tension[0], 0.7, rtol=2e-3)
    shown = _spring_elongations(path, 0, solver, twin.effect_chain.route, springs())
    assert shown is not None
    np.testing.assert_allclose(shown[:, 0], springs().initial_elongation, rtol=0, atol=5e-6)
    slack = cold(*corded(0.0))
    lost = 785.0 * twin.effect_chain.route.elongation(slack.tension[0])
    np.testing.assert_allclose(slack.tension[0], 0.7 - lost, rtol=0, atol=0.02)
    assert np.all(lost > 0.2)


@pytest.mark.parametrize("put_on", [lambda: bent(0.0), lambda: bent(1.0), lambda: corded(0.0), lambda: corded(1.0)])
def test_heat_steps_find_the_springs_where_they_were_put_on(put_on: Callable[[], tuple[Twin, Equilibrium]]) -> None:
    """A robot that is led from outside stands where a prediction has it; its pictures show springs of that length."""
    twin, solver = put_on()
    robot, path = HeatedRobot(twin, Loads(np.zeros(3)), ROOM), cold(twin, solver, 1.0)
    np.testing.assert_allclose(robot.tension, path.tension[0], rtol=0, atol=1e-4)
    robot.step(np.ones(3), 20.0)
    np.testing.assert_allclose(robot.tension, path.tension[1], rtol=0, atol=1e-4)
    shown = _spring_elongations(path, 1, solver, twin.effect_chain.route, springs())
    assert shown is not None
    np.testing.assert_allclose(shown[:, 0], robot.elongation, rtol=0, atol=1e-6)


def test_steps_of_20_ms_are_stable_and_converge() -> None:
    end = []
    for dt in (0.02, 0.25, 0.5, 1.0):
        time = np.arange(0.0, 60.0 + dt / 2, dt)
        path = drive(time, turns(time), HANGING)
        assert np.abs(np.diff(path.markers[:, -1], axis=0)).max() < 3e-3 * max(dt, 0.05) / 0.25  # m: it does not jump
        end.append(path.others["temperature"][-1])
    error = [float(np.abs(T - end[0]).max()) for T in end[1:]]
    assert error[0] < 0.6 * error[1] < 0.36 * error[2]
    assert error[0] < 0.5  # K at 0.25 s


def test_random_currents_always_find_their_equilibrium() -> None:
    rng = np.random.default_rng(4)
    for _ in range(12):
        dt = rng.choice([0.02, 0.5, 2.0])
        time = np.arange(0.0, 100.0, dt)
        level = rng.uniform(0.0, 1.6, (8, 3)) * (rng.random((8, 3)) < 0.5)
        loads = Loads(9.81 * np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0]), 0.01)
        path = drive(time, level[(8 * np.arange(len(time))) // len(time)], loads, Route(rng.choice([0.0, 0.15]), 4e-4, 5e-5))
        assert path.tension.min() >= 0.0


# ---- from a recording ----------------------------------------------------------------------------------------------------

OUTPUTS = ("disk_8_x", "disk_8_y", "disk_8_z", "tendon_1_tension", "tendon_1_displacement")


def recording(drives: dict[str, np.ndarray], time: np.ndarray, extra: tuple[str, ...] = ("sma_1_temperature", "sma_1_resistance")):
    units = {"current": "A", "voltage": "V", "tension": "N", "displacement": "mm", "temperature": "degC", "resistance": "ohm"}
    channels = [Channel(name, "input", units[name.rpartition("_")[2]]) for name in drives]
    said = [name for name in (*OUTPUTS, *extra) if name not in drives]
    channels += [Channel(name, "output", units.get(name.rpartition("_")[2], "mm")) for name in said]
    values = {**{name: np.zeros(len(time)) for name in (*OUTPUTS, *extra)}, **drives}
    trial = Trial("one.csv", time, values, {"tip_payload": 0.01, "ambient_temperature": ROOM})
    return Recording("continuum", "springs", "simulation: by hand", np.array([9.81, 0.0, 0.0]), tuple(channels), (trial,))


def test_currents_and_voltages_drive_the_same() -> None:
    time = np.arange(0.0, 60.0, 0.5)
    I = turns(time)
    twin = Twin.of("continuum")
    amperes = twin.predict(recording({f"sma_{i + 1}_current": I[:, i] for i in range(3)}, time)).trials[0].values
    volts = twin.predict(recording({f"sma_{i + 1}_voltage": 0.45 * I[:, i] for i in range(3)}, time)).trials[0].values
    for name in (*OUTPUTS, "sma_1_temperature"):
        np.testing.assert_allclose(volts[name], amperes[name], rtol=1e-9, atol=1e-9)
    assert amperes["sma_1_temperature"].max() > 350.0
    assert (amperes["sma_1_resistance"] == 0.45).all()


def test_a_spring_beside_two_given_tensions() -> None:
    """One spring and two tensions: the spring's tension, given as a tension too, holds the same shape."""
    time = np.arange(0.0, 60.0, 0.5)
    pulled = {f"tendon_{i}_tension": np.full(len(time), 0.5) for i in (2, 3)}
    twin = Twin.of("continuum")
    mixed = twin.predict(recording({"sma_1_current": turns(time)[:, 0], **pulled}, time)).trials[0].values
    drives = {"tendon_1_tension": mixed["tendon_1_tension"], **pulled}
    again = twin.predict(recording(drives, time, ()), dynamic=False).trials[0].values
    assert np.ptp(mixed["tendon_1_tension"]) > 0.3
    for name in OUTPUTS[:3]:
        np.testing.assert_allclose(again[name], mixed[name], rtol=0, atol=3e-7)  # m: two solutions of one shape, as in test_lengths


def test_a_spring_that_is_not_driven_tells_nothing() -> None:
    time = np.arange(0.0, 5.0)
    bench = prepare(recording({f"tendon_{i}_tension": np.zeros(5) for i in (1, 2, 3)}, time), load("continuum"))
    assert {o.group for o in bench.outputs} == {"marker", "displacement"}
    assert any("sma_1_temperature is not predicted" in notice for notice in bench.notices)
    predicted = [t.true for t in simulate(Twin.of("continuum"), bench)]
    assert not list(effect_class("sma_cooling").fit_starts(predicted, 3))
    assert not list(effect_class("sma_hysteresis").fit_starts(predicted, 3))


def test_a_robot_without_springs_says_so() -> None:
    time = np.arange(0.0, 5.0)
    bare = load("continuum")
    bare = replace(bare, parameters=tuple(p for p in bare.parameters if not p.name.startswith("springs.")))
    with pytest.raises(DataError, match=r"no SMA springs.*displacements"):
        prepare(recording({f"sma_{i}_current": np.zeros(5) for i in (1, 2, 3)}, time), bare)


def test_a_draught_and_a_wider_loop_do_what_they_say() -> None:
    time = np.arange(0.0, 60.0, 0.5)
    bench = prepare(recording({f"sma_{i + 1}_current": turns(time)[:, i] for i in range(3)}, time), load("continuum"))

    def predicted(*effects):
        twin = Twin(bench.robot, {}, effects)
        return output_columns(bench, EffectChain(effects).sense(simulate(twin, bench)[0].true))

    names = [o.channel.name for o in bench.outputs]
    T, pulls = names.index("sma_1_temperature"), names.index("tendon_1_tension")
    plain = predicted()
    windy = predicted(effect_class("sma_cooling")({"factor": 1.5}, 3))
    assert (windy[1:, T] < plain[1:, T]).all()
    late = predicted(effect_class("sma_hysteresis")({"shift": 5.0, "width": 0.0}, 3))
    np.testing.assert_allclose(late[:, T], plain[:, T], atol=3.0)  # K: it cools a little otherwise at another elongation
    assert late[:40, pulls].max() < plain[:40, pulls].max() - 0.1  # N: it needs more heat


# ---- from the command line -----------------------------------------------------------------------------------------------


def test_a_current_driven_set_is_simulated_from_the_command_line(tmp_path: Path) -> None:
    """The bench's described robot, two trials: what the twin writes is what was logged, but for the instruments."""
    rng = np.random.default_rng(3)
    day = bench_day("by_current", rng)
    day = replace(day, trials=tuple(t for t in day.trials if t.name in ("turns_1", "pair_2")))
    noise = Noise()
    write_set(tmp_path / "day", "two heatings", day, run(Rod(), [], day), noise, rng)
    done = twin("simulate", "continuum", tmp_path / "day", "--out", tmp_path / "again", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    logged, again = read(tmp_path / "day"), read(tmp_path / "again")
    for a, b in zip(logged.trials, again.trials, strict=True):
        for channel in logged.outputs():
            error = a.values[channel.name] - b.values[channel.name]
            # A tenth more than the instrument's: the readings that drive the twin are noisy too. Tensions feel those most.
            most = (2.0 if channel.kind == "tendon_tension" else 1.2) * (channel.noise or 0.0)
            assert np.sqrt(np.nanmean(error**2)) < most, channel.name


def test_a_spring_pulls_in_what_its_elastic_tendon_stretches_too(tmp_path: Path) -> None:
    """0.2 mm/N on the bench and in the twin: the same displacements at the springs' ends, which are not the paths' own."""
    rng = np.random.default_rng(4)
    day = bench_day("by_current", rng)
    day = replace(day, trials=tuple(t for t in day.trials if t.name in ("turns_1", "pair_2")))
    noise = Noise()
    write_set(
        tmp_path / "day",
        "an elastic tendon",
        day,
        run(Rod(), [TendonElasticity(4.0, 0.0, 1.0)], day),
        noise,
        rng,
        displacement=True,
    )
    robot = load("continuum")
    bench = prepare(read(tmp_path / "day"), robot)
    at = [i for i, o in enumerate(bench.outputs) if o.channel.kind == "tendon_displacement"]
    assert len(at) == 3

    def missed(*effects: Effect) -> float:
        """RMS, in the encoders' noise."""
        seen = output_columns(bench, EffectChain(effects).sense(simulate(replace(Twin.of(robot), effects=effects), bench)[0].true))
        return float(np.sqrt(np.nanmean((bench.measured[0] - seen)[:, at] ** 2))) / noise.displacement

    # The readings of the currents that drive the twin are noisy too: 1.20 in all; without the stretch 19.
    assert missed(effect_class("tendon_elasticity")({"stretch": 2e-4, "hooked": 0.0}, 3)) < 1.5
    assert missed() > 5.0


@pytest.mark.parametrize("name", ["sma_cooling", "sma_hysteresis"])
def test_fits_of_springs_begin_on_both_sides_of_their_description(name: str) -> None:
    """Of what springs share: about as far below as above, or a fit that may go either way only ever looks one way."""
    law = effect_class(name)
    off = {p.name: p.value for p in law.parameters}
    heated = SimpleNamespace(driven_by_current=np.ones((1, 3), bool))
    away: dict[str, list[float]] = {}
    for start in law.fit_starts([heated], 1):  # type: ignore[list-item]
        for parameter, value in start.values.items():
            away.setdefault(parameter, []).append(value - off[parameter])
    assert away
    for parameter, sides in away.items():
        above, below = max(sides), -min(sides)
        assert above > 0.0 < below, parameter
        assert 1.0 / 1.5 < above / below < 1.5, parameter
    assert not list(law.fit_starts([SimpleNamespace(driven_by_current=np.zeros((1, 3), bool))], 1))  # type: ignore[list-item]
