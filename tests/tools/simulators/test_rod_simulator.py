"""The virtual bench against closed forms, published numbers, other solvers and its own file contract."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from tools.simulators.rod.bench import as_described, run
from tools.simulators.rod.day import Recipe, make_set
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.mechanics.frames import gauss_mesh
from tools.simulators.rod.mechanics.rod import STIFFEST, Creep, Rod, follow, solve, straight_lengths

NO_GRAVITY = (0.0, 0.0, 0.0)
EI = 77.59e9 * np.pi / 4 * 0.4e-3**4


def ten_disks() -> Rod:
    """The robot of the reference table: ten disks at 12 mm, 0.504 g each."""
    return Rod(
        pitch=np.full(10, 0.012),
        disk_mass=np.full(10, 0.504e-3),
        hole_radius=np.full((11, 3), 0.008),
        hole_angle=np.tile(np.radians([0.0, 120.0, 240.0]), (11, 1)),
        precurvature=np.zeros((10, 3)),
        stiffness_profile=np.ones(10),
        marker_offset=np.zeros(10),
    )


def test_mesh_has_converged():
    # The hardest pose of the workspace: full pull, sideways, payload, all three tendons tight.
    tip = [solve(Rod(), [4.0, 1.0, 0.3], gravity=[9.81, 0, 0], payload=0.02, nodes=n).disks[-1] for n in (4, 6)]
    np.testing.assert_allclose(tip[0], tip[1], rtol=0, atol=1e-7)


def test_tip_load_bends_an_elastica():
    # The planar elastica EI th'' = -F cos th as a boundary-value problem, by another solver.
    length, force = 0.12, 0.5

    def slope(s, y):
        return np.vstack([y[1], -force * np.cos(y[0]) / EI, np.sin(y[0]), np.cos(y[0])])

    def ends(a, b):
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0, length, 50)
    answer = solve_bvp(slope, ends, s, np.tile([[0.5], [1.0], [0.05], [0.05]], 50), tol=1e-10, max_nodes=100_000)
    tip = solve(Rod(), gravity=NO_GRAVITY, tip_force=[force, 0, 0]).disks[-1]
    np.testing.assert_allclose(tip, [answer.y[2, -1], 0.0, answer.y[3, -1]], rtol=0, atol=2e-8)  # m: the mesh's own error


@pytest.mark.parametrize(
    ("tension", "gravity", "x", "z"),
    [
        (1.0, NO_GRAVITY, 36.015, 112.462),
        (4.0, NO_GRAVITY, 86.329, 27.736),
        (4.0, (0.0, 0.0, -9.81), 86.232, 22.045),
    ],
)
def test_planar_pulls_match_the_energy_minimum(tension, gravity, x, z):
    tip = solve(ten_disks(), [tension, 0, 0], gravity=gravity).disks[-1]
    np.testing.assert_allclose(1e3 * tip, [x, 0.0, z], rtol=0, atol=2e-3)


def test_work_of_tendons_is_stored():
    # Without friction the work of the tensions becomes bending and twisting energy and height: two routes to one number.
    # An oblique, undersized gravity and three tendons make the path three-dimensional.
    rod, nodes = Rod(), 4
    gravity = np.array([2.0, -3.0, 4.0])
    x = np.linspace(0, 1, 401)
    drive = np.stack([3.0 * x, 1.5 * x**2, np.sin(3 * x)], axis=1)
    lead = np.concatenate([np.linspace(0.1, 1.0, 10), np.ones(len(x))])
    shape = follow(rod, np.vstack([np.zeros((10, 3)), drive]), gravity=gravity, weight=lead, nodes=nodes)[10:]
    work = np.sum(0.5 * (drive[1:] + drive[:-1]) * np.diff(shape.displacement, axis=0))
    stiffness = np.array([EI, EI, EI / 1.33])
    weights = rod.pitch[:, None] * gauss_mesh(nodes).weight
    elastic = 0.5 * np.einsum("mkqa,a,kq->m", shape.curvature**2, stiffness, weights)
    # The backbone weighs a tenth of the disks; Simpson over each interval would need its middle, so lump it at the nodes.
    line = rod.backbone_mass / rod.length
    nodes_r = _node_positions(shape, rod, nodes)
    height = -rod.disk_mass[0] * (shape.disks @ gravity).sum(1) - line * np.einsum("mkqa,a,kq->m", nodes_r, gravity, weights)
    stored = (elastic + height)[-1] - (elastic + height)[0]
    np.testing.assert_allclose(work, stored, rtol=1e-5)


def _node_positions(shape, rod, nodes):
    from tools.simulators.rod.mechanics.frames import integrate

    N = len(rod.pitch)
    out = np.zeros((len(shape.disks), N, nodes, 3))
    for m, u in enumerate(shape.curvature):
        frames, disks, ends = np.zeros((N, nodes, 3, 3)), np.zeros((N + 1, 3, 3)), np.zeros((N + 1, 3))
        integrate(u, rod.pitch, gauss_mesh(nodes), frames, out[m], disks, ends)
    return out


def test_sliding_tendon_loses_exp_mu_theta():
    mu = 0.2
    pull = np.linspace(0, 3, 60)[:, None] * [1.0, 0.0, 0.0]
    shape = follow(Rod(), pull, gravity=NO_GRAVITY, mu=mu, stroke=1e-6)[-1]
    holes = np.concatenate([np.array([[0.008, 0, 0]]), shape.disks + 0.008 * shape.rotations[..., 0]])
    segment = np.diff(holes, axis=0)
    heading = np.arctan2(segment[:, 0], segment[:, 2])  # the pull is planar
    ratio = shape.tension[-1, 0] / shape.tension[0, 0]
    np.testing.assert_allclose(ratio, np.exp(-mu * (heading[-1] - heading[0])), rtol=1e-6)


def test_friction_remembers_the_way_and_holds():
    up, down = np.linspace(0, 4, 60), np.linspace(4, 2, 40)
    drive = np.concatenate([up, down, np.full(50, 2.0)])[:, None] * [1.0, 0.0, 0.0]
    shape = follow(Rod(), drive, gravity=NO_GRAVITY, mu=0.2)
    loading = shape.disks[np.argmin(np.abs(up - 2.0)), -1]
    unloading = shape.disks[len(up) + len(down) - 1, -1]
    assert np.linalg.norm(loading - unloading) > 5e-3
    # Held for fifty rows, nothing creeps: the state moves with slip only.
    np.testing.assert_allclose(shape.disks[-1, -1], unloading, rtol=0, atol=1e-9)


def test_creep_under_a_constant_moment_is_its_prony_series():
    # With a tip force held on, small deflection: tip(t) / tip(0) = 1 + sum a (1 - exp(-t / tau)).
    share, tau = np.array([0.05, 0.08]), np.array([5.0, 60.0])
    creep = Creep(share, tau, np.zeros((2, 8, 4, 3)))
    t = np.concatenate([[0.0], np.linspace(0.5, 120, 200)])
    drive = np.zeros((len(t), 3))
    x = follow(Rod(), drive, gravity=NO_GRAVITY, tip_force=[1e-4, 0, 0], dt=np.diff(t, prepend=0.0), creep=creep).disks[:, -1, 0]
    expected = 1 + (share * (1 - np.exp(-t[:, None] / tau))).sum(axis=1)
    np.testing.assert_allclose(x / x[0], expected, rtol=1e-5)


def test_driving_by_length_inverts_driving_by_tension():
    tension = np.array([2.0, 0.7, 0.0])
    x = np.linspace(0, 1, 20)[1:, None]
    pulled = follow(Rod(), x * tension, gravity=[9.81, 0, 0], payload=0.01)
    stretched = STIFFEST * pulled.tension[:, 0]
    # From all just taut on the straight robot; the third, without tension, is paid out a millimetre further.
    drive = np.vstack([np.zeros(3), (-pulled.displacement - stretched + [0, 0, 1e-3])[-3:]])
    back = follow(Rod(), drive, gravity=[9.81, 0, 0], payload=0.01, driven_by_length=True)
    np.testing.assert_allclose(back.tension[-1, 0], tension, rtol=0, atol=1e-6)
    np.testing.assert_allclose(back.disks[-1], pulled.disks[-1], rtol=0, atol=1e-9)


def test_straight_lengths_are_the_rods():
    np.testing.assert_allclose(straight_lengths(Rod()), 0.12, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", sorted(all_effects()))
def test_effect_at_zero_strength_is_off(name):
    day = bench_day("default", np.random.default_rng(0))
    fast = next(t for t in day.trials if t.name == "fast_1")
    short = replace(fast, time=fast.time[:20], start=2000.0)
    one = replace(day, trials=(short,))
    effect = replace(all_effects()[name].draw(np.random.default_rng(1)), strength=0.0)
    with_it, without = run(Rod(), [effect], one)[0], run(Rod(), [], one)[0]
    # A wall of strength 0 still stands, 95 mm away: out of reach of this pull.
    np.testing.assert_allclose(with_it.markers, without.markers, rtol=0, atol=1e-9)
    np.testing.assert_allclose(with_it.tension, without.tension, rtol=0, atol=1e-12)
    np.testing.assert_allclose(with_it.displacement, without.displacement, rtol=0, atol=1e-9)


def test_a_day_without_effects_is_as_described():
    day = bench_day("sideways", np.random.default_rng(2))
    day = replace(day, trials=day.trials[:2])
    logs = run(Rod(), [], day)
    for log, again in zip(logs, as_described(Rod(), [], logs, day), strict=True):
        np.testing.assert_allclose(log.markers, again.markers, rtol=0, atol=1e-9)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("set")
    make_set(folder / "a", Recipe(seed=5, displacement=True, ambient=True))
    make_set(folder / "b", Recipe(seed=5, displacement=True, ambient=True))
    return folder


def test_same_seed_same_bytes(written):
    files = sorted(p.name for p in (written / "a").iterdir())
    assert files == sorted(p.name for p in (written / "b").iterdir())
    for name in files:
        assert (written / "a" / name).read_bytes() == (written / "b" / name).read_bytes()


def test_a_written_set_keeps_the_contract(written):
    folder = written / "a"
    meta = tomllib.loads((folder / "measurements.toml").read_text())
    assert meta["format"] == "twin-measurements/1"
    assert meta["robot"] == "continuum"
    assert meta["source"].startswith("simulation")
    names = [c["name"] for c in meta["channel"]]
    assert {c["role"] for c in meta["channel"]} == {"input", "output", "context"}
    samples, starts = 0, []
    for trial in meta["trial"]:
        with (folder / trial["file"]).open() as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == ["time", *names]
        time = np.array([float(row["time"]) for row in rows])
        assert np.all(np.diff(time) > 0)
        for row in rows:  # a hidden marker lacks all three coordinates
            for k in range(1, 9):
                assert len({row[f"disk_{k}_{axis}"] == "" for axis in "xyz"}) == 1
        samples += len(rows)
        starts.append(trial["start"])
        assert trial["tip_payload"].endswith(" g")
    assert starts == sorted(starts)
    assert len(meta["trial"]) == 24
    assert 1600 < samples < 2100
    assert "truth" not in (folder / "measurements.toml").read_text()
