"""The balance of forces and its tangent against the slope of an energy found by another route."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.mechanics.rod.statics.test_equilibrium import SIDEWAYS, swept
from twin.body import Drive, Loads, Problem, Route
from twin.body.hinge_chain import HingeChain, hinge_pairs
from twin.effects import catalogue
from twin.effects.contact import obstacle
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.chain import ChainState, force_balance
from twin.mechanics.rod.balance.elastic import BEAM_COLUMN, SET_COUPLING
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.robots import load


class Energy:
    """The chain's energy from scipy's rotations and MuJoCo's forward kinematics; none of the solver's code."""

    def __init__(self, body: HingeChain) -> None:
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
        coupled = sum(0.5 * SET_COUPLING * 0.5 * (K[a] + K[b]) * (out[a] - out[b]) ** 2 for a, b in self.pairs)
        return float(0.5 * (K * (1 - (pressure * self.slender) ** 2 / BEAM_COLUMN) * out**2).sum() + coupled)

    def segments(self, q: np.ndarray) -> np.ndarray:
        """Lengths (n_tendon, n_disk) of the tendons' straight pieces."""
        d = self.at(q)
        holes = np.array([[d.site(n).xpos for n in tendon] for tendon in self.body.tendon_sites])
        return np.linalg.norm(np.diff(holes, axis=1), axis=2)

    def loads(self, q: np.ndarray, loads: Loads) -> float:
        d = self.at(q)
        tip = d.site(self.body.tip).xpos
        height = self.model.body_mass @ (d.xipos @ loads.gravity) + loads.payload * tip @ loads.gravity + loads.force @ tip
        normal, across, curvature = loads.wall[:3], loads.wall[5:8], loads.wall[9]
        disks = np.array([d.site(n).xpos for n in self.body.disks])
        if curvature:  # how far from the post's axis, a radius behind its surface
            centre = (loads.wall[3] - 1.0 / curvature) * normal + loads.wall[8] * across
            behind = 1.0 / curvature - np.linalg.norm(np.cross(disks - centre, np.cross(normal, across)), axis=1)
        else:
            behind = loads.wall[3] - disks @ normal
        return float(0.5 * loads.wall[4] * np.square(np.maximum(behind, 0.0)).sum() - height)

    def __call__(self, q: np.ndarray, rest: np.ndarray, tension: np.ndarray, loads: Loads) -> float:
        return self.elastic(q, rest, tension.sum()) + float(tension @ self.segments(q).sum(axis=1)) + self.loads(q, loads)


def slope(f: Callable[[np.ndarray], np.ndarray | float], q: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Central differences of f at q, (nv, ...)."""
    return np.stack([(np.asarray(f(q + e)) - np.asarray(f(q - e))) / (2 * step) for e in step * np.eye(q.size)])


WALL = obstacle((-1.0, 0.0, 0.0), -0.02, 300.0)
POST = obstacle((-0.8, -0.6, 0.0), -0.02, 300.0, place=0.07, curvature=40.0)  # across the robot, of 25 mm radius


def edited(**effects: dict[str, float]) -> HingeChain:
    body = load("continuum").build({"backbone.radius_taper": 0.01, "disks.pitch_3": 0.0145})
    for name, values in effects.items():
        catalogue()[name](values).edit(body)
    return body


@pytest.mark.parametrize("wall", [WALL, POST], ids=["wall", "post"])
@pytest.mark.parametrize("turned", [False, True], ids=["plain", "turned hinges"])
def test_the_residual_is_the_slope_of_the_energy(turned: bool, wall: np.ndarray) -> None:
    body = edited(stiffness_asymmetry={"along": 0.2, "across": -0.3}) if turned else edited()
    energy, equilibrium = Energy(body), Equilibrium(body)
    rng = np.random.default_rng(1)
    loads = Loads(np.array([3.0, -5.0, 7.0]), 0.02, np.array([0.02, 0.01, -0.03]), wall)
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
    at = e.statics(Problem(np.zeros(1), T[None], loads, route))._replace(rest=rest)
    update_kinematics(at, q)
    force_balance(at, ChainState(T, q, z0, s0), z, s, r, J)
    return r, J, z, s


@pytest.mark.parametrize(
    ("mu", "wall", "sign"),
    [(0.0, WALL, 1), (0.3, WALL, 1), (0.3, POST, 1), (0.3, WALL, -1)],
    ids=["wall", "rubbing", "post", "pushing"],
)
def test_the_tangent_is_the_slope_of_the_residual(mu: float, wall: np.ndarray, sign: int) -> None:
    """With `sign` -1 two of three tendons push, one that slides and one that sticks."""
    e = Equilibrium(edited(stiffness_asymmetry={"along": 0.2, "across": -0.3}))
    rng = np.random.default_rng(2)
    loads = Loads(np.array([3.0, -5.0, 7.0]), 0.02, np.array([0.02, 0.01, -0.03]), wall)
    for size in (0.03, 0.15):
        q, rest, T = rng.normal(0, size, 48), rng.normal(0, 0.02, 48), rng.uniform(0, 4, 3)
        T = T * [sign, sign, 1]
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


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_what_a_solution_keeps_is_its_tangents_factors(mu: float) -> None:
    """Of the transpose. With them a neighbour is solved in one step, and the derivatives of a fit are made."""
    e, route = Equilibrium(edited()), Route(mu, 4e-4)
    t, T = swept((0, 0, 0), (3, 1, 0), (2, 2, 0), each=3)
    loads = Loads(SIDEWAYS, 0.02)
    path = e.solve(Problem(t, T, loads, route, keep=True, tolerance=1e-10))
    for i in (1, 4, 6):
        there = e.solve(Problem(t[: i + 1], T[: i + 1], loads, route, tolerance=1e-10))  # the slip at this row's end
        J = residual(e, path.q[i], np.zeros(48), T[i], loads, route, there.slip, there.distal, tangent=True)[1]
        LU = (np.tril(path.LU[i], -1) + np.eye(48)) @ np.triu(path.LU[i])
        np.testing.assert_allclose(LU.T, J, rtol=0, atol=1e-6)  # N m/rad of up to 0.3: as the tangent against its differences


@pytest.mark.parametrize("drive", [Drive.TENSION, Drive.DISPLACEMENT], ids=["tension", "length"])
def test_a_post_is_met_and_not_jumped(drive: Drive) -> None:
    """A tip that a post stops stays before it also where a row of the log moves it further than the post is thick."""
    e = Equilibrium(edited())
    post = Loads(np.zeros(3), wall=obstacle((-1.0, 0.0, 0.0), -0.03, 3e3, place=0.11, curvature=100.0))
    full = np.array([3.0, 0.0, 0.0]) if drive is Drive.TENSION else np.array([8e-3, -8e-3, -8e-3])  # m: two slack
    share = {n: np.linspace(0.0, 1.0, n)[:, None] for n in (3, 61)}
    coarse, fine = (
        e.solve(Problem(np.arange(float(n)), s * full + (1 - s) * np.minimum(full, 0.0), post, drives=(drive,) * 3))
        for n, s in share.items()
    )
    free = e.solve(Problem(np.arange(61.0), share[61] * full, Loads(np.zeros(3)), drives=(drive,) * 3))
    assert free.markers[-1, -1, 0] > 0.05  # m: past the whole post
    assert fine.markers[-1, -1, 0] < 0.04
    np.testing.assert_allclose(coarse.markers[-1], fine.markers[-1], rtol=0, atol=1e-6)  # m: no memory; both solved to 1e-7 rad


def test_a_solution_is_a_minimum_of_the_energy() -> None:
    body = edited(stiffness_gradient={"gradient": 0.4}, tendon_routing={"angle_2": 0.2, "radius_1": 5e-4})
    energy, e = Energy(body), Equilibrium(body)
    t, T = swept((0, 0, 0), (3, 1, 0), (0.5, 3, 2), each=3)
    loads = Loads(SIDEWAYS, 0.02, wall=WALL)
    path = e.solve(Problem(t, T, loads))
    rest, rng = np.zeros(48), np.random.default_rng(0)
    for q, tension in zip(path.q, T, strict=True):
        # N m: the solver stops at 1e-7 rad in every hinge, of 0.21 N m/rad; a bound three times as wide for stiffer edits
        np.testing.assert_allclose(slope(lambda x: energy(x, rest, tension, loads), q), 0.0, rtol=0, atol=6e-8)  # noqa: B023
        bottom = energy(q, rest, tension, loads)
        assert all(energy(q + rng.normal(0, 1e-3, 48), rest, tension, loads) > bottom for _ in range(5))
