"""The static solve against an independent rod, closed forms, its own energy by another route, and friction's known facts."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tools.bench.rod import NoEquilibrium, Rod, follow
from tools.bench.rod import solve as rod_solve
from twin.effects import Loads, Route, catalogue
from twin.equilibrium import DIRECT, NOT_FOUND, Equilibrium
from twin.equilibrium.chain import Law, Load, balance
from twin.equilibrium.elastic import BEAM_COLUMN, COUPLING
from twin.equilibrium.newton import place
from twin.robots import Body, hinge_pairs, load

G = 9.81
LENGTH = 0.12
EI = 77.59e9 * np.pi / 4 * 0.4e-3**4
HANGING, UPRIGHT, SIDEWAYS, NOWHERE = (np.array(g, float) for g in ([0, 0, G], [0, 0, -G], [G, 0, 0], [0, 0, 0]))
FRICTION = Route(0.2, 4e-4)
EXACT = 1e-11  # rad in every hinge


@cache
def solver() -> Equilibrium:
    return Equilibrium(load("continuum").build())


def tips(path) -> np.ndarray:
    return path.markers[:, 7]


def swept(*poses: tuple[float, float, float], each: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Times and tensions of straight lines from pose to pose."""
    knots = np.arange(len(poses)) * float(each)
    t = np.arange((len(poses) - 1) * each + 1, dtype=float)
    return t, np.stack([np.interp(t, knots, c) for c in np.array(poses, float).T], axis=1)


# ---- against the rod equations -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("planar", [True, False], ids=["in plane", "3D"])
@pytest.mark.parametrize("case", ["hanging", "sideways", "backwards", "upright", "any"])
def test_the_tip_is_the_rods(case: str, planar: bool) -> None:
    """Random tensions 0-4 N and payloads 0-30 g (upright 0-10 g) against the Kirchhoff rod of tools/bench."""
    rng = np.random.default_rng([ord(case[0]), planar])
    worst, snapped = 0.0, 0
    for _ in range(40):
        g = {"hanging": HANGING, "sideways": SIDEWAYS, "backwards": -SIDEWAYS, "upright": UPRIGHT}.get(case)
        if g is None:
            g = rng.normal(size=3) * [1, not planar, 1]
            g *= G / np.linalg.norm(g)
        heaviest = 0.01 if g[2] < 0 else 0.03  # upright beyond 25 g it buckles
        payload = rng.uniform(0, heaviest)
        tension = np.array([rng.uniform(0, 4), 0, 0]) if planar else rng.uniform(0, 4, 3) * (rng.uniform(size=3) < 0.7)
        path = solver().solve(np.zeros(1), tension[None], Loads(g, payload))
        assert path.status.all()
        assert not path.unstable_start
        try:
            rod = rod_solve(Rod(), tension, gravity=g, payload=payload)
        except NoEquilibrium:  # pulled against its payload until it snaps over: the rod is followed by continuation only
            snapped += 1
            continue
        worst = max(worst, float(np.linalg.norm(tips(path)[0] - rod.disks[-1])))
    assert snapped <= 2
    # Two hinge sets an interval are second order: at 4 N, 145 degrees of bend, a tip error of 0.06 % of the length was measured
    # over 2,000 poses. The contract's bounds leave a factor of two.
    assert worst < (1.0e-3 if planar else 1.5e-3) * LENGTH


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_with_friction_the_tip_is_the_rods(mu: float) -> None:
    """Loading, unloading and loading again, both laws with so short a pre-sliding that holes slide or reverse at once."""
    t, T = swept((0, 0, 0), (3, 0, 0), (1, 0, 0), (2.5, 1, 0), each=60)
    ours = tips(solver().solve(t, T, Loads(SIDEWAYS, 0.01), Route(mu, 2e-5)))
    lead = np.array([0.25, 0.5, 0.75])
    drive, weight = np.vstack([np.zeros((3, 3)), T]), np.append(lead, np.ones(len(T)))
    rod = follow(Rod(), drive, gravity=SIDEWAYS, payload=0.01, weight=weight, mu=mu, stroke=2e-5)
    # m: 0.15 % of the length as above; 0.1 mm for a reversal that the two pre-sliding laws (linear, Iwan) share out differently
    # over 2e-5 m of travel; and the rounded turn angle, which loses mu * 1e-3 rad at each of 7 holes, 0.2 % of the 80 mm bend.
    np.testing.assert_allclose(ours, rod.disks[3:, -1], rtol=0, atol=1.5e-3 * LENGTH + 1e-4 + mu * 7e-3 * 0.08)


# ---- closed forms --------------------------------------------------------------------------------------------------------


def bent_by(angle: float) -> np.ndarray:
    """Tip of an arc of the robot's length in the x-z plane that turns by `angle` (rad)."""
    return LENGTH / angle * np.array([1 - np.cos(angle), 0, np.sin(angle)])


def unweighted(radius_change: float = 0.0) -> Equilibrium:
    body = load("continuum").build()
    catalogue()["tendon_routing"]({f"radius_{i}": radius_change for i in (1, 2, 3)}).edit(body)
    return Equilibrium(body)


@pytest.mark.parametrize(("radius", "tension"), [(8e-3, 0.1), (8e-3, 0.5), (4e-3, 0.5)])
def test_one_tendon_bends_it_into_arcs(radius: float, tension: float) -> None:
    """Without gravity each interval is an arc that turns by the same angle; the tendon is its chord.

    The angle minimises EI th^2 / (2 h) + 2 T (h / th - r) sin(th / 2).
    """
    h = LENGTH / 8
    theta = tension * radius * h / EI
    for _ in range(50):  # bisection would do; Newton on the derivative of that energy
        s, c = np.sin(theta / 2), np.cos(theta / 2)
        slope = EI * theta / h + 2 * tension * (-h / theta**2 * s + (h / theta - radius) * c / 2)
        curve = EI / h + 2 * tension * (2 * h / theta**3 * s - h / theta**2 * c - (h / theta - radius) * s / 4)
        theta -= slope / curve
    tip = tips(unweighted(radius - 8e-3).solve(np.zeros(1), np.array([[tension, 0, 0]]), Loads(NOWHERE), tolerance=EXACT))[0]
    # m: the chord's distance from the arc changes by th h / 8 within an interval, which makes the curvature uneven by that
    # share of r, at most 0.9 %: its mean is in the formula, the rest is even within each interval and counts by its square.
    np.testing.assert_allclose(tip, bent_by(8 * theta), rtol=0, atol=2e-4 * bent_by(8 * theta)[0])


def test_constant_curvature_of_the_published_comparison() -> None:
    """Tip of 9.212 / 119.527 mm at 0.5 N and 4 mm, the formula other libraries are compared by (tendon along the arc)."""
    tip = tips(unweighted(-4e-3).solve(np.zeros(1), np.array([[0.5, 0, 0]]), Loads(NOWHERE)))[0]
    # mm: straight cable between eight disks instead of one along the arc shortens less: 0.05 mm, 0.5 % of the bend. A published
    # Cosserat solver with straight cable between five disks says 9.247.
    np.testing.assert_allclose(1e3 * tip, [9.212, 0.0, 119.527], rtol=0, atol=0.07)


def test_a_tip_force_bends_it_as_a_cantilever() -> None:
    force = 1e-4
    tip = tips(solver().solve(np.zeros(1), np.zeros((1, 3)), Loads(NOWHERE, force=np.array([0, force, 0])), tolerance=EXACT))[0]
    # m: F L^3 / (3 EI) = 37 um. Two joint sets with a coupling integrate a linear moment exactly but for the rod's part within
    # each interval, (h / L)^2 / 4 = 0.4 % at most.
    np.testing.assert_allclose(tip, [0, force * LENGTH**3 / (3 * EI), LENGTH], rtol=0, atol=1.5e-7)


def test_it_buckles_where_euler_says() -> None:
    """Payload and own weight W upright: P / P_cr + W / W_cr = 1, P_cr = pi^2 EI / 4 L^2, W_cr = 7.837 EI / L^2 (Greenhill)."""
    weight = 5.64e-3 * G
    limit = np.pi**2 * EI / (4 * LENGTH**2) * (1 - weight / (7.837 * EI / LENGTH**2)) / G
    slack, time = np.zeros((1, 3)), np.zeros(1)
    # Dunkerley's sum is within a few per cent, and the disks' weights sit a sixteenth of the length higher than W's.
    assert not solver().solve(time, slack, Loads(UPRIGHT, 0.95 * limit)).unstable_start
    assert solver().solve(time, slack, Loads(UPRIGHT, 1.05 * limit)).unstable_start
    assert solver().solve(time, slack, Loads(UPRIGHT, 0.03), FRICTION).unstable_start
    assert not solver().solve(time, slack, Loads(HANGING, 0.03)).unstable_start
    assert not solver().solve(time, slack, Loads(SIDEWAYS, 0.03)).unstable_start


# ---- the balance of forces by another route -----------------------------------------------------------------------------------


class Energy:
    """The chain's energy from scipy's rotations and MuJoCo's forward kinematics; none of the solver's code."""

    def __init__(self, body: Body) -> None:
        self.body, self.model = body, body.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.stiffness = self.model.jnt_stiffness.reshape(self.model.nv, -1)[:, 0]
        joint = self.model.joint
        sets = [(at, sorted(joint(n).id for n in (at.bend_x, at.bend_y, at.twist))) for at in body.joints]
        self.sets = [ids for _, ids in sets]
        self.pairs = [(joint(a).id, joint(b).id) for a, b in hinge_pairs(body)]
        self.slender = np.zeros(self.model.nv)  # of the interval: h^2 / EI, for bending
        for at, _ in sets:
            for n in (at.bend_x, at.bend_y):
                self.slender[joint(n).id] = (2 * at.length) ** 2 / (self.stiffness[joint(n).id] * at.length)

    def at(self, q: np.ndarray) -> mujoco.MjData:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        return self.data

    def bending(self, q: np.ndarray) -> np.ndarray:
        """The rotation vector of each joint set, by hinge (nv,)."""
        phi = np.empty_like(q)
        for ids in self.sets:
            axes = self.model.jnt_axis[ids]
            turned = Rotation.identity()
            for axis, angle in zip(axes, q[ids], strict=True):
                turned = turned * Rotation.from_rotvec(axis * angle)
            phi[ids] = axes @ turned.as_rotvec()
        return phi

    def elastic(self, q: np.ndarray, rest: np.ndarray, pressure: float) -> float:
        K, out = self.stiffness, self.bending(q) - rest
        coupled = sum(0.5 * COUPLING * 0.5 * (K[a] + K[b]) * (out[a] - out[b]) ** 2 for a, b in self.pairs)
        return float(0.5 * (K * (1 - (pressure * self.slender) ** 2 / BEAM_COLUMN) * out**2).sum() + coupled)

    def segments(self, q: np.ndarray) -> np.ndarray:
        """Lengths (n_tendon, n_disk) of the tendons' straight pieces."""
        d = self.at(q)
        holes = np.array([[d.site(n).xpos for n in tendon] for tendon in self.body.tendons])
        return np.linalg.norm(np.diff(holes, axis=1), axis=2)

    def loads(self, q: np.ndarray, loads: Loads) -> float:
        d = self.at(q)
        tip = d.site(self.body.tip).xpos
        height = self.model.body_mass @ (d.xipos @ loads.gravity) + loads.payload * tip @ loads.gravity + loads.force @ tip
        behind = [max(0.0, loads.wall[3] - d.site(n).xpos @ loads.wall[:3]) for n in self.body.disks] if loads.wall[4] else [0.0]
        return float(0.5 * loads.wall[4] * np.square(behind).sum() - height)

    def __call__(self, q: np.ndarray, rest: np.ndarray, tension: np.ndarray, loads: Loads) -> float:
        return self.elastic(q, rest, tension.sum()) + float(tension @ self.segments(q).sum(axis=1)) + self.loads(q, loads)


def slope(f: Callable[[np.ndarray], np.ndarray | float], q: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Central differences of f at q, (nv, ...)."""
    return np.stack([(np.asarray(f(q + e)) - np.asarray(f(q - e))) / (2 * step) for e in step * np.eye(q.size)])


WALL = np.array([-1.0, 0.0, 0.0, -0.02, 300.0])


def edited(**effects: dict[str, float]) -> Body:
    body = load("continuum").build({"backbone.radius_taper": 0.01, "disks.pitch_3": 0.0145})
    for name, values in effects.items():
        catalogue()[name](values).edit(body)
    return body


@pytest.mark.parametrize("turned", [False, True], ids=["plain", "turned hinges"])
def test_the_residual_is_the_slope_of_the_energy(turned: bool) -> None:
    body = edited(stiffness_asymmetry={"along": 0.2, "across": -0.3}) if turned else edited()
    energy, equilibrium = Energy(body), Equilibrium(body)
    rng = np.random.default_rng(1)
    loads = Loads(np.array([3.0, -5.0, 7.0]), 0.02, np.array([0.02, 0.01, -0.03]), WALL)
    for size in (0.02, 0.15, 0.4):  # rad: in the series, at 4 N, and beyond anything a tendon can do
        q, rest, T = rng.normal(0, size, 48), rng.normal(0, 0.02, 48), rng.uniform(0, 4, 3)
        r = residual(equilibrium, q, rest, T, loads, Route())[0]
        # N m: differences of 0.1 J at 1e-5 rad, rounding 1e-17 / 1e-5; third derivatives of 1 J/rad^3 times 1e-10; the wall's kink
        # is not met.
        np.testing.assert_allclose(r, slope(lambda x: energy(x, rest, T, loads), q), rtol=0, atol=3e-9)  # noqa: B023


def residual(e: Equilibrium, q, rest, T, loads: Loads, route: Route, z0=None, s0=None, tangent: bool = False):
    """What chain.balance says at q: r, J (empty unless `tangent`), z, s."""
    z0, s0 = (np.zeros((3, 8)) if x is None else x for x in (z0, s0))
    z, s, r = np.zeros((3, 8)), np.zeros((3, 8)), np.empty(48)
    J = np.empty((48, 48)) if tangent else np.empty((0, 0))
    place(e.model._address, e.data._address, e.chain, q)
    law = Law(float(route.mu), float(route.presliding), np.array(loads.wall, float))
    load_ = Load(np.array(loads.gravity), float(loads.payload), np.array(loads.force))
    balance(q, rest, e.chain, T, law, load_, z0, s0, z, s, r, J)
    return r, J, z, s


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_tangent_is_the_slope_of_the_residual(mu: float) -> None:
    e = Equilibrium(edited(stiffness_asymmetry={"along": 0.2, "across": -0.3}))
    rng = np.random.default_rng(2)
    loads = Loads(np.array([3.0, -5.0, 7.0]), 0.02, np.array([0.02, 0.01, -0.03]), WALL)
    for size in (0.03, 0.15):
        q, rest, T = rng.normal(0, size, 48), rng.normal(0, 0.02, 48), rng.uniform(0, 4, 3)
        s0 = residual(e, q, rest, T, loads, Route())[3]
        z0 = rng.uniform(-0.9, 0.9, (3, 8))  # sticking holes: z moves with every angle; 1e-5 rad cannot slide them
        z0[0] = 1.0  # and a sliding tendon, released so far that it stays so
        s0[0] += 1e-2
        route = Route(mu, 4e-4)
        J = residual(e, q, rest, T, loads, route, z0, s0, tangent=True)[1]
        numeric = slope(lambda x: residual(e, x, rest, T, loads, route, z0, s0)[0], q).T  # noqa: B023
        # N m/rad of up to 0.3: the elastic part is itself a difference over 1e-6 rad, 1e-6 of 0.3; sticking adds third
        # derivatives of T mu theta / presliding^... over 1e-5 rad, 1e-10 * 1e3.
        np.testing.assert_allclose(J, numeric, rtol=0, atol=1e-6)


def test_a_solution_is_a_minimum_of_the_energy() -> None:
    body = edited(stiffness_gradient={"gradient": 0.4}, tendon_routing={"angle_2": 0.2, "radius_1": 5e-4})
    energy, e = Energy(body), Equilibrium(body)
    t, T = swept((0, 0, 0), (3, 1, 0), (0.5, 3, 2), each=3)
    loads = Loads(SIDEWAYS, 0.02, wall=WALL)
    path = e.solve(t, T, loads)
    rest, rng = np.zeros(48), np.random.default_rng(0)
    for q, tension in zip(path.q, T, strict=True):
        # N m: the solver stops at 1e-7 rad in every hinge, of 0.21 N m/rad; a bound three times as wide for stiffer edits
        np.testing.assert_allclose(slope(lambda x: energy(x, rest, tension, loads), q), 0.0, rtol=0, atol=6e-8)  # noqa: B023
        bottom = energy(q, rest, tension, loads)
        assert all(energy(q + rng.normal(0, 1e-3, 48), rest, tension, loads) > bottom for _ in range(5))


# ---- friction ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pulling", [True, False])
def test_a_sliding_tendon_loses_what_the_capstan_says(pulling: bool) -> None:
    """The tensions of all segments are what balances the solved shape: least squares, 8 unknowns in 48 equations."""
    mu, body = 0.2, load("continuum").build()
    energy, e = Energy(body), Equilibrium(body)
    t, T = swept((0, 0, 0), (3, 0, 0), each=60) if pulling else swept((0, 0, 0), (4, 0, 0), (2, 0, 0), each=60)
    path = e.solve(t, T, Loads(NOWHERE), Route(mu, 2e-5), tolerance=EXACT)
    q = path.q[-1]
    np.testing.assert_array_equal(path.slip[0, 1:], 1.0 if pulling else -1.0)
    lengths = slope(lambda x: energy.segments(x)[0], q)  # (nv, 8)
    elastic = slope(lambda x: energy.elastic(x, np.zeros(48), T[-1].sum()), q)
    tension, rest, *_ = np.linalg.lstsq(lengths, -elastic, rcond=None)
    assert rest[0] < 1e-16  # (N m)^2: eight tensions explain all 48 equations, to the differences' 1e-9 N m
    d = energy.at(q)
    hole = np.array([d.site(n).xpos for n in body.tendons[0]])
    u = np.diff(hole, axis=0) / np.linalg.norm(np.diff(hole, axis=0), axis=1)[:, None]
    turned = np.cumsum(np.arccos(np.clip((u[1:] * u[:-1]).sum(axis=1), -1, 1)))
    expected = T[-1, 0] * np.exp((-mu if pulling else mu) * np.append(0.0, turned))
    # N: the turn angle is rounded below 1e-3 rad, so up to mu * 1e-3 of the tension is missing at each of 7 holes
    np.testing.assert_allclose(tension, expected, rtol=0, atol=1.01 * mu * 7e-3 * expected.max())


def test_friction_remembers_the_way_and_holds_still() -> None:
    t, T = swept((0, 0, 0), (4, 0, 0), (2, 0, 0), (2, 0, 0))
    with_it = 1e3 * tips(solver().solve(t, T, Loads(HANGING), FRICTION))
    without = 1e3 * tips(solver().solve(t, T, Loads(HANGING)))
    up, down = 20, 80  # samples at 2 N
    # mm: a released tendon pulls harder along the robot than a pulled one: 66.6 and 72.5 mm of x around 69.5 at mu 0.2 without
    # gravity (equilibrium.md); gravity takes part of it. A millimetre either way is a fifth of that.
    assert with_it[up, 0] < without[up, 0] - 1.0 < without[down, 0] < with_it[down, 0] - 1.0
    # mm: without friction there is no memory; two solves within 1e-7 rad in every hinge agree within 1e-3 mm
    np.testing.assert_allclose(without[up], without[down], rtol=0, atol=1e-3)
    # mm: held, nothing moves but the solver's last digits
    np.testing.assert_allclose(with_it[81:], with_it[80] + np.zeros((40, 3)), rtol=0, atol=1e-3)


def test_friction_does_not_know_the_clock() -> None:
    t, T = swept((0, 0, 0), (3, 1, 0), (1, 2, 0))
    fast, slow = (tips(solver().solve(x, T, Loads(HANGING), FRICTION)) for x in (t / 50, 7 * t**1.1))
    np.testing.assert_array_equal(fast, slow)


def test_loads_come_in_the_stated_order() -> None:
    """Gravity and payload first, then the first tensions from slack: a log that starts pulled is one that was ramped there."""
    loads = Loads(SIDEWAYS, 0.03)
    t, T = swept((0, 0, 0), (3, 1, 0), each=64)
    ramped = tips(solver().solve(t, T, loads, FRICTION))[-1]
    at_once = tips(solver().solve(np.zeros(1), T[-1:], loads, FRICTION))[0]
    # m: the documented difference of 8 steps from 64
    np.testing.assert_allclose(at_once, ramped, rtol=0, atol=5e-5)
    # The order matters: pulled while weightless and loaded afterwards, the same robot hangs millimetres away. That it does in
    # the rod's own law, too, is why the order is part of the answer.
    lead = np.linspace(0, 1, 64)
    drive = np.vstack([T[1:], np.repeat(T[-1:], 64, axis=0)])
    weight = np.append(np.zeros(64), lead)
    late = follow(Rod(), drive, gravity=SIDEWAYS, payload=0.03, weight=weight, mu=0.2)[-1].disks[-1]
    assert np.linalg.norm(late - ramped) > 1e-3


def test_more_steps_on_the_way_change_nothing_much() -> None:
    """Slip is integrated implicitly from sample to sample: a log of every tenth sample gives the same loop."""
    t, T = swept((0, 0, 0), (3, 0, 1), (0.5, 2, 0), (3, 0, 0), each=100)
    fine = tips(solver().solve(t, T, Loads(SIDEWAYS, 0.02), FRICTION))
    coarse = tips(solver().solve(t[::10], T[::10], Loads(SIDEWAYS, 0.02), FRICTION))
    # m: 0.3 N a sample against 0.03 N. Worst measured 0.22 mm between one step and 16 where a hole reverses on the way.
    np.testing.assert_allclose(coarse, fine[::10], rtol=0, atol=2.2e-4)


# ---- the solver ------------------------------------------------------------------------------------------------------------


def random_walk(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    knots = rng.uniform(0, 3.5, (n // 10 + 2, 3))
    t = np.arange(float(n))
    return t, np.stack([np.interp(t / 10, np.arange(len(knots)), c) for c in knots.T], axis=1)


def test_warm_is_cold() -> None:
    t, T = random_walk(60, 1)
    loads = Loads(SIDEWAYS, 0.02)
    warm = tips(solver().solve(t, T, loads, tolerance=EXACT))
    cold = np.stack([tips(solver().solve(t[:1], T[k : k + 1], loads, tolerance=EXACT))[0] for k in range(60)])
    np.testing.assert_allclose(warm, cold, rtol=0, atol=1e-10)  # m: 48 hinges within 1e-11 rad over 0.12 m, all one way


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_near_a_neighbour_is_plain(mu: float) -> None:
    t, T = random_walk(60, 2)
    loads, route = Loads(SIDEWAYS, 0.02), Route(mu, 4e-4)
    neighbour = solver().solve(t, T, loads, route, keep=True)
    softer = Equilibrium(load("continuum").build({"backbone.youngs_modulus": 0.99 * 77.59e9}))
    plain = tips(softer.solve(t, T, loads, route))
    near = tips(softer.solve(t, T, loads, route, near=neighbour))
    assert np.abs(plain - tips(neighbour)).max() > 1e-4  # there was a way to go
    # m: both within 1e-7 rad in every hinge; 48 of them one way move the tip by 3e-7 m; slip carries such errors along
    np.testing.assert_allclose(near, plain, rtol=0, atol=1e-6)


def test_same_question_same_answer() -> None:
    t, T = random_walk(60, 3)
    one = Equilibrium(load("continuum").build()).solve(t, T, Loads(SIDEWAYS, 0.02), FRICTION)
    solver().solve(t, T[::-1], Loads(UPRIGHT, 0.01), FRICTION)  # what was solved before must not matter
    two = solver().solve(t, T, Loads(SIDEWAYS, 0.02), FRICTION)
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.markers, two.markers)


@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("at", [0, 7])
def test_a_tension_that_is_no_number_is_flagged_and_forgotten(at: int, mu: float) -> None:
    t, T = random_walk(20, 4)
    holed = T.copy()
    holed[at, 1] = np.nan
    loads, route = Loads(SIDEWAYS, 0.02), Route(mu, 4e-4)
    path, whole = solver().solve(t, holed, loads, route), solver().solve(t, T, loads, route)
    assert path.status[at] == NOT_FOUND
    assert np.all(np.delete(path.status, at) != NOT_FOUND)
    assert np.isfinite(path.markers).all()
    if mu == 0.0:  # with friction a sample less is another path
        np.testing.assert_allclose(np.delete(tips(path), at, 0), np.delete(tips(whole), at, 0), rtol=0, atol=1e-6)  # m: as above
    if at == 0:
        assert path.started != DIRECT


@pytest.mark.parametrize("what", ["gravity", "payload", "force"])
def test_loads_that_are_no_numbers_are_flagged(what: str) -> None:
    loads = {
        "gravity": Loads(np.array([0, np.nan, G])),
        "payload": Loads(HANGING, np.nan),
        "force": Loads(HANGING, force=np.array([0, np.inf, 0])),
    }[what]
    path = solver().solve(np.arange(2.0), np.ones((2, 3)), loads, FRICTION)
    assert np.all(path.status == NOT_FOUND)
    assert path.unstable_start
    # And it is over with them.
    assert solver().solve(np.arange(2.0), np.ones((2, 3)), Loads(HANGING)).status.all()
