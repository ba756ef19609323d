"""The soft finger: its lattice and silicone against closed forms and an independent FEM, its tendons, cords and slow states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tools.simulators.finger.effects.silicone import BackbonePrecurvature
from tools.simulators.finger.mechanics.equilibria import Finger, equilibrium
from twin.body import DIRECT, NOT_FOUND, Drive, Loads, Problem, Push, Route, Signals
from twin.body.strain_cords import Cords, resistance, strain
from twin.effects import effect_class
from twin.effects.contact import obstacle
from twin.mechanics.silicone import SoftBody, SoftSolution, SoftStatics
from twin.mechanics.silicone.material.law import Tangent, forces, stiffness
from twin.mechanics.silicone.skin_loads import ContactSkin as Pressed
from twin.mechanics.silicone.skin_loads import add_wall_force
from twin.mechanics.silicone.solver_arrays import body_arrays
from twin.mechanics.silicone.statics import rotation_about_z
from twin.robots import load

HANGING = np.array([0.0, 0.0, 9.81])
TENSION, HELD = (Drive.TENSION,) * 4, (Drive.DISPLACEMENT,) * 4
OUT = -6e-3  # m: paid out, slack


def body(**values: float) -> SoftBody:
    found = load("finger").build({name.replace("__", "."): v for name, v in values.items()})
    assert isinstance(found, SoftBody)
    return found


def solve(
    one: SoftBody, command: np.ndarray, drives: tuple[Drive, ...] = HELD, gravity: np.ndarray = HANGING, **more: object
) -> SoftSolution:
    command = np.atleast_2d(np.asarray(command, float))
    problem = Problem(np.arange(len(command), dtype=float), command, Loads(gravity), drives=drives)
    path = SoftStatics(one).solve(replace(problem, **more))  # type: ignore[arg-type]
    assert path.status.all()
    return path


def pulled(tendon: int, amounts: np.ndarray, rest: float = OUT) -> np.ndarray:
    command = np.full((len(amounts), 4), rest)
    command[:, tendon] = amounts
    return command


def tip(path: SoftSolution) -> np.ndarray:
    return path.markers[:, -1]


def test_the_lattice_fills_the_cone() -> None:
    """A frustum's volume; and fields it can represent (affine, zero at the clamp) are interpolated to rounding."""
    grid = body().lattice
    a, b, h = float(grid.cone.radius(0.01)), float(grid.cone.radius(0.1)), 0.09
    np.testing.assert_allclose(grid.quadrature[1].sum(), np.pi * h * (a * a + a * b + b * b) / 3.0, rtol=1e-12)
    nodes = grid.nodes[9:]
    slope = np.array([[0.1, 0.02, -0.3], [0.0, 0.2, 0.1], [0.05, 0.0, 0.15]])[:, 2]
    points = np.array([[0.004, -0.002, 0.033], [0.0, 0.011, 0.0101], [0.0, 0.0, 0.1], [0.01, 0.0, 0.004]])
    field = grid.weights(points) @ np.outer(nodes[:, 2] - 0.01, slope)
    np.testing.assert_allclose(field, np.outer(np.maximum(points[:, 2] - 0.01, 0.0), slope), atol=1e-15)


def test_a_tendon_s_end_keeps_force_and_moment() -> None:
    grid, point = body().lattice, np.array([0.004, 0.001, 0.1])
    share = grid.anchor_weights(point, 0.09)
    np.testing.assert_allclose(share.sum(), 1.0, rtol=1e-10)
    np.testing.assert_allclose(share @ grid.nodes[9:], point, atol=1e-12)


def bent(parts, seed: int = 0) -> np.ndarray:  # type: ignore[no-untyped-def]
    u = np.zeros((len(parts.cells.members) * 18 + 9, 3))
    u[9:] = 4e-4 * np.random.default_rng(seed).normal(size=u[9:].shape)
    return u


def energy(parts, u: np.ndarray, fibre: np.ndarray) -> float:  # type: ignore[no-untyped-def]
    """The silicone's energy, written with numpy from the law alone; without stress its fibres along z are `fibre` times as long."""
    c, total, drawn = parts.cells, 0.0, body().lattice
    for e in range(len(c.members)):
        D = drawn.gradients[0][e].reshape(27, -1, 3)
        F = np.eye(3) + np.einsum("ai,aqj->qij", u[c.members[e]], D)
        F[:, :, 2] /= fibre[e][:, None]
        J, w = np.linalg.det(F), drawn.quadrature[1][e] * fibre[e]
        total += (w * c.shear[e] / 2 * (J ** (-2 / 3) * (F**2).sum((1, 2)) - 3.0)).sum()
        fitted = c.basis[e] @ np.linalg.lstsq(c.basis[e] * np.sqrt(w)[:, None], np.sqrt(w) * (J - 1.0), rcond=None)[0]
        total += c.bulk[e] / 2 * (w * fitted**2).sum()
    return float(total)


@pytest.mark.parametrize("curvature", [0.0, 5.0], ids=["as drawn", "bent without stress"])
def test_forces_are_the_energy_s_gradient_and_the_tangent_theirs(curvature: float) -> None:
    """Central differences of an energy that shares no code: errors are their step squared, 1e-6 of the forces."""
    one = body()
    one.set_rest_curvature(0.6 * curvature, 0.8 * curvature, 0.5)
    x, y, z = np.moveaxis(one.lattice.quadrature[0], -1, 0)
    fibre = 1.0 + (0.75 + 0.5 * (z - 0.01) / 0.09) * curvature * (0.6 * y - 0.8 * x)
    parts = body_arrays(one)
    parts.cells.shear[:] *= np.random.default_rng(1).uniform(0.8, 1.2, parts.cells.shear.shape)
    u, nq, none = bent(parts), 3 * parts.cables.weights.shape[2], np.empty((0, 0, 6))
    f, p, step = np.empty(nq), np.zeros((len(parts.cells.members), 4)), 1e-7
    forces(u, parts.cells, none, f, p)
    tangent = Tangent(np.empty((nq, nq)), np.zeros((len(p), 4, 81)), p.copy())
    stiffness(u, parts.cells, none, tangent)
    rng = np.random.default_rng(2)
    for _ in range(4):
        way = rng.normal(size=(nq // 3, 3))
        ahead, behind = u.copy(), u.copy()
        ahead[9:] += step * way
        behind[9:] -= step * way
        slope = (energy(parts, ahead, fibre) - energy(parts, behind, fibre)) / (2 * step)
        np.testing.assert_allclose(f @ way.ravel(), slope, rtol=1e-5)
        g, h, q = np.empty(nq), np.empty(nq), p.copy()
        forces(ahead, parts.cells, none, g, q)
        forces(behind, parts.cells, none, h, q)
        change = (g - h) / (2 * step)
        np.testing.assert_allclose(tangent.K @ way.ravel(), change, atol=1e-5 * np.abs(change).max())
    np.testing.assert_allclose(tangent.K, tangent.K.T, atol=1e-9 * np.abs(tangent.K).max())


def test_silicone_bent_without_stress_stands_on_its_arc() -> None:
    """Plane sections turned along an arc are what those fibres have room for, without stress, also beside the clamp: axis and skin
    stand there, to what quadratic cells make of 0.14 rad (its third power over cells of a fifth of the length: 1e-4 of 0.1 m)."""
    one, k = body(), np.array([-1.2, 1.0])
    one.set_rest_curvature(*k, 0.0)
    path = solve(one, np.zeros(4), TENSION, np.zeros(3))
    z, w = np.polynomial.legendre.leggauss(12)

    def turn(height: float) -> Rotation:
        return Rotation.from_rotvec((height - 0.01) * np.append(k, 0.0))

    def stands(point: np.ndarray) -> np.ndarray:
        half = 0.5 * (point[2] - 0.01)
        axis = half * w @ np.array([turn(0.01 + half * (1.0 + v)).apply([0.0, 0.0, 1.0]) for v in z])
        return np.array([0.0, 0.0, 0.01]) + axis + turn(point[2]).apply([point[0], point[1], 0.0])

    points = np.vstack([one.marker_rest, [0.0, 0.0, one.cone.length]])
    np.testing.assert_allclose(path.markers[0], [stands(p) for p in points], atol=1e-5)
    assert np.linalg.norm(path.markers[0] - points, axis=1).max() > 5e-3


def test_silicone_bent_without_stress_is_pulled_as_the_bench_s_own_is() -> None:
    """The bench draws the body anew by plane sections turned along its bend; other elements, no code in common; tolerances as
    below, a tenth of what the set moves."""
    law, straight, turned = BackbonePrecurvature(1.5, 70.0), Finger.of(0.11, 0.49), Finger.of(0.11, 0.49)
    law.build(turned, np.eye(3))
    one = body(silicone__youngs_modulus=110e3)
    x, y, z = np.moveaxis(one.lattice.quadrature[0], -1, 0)
    a, s = np.deg2rad(70.0), (z - 0.01) / 0.09
    one.fibre[:] = 1.0 - 1.5 * (1.0 + np.cos(np.pi * s)) * (np.cos(a) * x + np.sin(a) * y)
    for commands in ((0.0, 0.0, 0.0, 0.0), (1.2, 0.0, 0.0, 0.0)):
        path = solve(one, np.outer(np.arange(1, 5) / 4, commands), TENSION)
        true = equilibrium(turned, tension=commands)
        np.testing.assert_allclose(1e3 * tip(path)[-1], true.tip, atol=0.4)
        np.testing.assert_allclose(path.others["strain"][-1], true.strain, atol=0.015 * 0.0741)
        assert np.linalg.norm(true.tip - equilibrium(straight, tension=commands).tip) > 4.0


@pytest.mark.parametrize(
    ("tension", "where", "strains"),
    [(1.0, (16.13, 96.01), (-0.03841, 0.00587)), (2.0, (29.66, 88.44), (-0.07407, 0.01337))],
)
def test_it_bends_as_a_finite_element_model_of_others(
    tension: float, where: tuple[float, float], strains: tuple[float, float]
) -> None:
    """A converged Q2/P1 neo-Hookean FEM, E 125 kPa, no gravity: within 0.4 mm (of 30) and 1 % of the full strain."""
    path = solve(body(), pulled(0, tension * np.arange(1, 5) / 4, 0.0), TENSION, np.zeros(3))
    np.testing.assert_allclose(1e3 * tip(path)[-1], [where[0], 0.0, where[1]], atol=0.4)
    near, far = strains
    np.testing.assert_allclose(path.others["strain"][-1], [near, far, far, near], atol=0.01 * 0.0741)


@pytest.mark.parametrize("commands", [(7.0, -6.0, -6.0, -6.0), (5.0, 4.0, -3.0, 1.0)], ids=["one", "three taut"])
def test_it_stands_where_the_bench_s_own_finite_elements_do(commands: tuple[float, ...]) -> None:
    """Another mesh, other elements, no code in common; 0.4 mm is what the bench's own mesh is good for at 9 mm."""
    E = 110e3
    path = solve(body(silicone__youngs_modulus=E), 1e-3 * np.outer(np.arange(1, 5) / 4, commands))
    true = equilibrium(Finger.of(E / 1e6, 0.49), shortening=commands)
    np.testing.assert_allclose(1e3 * tip(path)[-1], true.tip, atol=0.4)
    np.testing.assert_allclose(path.others["strain"][-1], true.strain, atol=0.015 * 0.0741)


def test_a_turned_finger_bends_to_the_turned_side() -> None:
    """Pulling the next tendon turns the shape by 90 degrees, turning the mounting by as much."""
    amounts = np.array([2e-3, 5e-3])
    plain = tip(solve(body(), pulled(0, amounts)))
    swapped = plain[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(tip(solve(body(), pulled(1, amounts))), swapped, atol=2e-7)
    mounted = tip(solve(body(mounting__angle=0.2), pulled(0, amounts)))
    np.testing.assert_allclose(mounted, plain @ rotation_about_z(0.2).T, atol=2e-7)


def test_tendons_pull_or_are_slack() -> None:
    """Held tendons reach their lengths to 1e-8 m and pull, or are shorter than they may be and do not."""
    one = body()
    command = 1e-3 * np.array([[3.0, 1.0, -6.0, 1.0], [2.0, 2.0, 2.0, 2.0], [-5.0, -5.0, -5.0, -5.0], [6.0, 0.0, -1.0, -6.0]])
    path = solve(one, command)
    shortening = SoftStatics(one).straight_path - path.path
    taut = path.tension > 0.0
    np.testing.assert_allclose(shortening[taut], command[taut], atol=2e-7)
    assert (shortening[~taut] >= command[~taut] - 2e-7).all()
    assert taut.any(axis=0).all()
    np.testing.assert_allclose(tip(path)[2], tip(solve(one, command[2:3] - 1e-3))[0], atol=1e-7)  # slack: how slack does not matter


def test_lengths_count_from_the_hanging_rest_without_its_payload() -> None:
    """A bar of changing section, F, stretches by F int dz / (E pi r^2) = F h / (E pi a b) between radii a and b a length h apart:
    slack cords along it grow by that, less what the clamp holds back (5 % of a beam's bending there, by others' finite elements)
    and more by where on the last centimetre the cord ends. As set to zero before, drums then pull on a robot that has grown."""
    cone, loads = body().cone, Loads(HANGING, payload=0.02)
    a, b = float(cone.radius(0.01)), float(cone.radius(0.1))
    grown = 0.02 * 9.81 * 0.09 / (125e3 * np.pi * a * b)
    slack = np.zeros((1, 4))
    free, held = (solve(body(), slack, drives, loads=loads) for drives in (TENSION, HELD))
    plain = solve(body(), slack, TENSION)
    np.testing.assert_allclose(free.path - plain.path, grown, rtol=0.1)
    np.testing.assert_allclose(plain.path, SoftStatics(body()).straight_path[None], atol=1e-9)
    assert (held.tension > 0.01).all()
    np.testing.assert_allclose(held.path, plain.path, atol=1e-6)
    before = effect_class("tip_payload")({"mass": 0.02, "zeroed": 1.0}, 4).surround(Loads(HANGING))
    there, drawn = (solve(body(), slack, drives, loads=before) for drives in (TENSION, HELD))
    np.testing.assert_allclose(there.path, plain.path, atol=1e-9)
    np.testing.assert_allclose(there.q, free.q, atol=1e-9)
    assert (drawn.tension < 1e-6).all()


def test_friction_leaves_what_the_capstan_law_says() -> None:
    """Pulled far beyond pre-sliding, every point slides: the last segment has exp(-mu total turn) of the base's tension. Found from
    the balance of the body: the same shape as without friction needs that much more at the base, within what the distribution of
    the loss along the body changes (5 % of the loss)."""
    one, mu = body(), 0.3
    rubbing = solve(one, pulled(0, 1e-3 * np.arange(1.0, 8.0)), route=Route(mu=mu, presliding=1e-5))
    plain = solve(one, pulled(0, 1e-3 * np.arange(1.0, 8.0)))
    back = solve(one, pulled(0, 1e-3 * np.array([7.0, 6.0, 5.0, 4.0])), route=Route(mu=mu, presliding=1e-5))
    turn = np.arctan2(tip(plain)[-1, 0], tip(plain)[-1, 2] - 0.01) * 2.0  # of a body bent in an arc
    more = np.log(rubbing.tension[-1, 0] / plain.tension[-1, 0])
    assert 0.3 * mu * turn < more < mu * turn
    same = plain.tension[3, 0]
    assert back.tension[-1, 0] < same < rubbing.tension[3, 0]  # at 4 mm, released and pulled


def test_creep_of_small_strains_is_the_law_s() -> None:
    """At a small constant tension the deflection grows by 1 + amplitude (1 - exp(-t / time)), within 1 % (steps of time / 40)."""
    amplitude, lag, n = 0.3, 20.0, 240
    command = np.tile([0.02, 0.0, 0.0, 0.0], (n, 1))
    creep = effect_class("backbone_creep")({"amplitude": amplitude, "time": lag}, 4).deform()
    time = 0.5 * np.arange(n)
    delayed = np.zeros((1, SoftStatics(body()).n_delayed))
    path = solve(body(), command, TENSION, np.zeros(3), time=time, creep=creep, delayed=delayed)
    grown = tip(path)[:, 0] / tip(path)[0, 0]
    np.testing.assert_allclose(grown, 1.0 + amplitude * (1.0 - np.exp(-time / lag)), atol=0.01)
    assert np.abs(delayed).max() > 0.0


def test_a_neighbour_s_answers_lead_to_the_same_shapes() -> None:
    command = pulled(0, 1e-3 * np.linspace(0.5, 8.0, 12))
    rubbing = Route(mu=0.1, presliding=2e-4)
    near = solve(body(), command, keep=True)
    other = body(silicone__youngs_modulus=1.1e5)
    for route in (Route(), rubbing):
        cold, warm = solve(other, command, route=route), solve(other, command, route=route, neighbour=near)
        np.testing.assert_allclose(warm.q, cold.q, atol=2e-7)
        np.testing.assert_allclose(warm.tension, cold.tension, atol=1e-4)
    again = solve(body(), command, neighbour=near)
    np.testing.assert_array_equal(again.q, near.q)  # nothing differs: nothing is solved
    first = solve(body(silicone__youngs_modulus=1.25e5 * 1.001), command, neighbour=near, once=True)
    cold = solve(body(silicone__youngs_modulus=1.25e5 * 1.001), command, tolerance=1e-9)
    slope, true = first.tension - near.tension, cold.tension - near.tension
    np.testing.assert_allclose(slope, true, atol=0.02 * np.abs(true).max())


def test_a_wall_holds_the_skin_back() -> None:
    loads = Loads(HANGING, wall=obstacle((-1.0, 0.0, 0.0), -0.02, 2e3))
    free, held = (
        solve(body(), pulled(0, 1e-3 * np.arange(1.0, 9.0))),
        solve(body(), pulled(0, 1e-3 * np.arange(1.0, 9.0)), loads=loads),
    )
    skin = free.markers[:, :-1, 0].max(axis=1)
    np.testing.assert_allclose(free.markers[skin < 0.015], held.markers[skin < 0.015], atol=1e-6)
    assert tip(held)[-1, 0] + 0.008 < 0.0225  # of 2 kN/m a ring, pressed with some newtons
    assert tip(free)[-1, 0] + 0.008 > 0.03


def test_a_post_presses_the_skin_down_its_energys_slope() -> None:
    """k share depth^2 / 2 a point, by its distance from the post's axis: the force is its slope, the tangent the force's."""
    rng = np.random.default_rng(3)
    skin = Pressed(rng.normal((0.02, 0.0, 0.05), 4e-3, (5, 3)), rng.uniform(0.2, 1.0, (5, 2)), rng.uniform(0.5, 1.0, 5))
    wall = obstacle((-1.0, 0.0, 0.0), -0.015, 2e3, place=0.048, curvature=60.0)
    centre = np.array([0.015 + 1 / 60, 0.0, 0.048])

    def energy(u: np.ndarray) -> float:
        away = skin.rest + skin.weights @ u.reshape(2, 3) - centre
        depth = np.maximum(1 / 60 - np.hypot(away[:, 0], away[:, 2]), 0.0)
        return float(0.5 * wall[4] * skin.share @ depth**2) / 3.0

    def force(u: np.ndarray) -> np.ndarray:
        r = np.zeros(6)
        add_wall_force(skin, u.reshape(2, 3), wall, 3.0, r, np.empty((0, 0)), False)
        return r

    u, K, h = rng.normal(0.0, 1e-3, 6), np.zeros((6, 6)), 1e-6
    add_wall_force(skin, u.reshape(2, 3), wall, 3.0, np.zeros(6), K, True)
    steps = h * np.eye(6)
    assert np.abs(force(u)).max() > 0.5  # N: it is pressed
    # Differences of 0.01 J at 1e-6 m are rounded by 1e-12 N; third derivatives k / R are 4e4 J/m^3, times 1e-12. No kink is near.
    np.testing.assert_allclose(force(u), [(energy(u + e) - energy(u - e)) / (2 * h) for e in steps], atol=1e-7)
    np.testing.assert_allclose(K, [(force(u + e) - force(u - e)) / (2 * h) for e in steps], atol=1e-3)


def test_a_push_on_the_skin_and_a_force_at_the_tip_are_reciprocal() -> None:
    """Betti: what a small force at the tip moves a point of the skin by, the same force there moves the tip by."""
    one, force, nothing = body(mounting__angle=0.1), np.array([2e-4, 1e-4, -1e-4]), np.full(4, OUT)
    marker = 4
    x, y, z = one.marker_rest[marker]
    push = Push(force, z / one.cone.length, float(np.arctan2(y, x)) + one.turn)
    rest, at_tip, there = (
        solve(one, nothing, loads=loads)
        for loads in (Loads(np.zeros(3)), Loads(np.zeros(3), force=force), Loads(np.zeros(3), push=push))
    )  # fmt: skip
    moved = (at_tip.markers - rest.markers)[0, marker] @ force
    assert moved > 1e-9  # J: the tip's force does work there
    # Of strains of 1e-3 the law is linear to some 1e-3.
    assert (there.markers - rest.markers)[0, -1] @ force == pytest.approx(moved, rel=5e-3)


def test_unequal_planes_bend_unequally() -> None:
    """Small forces at the tip across the principal axes: deflections as 1 / (1 -+ e), within 10 % (shear gives too)."""
    e = 0.2
    deflections = []
    for a, force in ((0, [1e-3, 0.0, 0.0]), (1, [0.0, 1e-3, 0.0])):
        one = body()
        one.set_bending_anisotropy(e, 0.0)
        deflections.append(tip(solve(one, np.zeros(4), TENSION, loads=Loads(np.zeros(3), force=np.array(force))))[0, a])
    ratio = deflections[0] / deflections[1]  # about y it is softer: towards x it gives more
    assert abs(ratio - (1 + e) / (1 - e)) < 0.1 * ((1 + e) / (1 - e) - 1)


@given(st.lists(st.floats(-0.3, 0.5), min_size=4, max_size=4))
def test_strain_from_resistance_is_the_inverse(strains: list[float]) -> None:
    cords = Cords(np.array([900.0, 1000.0, 1e4, 1.0]), np.array([0.7, 1.0, 1.3, 2.0]), np.array([1.3, 0.7, 1.0, 0.5]))
    eps = np.array(strains)
    np.testing.assert_allclose(strain(resistance(eps, cords), cords), eps, atol=1e-12)


def test_an_open_or_shorted_cord_has_no_strain() -> None:
    cords = Cords(np.ones(3), np.ones(3), np.ones(3))
    assert np.isnan(strain(np.array([0.0, -1.0, np.nan]), cords)).all()


def test_a_sensor_that_lags_closes_its_loop() -> None:
    """The play opens a loop of twice its width between rise and fall; the lag none once the strain has stood still."""
    up = np.concatenate([np.linspace(0, 0.06, 30), np.linspace(0.06, 0, 30), np.zeros(40)])
    R, one = (1000.0 * (1 + up) ** 2)[:, None], np.full((100, 1), 1000.0)
    seen = Signals(
        np.arange(100.0), np.zeros(100), R, R, np.zeros((100, 0, 3)), np.zeros(100), others={"sensor": R, "sensor_rest": one}
    )  # fmt: skip
    read = {}
    for values in ({"width": 1e-3, "swap": 1e-3}, {"share": 0.2, "time": 2.0}):
        law = effect_class("sensor_hysteresis")(values, 1)
        read[next(iter(values))] = np.sqrt(law.sense(seen).others["sensor"][:, 0] / 1000.0) - 1.0 - up
    np.testing.assert_allclose(read["width"][15] - read["width"][44], -2e-3, atol=1e-6)
    decay = np.exp(-1.0 / 2.0)
    behind = (0.06 / 29.0) * decay / (1.0 - decay)  # of a ramp, in steps of 1 s, once settled
    np.testing.assert_allclose([read["share"][25], read["share"][55]], [-0.2 * behind, 0.2 * behind], rtol=1e-3)
    assert abs(read["share"][-1]) < 1e-8  # 40 s is 20 of its times


def test_the_first_command_that_cannot_be_reached_ends_a_trial() -> None:
    """60 mm of one tendon are more than a finger of 100 mm gives way by. What was found before stands, what comes after is not
    sought from there."""
    command = pulled(0, np.array([2e-3, 60e-3, 2e-3]))
    path = SoftStatics(body()).solve(Problem(np.arange(3.0), command, Loads(HANGING), drives=HELD))
    assert path.status.tolist() == [DIRECT, NOT_FOUND, NOT_FOUND]
    assert np.allclose(path.markers[0], solve(body(), command[:1]).markers[0], atol=1e-9)
