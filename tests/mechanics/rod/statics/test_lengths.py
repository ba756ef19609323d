"""Drive by displacement: against the drive by tension, the independent rod, and what a tendon may do (pull or be slack)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tools.simulators.rod.bench import run
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.mechanics.rod import Rod
from twin.body import SOLVE_TOLERANCE, Drive, Loads, Problem, Route, Solution
from twin.effects import effect_class
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.lengths import GAP_PER_ANGLE
from twin.mechanics.rod.balance.tendon_actuation import BACKBONE_COMPLIANCE, LEAST_STRETCH, STALL_COMPLIANCE
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

SIDEWAYS, NOWHERE = Loads(np.array([9.81, 0.0, 0.0]), 0.01), Loads(np.zeros(3))
ALL = np.ones(3, bool)
PAID_OUT = 2e-3  # m: a tendon this much longer than its path is slack
SHUT = 1.01 * GAP_PER_ANGLE * SOLVE_TOLERANCE  # m: the gap at which the solver stops, and rounding

# Newton stops with every hinge within 1e-7 rad of balance; over 16 joint sets of a 0.12 m robot the tip is then within 1e-7 m, and
# two solutions within twice that. The gap that counts as closed, 2e-8 m, is 1e-5 N at the 2 mm/N or more this robot gives way.
SAME_SHAPE = 3e-7  # m
SAME_TENSION = 3e-5  # N


@cache
def solver() -> Equilibrium:
    return Equilibrium(load("continuum").build())


def pulls(n: int = 60) -> np.ndarray:
    """Tensions (n, 3) N in which two tendons pull and the third hangs, in turns, from rest: 3 N and back."""
    t = np.linspace(0.0, 3.0, n)
    level = 3.0 * np.sin(np.pi * np.minimum(t % 1.0, 1.0)) ** 2
    T = np.zeros((n, 3))
    for k, turn in enumerate(np.minimum(t.astype(int), 2)):
        T[k, turn], T[k, (turn + 1) % 3] = level[k], 0.4 * level[k]
    return T


def displacement(path: Solution, stretch: float = LEAST_STRETCH, which: np.ndarray = ALL) -> np.ndarray:
    """What motors must do (n, 3) m for a solution's tensions: the path's shortening, the stretch and the backbone's compression;
    slack tendons paid out."""
    u = solver().straight_path - path.path + stretch * path.tension + BACKBONE_COMPLIANCE * path.tension @ np.outer(which, which)
    return np.where(path.tension > 0.0, u, u - PAID_OUT)


def by_tension(T: np.ndarray, loads: Loads, route: Route | None = None) -> Solution:
    return solver().solve(Problem(np.arange(len(T), dtype=float), T, loads, route or Route()))


def by_length(u: np.ndarray, loads: Loads, route: Route | None = None, which: np.ndarray = ALL) -> Solution:
    path = solver().solve(
        Problem(
            np.arange(len(u), dtype=float),
            u,
            loads,
            route or Route(),
            tuple(Drive.DISPLACEMENT if w else Drive.TENSION for w in which),
        )
    )
    assert path.status.all()
    return path


@pytest.mark.parametrize("stretch", [LEAST_STRETCH, 5e-5, 5e-4])
def test_the_displacements_of_tensions_give_those_tensions(stretch: float) -> None:
    T = pulls()
    truth = by_tension(T, SIDEWAYS)
    found = by_length(displacement(truth, stretch), SIDEWAYS, Route(stretch=stretch))
    np.testing.assert_allclose(found.tension, T, rtol=0, atol=SAME_TENSION)
    np.testing.assert_allclose(found.markers, truth.markers, rtol=0, atol=SAME_SHAPE)


@pytest.mark.parametrize("amount", [2e-4, 2e-3])
@pytest.mark.parametrize("over", [0.3, 5.0])
def test_tendons_that_bed_in_are_longer_by_their_law(amount: float, over: float) -> None:
    """Motors that take up, beside what tensions need of a stiff tendon, amount (1 - exp(-T / over)), make those tensions."""
    T = pulls()
    truth = by_tension(T, SIDEWAYS)
    u = displacement(truth) + amount * (1.0 - np.exp(-T / over))
    found = by_length(u, SIDEWAYS, Route(bedding=amount, bedding_tension=over))
    np.testing.assert_allclose(found.tension, T, rtol=0, atol=SAME_TENSION)
    np.testing.assert_allclose(found.markers, truth.markers, rtol=0, atol=SAME_SHAPE)
    stiff = by_length(u, SIDEWAYS)
    assert np.abs(stiff.markers - truth.markers).max() > 5e-4, "it shows"


@pytest.mark.parametrize("stretch", [LEAST_STRETCH, 5e-4])
@pytest.mark.parametrize("bedding", [0.0, 2e-4])
@pytest.mark.parametrize("stall", [0.7, 1.5, 2.9])
def test_motors_that_stall_hold_a_tension_and_no_length(stall: float, bedding: float, stretch: float) -> None:
    """The shapes that tensions up to the stall make, and motors told to wind in up to 5 mm more than these take: the same, at the
    stall where they were told so and at their lengths elsewhere, on the way up and back."""
    T = pulls()
    cut = np.minimum(T, stall)
    truth = by_tension(cut, SIDEWAYS)
    more = 5e-3 * np.maximum(T - stall, 0.0) / (3.0 - stall)
    u = displacement(truth, stretch) + bedding * (1.0 - np.exp(-cut / 0.5)) + more
    route = Route(stretch=stretch, bedding=bedding, bedding_tension=0.5, stall_tension=stall)
    found = by_length(u, SIDEWAYS, route)
    # What is wound in besides makes a tenth of a millinewton a millimetre, less in the others, and the tip moves by 40 mm/N.
    extra = more.max() / STALL_COMPLIANCE
    np.testing.assert_allclose(found.tension, cut, rtol=0, atol=SAME_TENSION + extra)
    np.testing.assert_allclose(found.markers, truth.markers, rtol=0, atol=SAME_SHAPE + 0.04 * extra)
    assert np.abs(by_tension(T, SIDEWAYS).markers - truth.markers).max() > 1e-3, "it shows"


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_a_motor_stalls_at_its_tension_whatever_the_bodys_stiffness(factor: float) -> None:
    u = displacement(by_tension(pulls(), NOWHERE))
    problem = Problem(np.arange(len(u), dtype=float), u, NOWHERE, Route(stall_tension=0.5), (Drive.DISPLACEMENT,) * 3)
    found = solver().solve(replace(problem, stiffness=np.full(len(u), factor)))
    assert found.status.all()
    assert found.tension.max() == pytest.approx(0.5, abs=2e-3)  # 12 mm more than it gives: a millinewton
    again = solver().solve(
        Problem(np.arange(len(u), dtype=float), found.tension, NOWHERE, Route(), stiffness=np.full(len(u), factor))
    )
    np.testing.assert_allclose(found.markers, again.markers, rtol=0, atol=SAME_SHAPE)


def test_from_a_neighbour_that_stalled_elsewhere_one_step_is_first_order() -> None:
    """What a fit's derivatives are taken by: all samples in one Newton step from the solution at another stall."""
    u = displacement(by_tension(pulls(), SIDEWAYS))
    problem = Problem(np.arange(len(u), dtype=float), u, SIDEWAYS, Route(stall_tension=1.5), (Drive.DISPLACEMENT,) * 3, keep=True)
    near = solver().solve(problem)
    there = replace(problem, route=Route(stall_tension=1.501), neighbour=near, keep=False)
    full, once = (solver().solve(replace(there, once=o)).markers for o in (False, True))
    moved = np.abs(full - near.markers).max()
    assert moved > 1e-5  # m: it shows
    np.testing.assert_allclose(once, full, rtol=0, atol=0.02 * moved)  # second order, and samples that begin or end to stall


def test_a_twin_shows_how_much_longer_its_tendons_are() -> None:
    """Driven by tensions the displacement alone knows; driven by that displacement the tensions come back."""
    robot, T = load("continuum"), pulls()
    effect = effect_class("tendon_elasticity")({"toe": 5e-4, "toe_tension": 0.5}, 3)
    names = [f"tendon_{i}" for i in (1, 2, 3)]

    def day(driven: str, shown: str, values: np.ndarray) -> Recording:
        unit = {"tension": "N", "displacement": "m"}
        channels = [Channel(f"{n}_{driven}", "input", unit[driven]) for n in names]
        channels += [Channel(f"{n}_{shown}", "output", unit[shown]) for n in names]
        columns = {f"{n}_{driven}": values[:, i] for i, n in enumerate(names)} | {f"{n}_{shown}": 0.0 * values[:, 0] for n in names}
        trial = Trial("a", np.arange(len(values), dtype=float), columns)
        return Recording("continuum", "made", "simulation", None, tuple(channels), (trial,))

    def predicted(effects: tuple, recording: Recording, shown: str) -> np.ndarray:
        out = Twin(robot, {}, effects).predict(recording, dynamic=False).trials[0].values
        return np.stack([out[f"{n}_{shown}"] for n in names], axis=1)

    pulled = day("tension", "displacement", T)
    longer = predicted((effect,), pulled, "displacement") - predicted((), pulled, "displacement")
    np.testing.assert_allclose(longer, 5e-4 * (1.0 - np.exp(-T / 0.5)), rtol=0, atol=1e-9)
    held = day("displacement", "tension", predicted((effect,), pulled, "displacement"))
    # The twin's backbone gives way to tendons held at lengths by 1 um/N, which tensions do not have: 5 um of some 2 mm/N.
    np.testing.assert_allclose(predicted((effect,), held, "tension"), T, rtol=0, atol=0.02)


@pytest.mark.parametrize("route", [Route(), Route(0.2, 4e-4), Route(0.2, 4e-4, 2e-4)], ids=["smooth", "friction", "and stretch"])
def test_the_tensions_found_give_the_same_shape(route: Route) -> None:
    """Without weight, from rest: so friction has one history, whichever way the robot is driven. Each tendon in turn."""
    pulled = pulls() == pulls().max(axis=1, keepdims=True)
    u = 12e-3 * pulls().max(axis=1, keepdims=True) / 3.0 * np.where(pulled, 1.0, -1.0)
    found = by_length(u, NOWHERE, route)
    assert found.tension.max() > 2.0  # N: they do pull
    again = by_tension(found.tension, NOWHERE, route)
    np.testing.assert_allclose(again.markers, found.markers, rtol=0, atol=SAME_SHAPE)
    np.testing.assert_allclose(again.path, found.path, rtol=0, atol=SAME_SHAPE)


@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("stretch", [LEAST_STRETCH, 2e-4])
def test_a_tendon_pulls_at_its_length_or_is_slack(mu: float, stretch: float) -> None:
    """T >= 0, path <= free length + stretch T, and one of the two is an equality; on motions nobody has planned."""
    u = np.random.default_rng(1).uniform(-4e-3, 8e-3, (6, 3))
    u = np.stack([np.interp(np.linspace(0, 5, 101), np.arange(6), c) for c in u.T], axis=1)
    u[:, 2] = -u[:, 0] - u[:, 1] - 1e-3  # a bent robot's three displacements add up to about nothing: more would tear at it
    found = by_length(u, SIDEWAYS, Route(mu, 4e-4, stretch))
    gap = (
        found.path
        - (solver().straight_path - u)
        - stretch * found.tension
        - BACKBONE_COMPLIANCE * found.tension.sum(axis=1, keepdims=True)
    )
    taut = found.tension > 0.0
    assert 0.2 < taut.mean() < 0.9  # both happen
    assert found.tension.min() == 0.0
    assert gap.max() < SHUT
    assert np.abs(gap[taut]).max() < SHUT
    assert gap[~taut].min() < -1e-4  # m: slack is slack


def test_three_taut_tendons_of_an_elastic_rig_have_tensions_in_a_twin_that_knows_no_stretch() -> None:
    """0.1 mm/N of stretch and 0.4 N in every tendon at least: inextensible ones would have to carry some 10 N more, and do."""
    T = 0.6 * pulls() + 0.4
    u = displacement(by_tension(T, SIDEWAYS), 1e-4)
    stiff = by_length(u, SIDEWAYS)
    assert (stiff.tension > T - SAME_TENSION).all()
    np.testing.assert_allclose(by_length(u, SIDEWAYS, Route(stretch=1e-4)).tension, T, rtol=0, atol=SAME_TENSION)


def test_a_robot_with_all_tendons_paid_out_hangs_as_without_them() -> None:
    found = by_length(np.full((5, 3), -0.05), SIDEWAYS)
    assert not found.tension.any()
    np.testing.assert_allclose(found.markers, by_tension(np.zeros((5, 3)), SIDEWAYS).markers, rtol=0, atol=SAME_SHAPE)


def test_an_elastic_tendon_gives_less_of_its_displacement() -> None:
    u = np.outer(np.linspace(0.0, 10e-3, 20), [1.0, -1.0, -1.0])
    stiff, soft = (by_length(u, NOWHERE, Route(stretch=s)) for s in (LEAST_STRETCH, 1e-3))
    assert (soft.tension[1:, 0] < stiff.tension[1:, 0]).all()
    # The robot is a spring of c m/N at this tendon; in series with 1 mm/N the same travel is shared: T_soft (c + 1e-3) = T_stiff c.
    c = u[-1, 0] / stiff.tension[-1, 0]
    share = c / (c + 1e-3)
    # The spring hardens as it bends (its tendon's chord comes nearer): by 3 % over this range, and 1 - share of that counts.
    assert soft.tension[-1, 0] / stiff.tension[-1, 0] == pytest.approx(share, abs=0.03 * (1.0 - share))


@pytest.mark.parametrize("free", [0, 1, 2])
def test_some_tendons_by_tension_and_others_by_displacement(free: int) -> None:
    T = pulls()
    truth = by_tension(T, SIDEWAYS)
    which = np.arange(3) != free
    found = by_length(np.where(which, displacement(truth, which=which), T), SIDEWAYS, which=which)
    np.testing.assert_array_equal(found.tension[:, free], T[:, free])
    np.testing.assert_allclose(found.tension, T, rtol=0, atol=SAME_TENSION)
    np.testing.assert_allclose(found.markers, truth.markers, rtol=0, atol=SAME_SHAPE)


@pytest.mark.parametrize("seed", [3, 4])
def test_it_is_the_rods_bench_day(seed: int) -> None:
    """Trials of the bench's design "by_length" run on the described rod, which shares no code with the twin."""
    day = bench_day("by_length", np.random.default_rng(seed))
    few = tuple(t for t in day.trials if t.name in ("slow_1", "pair_2", "wander_3"))
    for log in run(Rod(), [], replace(day, trials=few)):
        found = by_length(log.displacement, Loads(np.array(day.gravity), log.trial.payload))
        assert log.tension.max() > 2.0  # N
        # With given tensions the tip is within 0.05 % of the length (test_equilibrium); given lengths leave less to choose: 0.04 mm
        # and 2 mN were the most over six trials. Three times that is still half of what a load cell reads to.
        np.testing.assert_allclose(found.markers[:, : log.markers.shape[1]], log.markers, rtol=0, atol=1.2e-4)
        np.testing.assert_allclose(found.tension, log.tension, rtol=0, atol=6e-3)


# ---- from a recording ----------------------------------------------------------------------------------------------------


def recording(drives: dict[str, np.ndarray], outputs: tuple[str, ...]) -> Recording:
    n = len(next(iter(drives.values())))
    channels = [Channel(name, "input", "N" if name.endswith("tension") else "mm") for name in drives]
    channels += [Channel(name, "output", "N" if name.endswith("tension") else "mm") for name in outputs]
    values = {**drives, **{name: np.zeros(n) for name in outputs}}
    trial = Trial("one.csv", np.arange(n, dtype=float), values, {"tip_payload": 0.01})
    return Recording("continuum", "drives", "simulation: by hand", np.array([9.81, 0.0, 0.0]), tuple(channels), (trial,))


def test_a_mixed_set_is_predicted_and_repeats_the_one_by_tension() -> None:
    twin = Twin.of("continuum")
    tip, T = ("disk_8_x", "disk_8_y", "disk_8_z"), pulls()
    of_tension = {f"tendon_{i + 1}_tension": T[:, i] for i in range(3)}
    logged = twin.predict(recording(of_tension, (*tip, "tendon_2_displacement", "tendon_3_displacement"))).trials[0].values
    paid_out = {f"tendon_{i}_displacement": logged[f"tendon_{i}_displacement"] - PAID_OUT * (T[:, i - 1] == 0.0) for i in (2, 3)}
    drives = {"tendon_1_tension": T[:, 0], **paid_out}
    lost = 3.0 * LEAST_STRETCH + 4.2 * BACKBONE_COMPLIANCE  # m: 3 N in one tendon, 4.2 in all
    again = twin.predict(recording(drives, (*tip, "tendon_2_tension", "tendon_3_tension"))).trials[0].values
    for name in tip:
        # m: the displacement is that of an inextensible tendon, a driven one gives `lost` of it, of which the tip makes up to ten
        # times as much (0.12 m of body, 8 mm from its axis: 15).
        np.testing.assert_allclose(again[name], logged[name], rtol=0, atol=15 * lost)
    for i in (2, 3):
        # N: the same at 2 mm/N; and shapes that follow tensions by the damping time, 10 ms, are held by those of then.
        late = 0.01 * np.abs(np.diff(T, axis=0)).max()  # rows of a second
        np.testing.assert_allclose(again[f"tendon_{i}_tension"], T[:, i - 1], rtol=0, atol=lost / 2e-3 + 1.3 * late)


@pytest.mark.parametrize(
    ("drives", "said"),
    [
        (("tendon_1_tension", "tendon_2_displacement"), "give tendon_3_tension or tendon_3_displacement"),
        (
            ("tendon_1_tension", "tendon_2_displacement", "tendon_2_tension", "tendon_3_tension"),
            "tendon_2_tension and tendon_2_displacement drive the same tendon",
        ),
    ],
)
def test_a_tendon_driven_twice_or_not_at_all_is_refused(drives: tuple[str, ...], said: str) -> None:
    with pytest.raises(DataError, match=said) as refused:
        prepare(recording(dict.fromkeys(drives, np.zeros(3)), ("disk_8_x",)), load("continuum"))
    assert "\n" not in str(refused.value)
