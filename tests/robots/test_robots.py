"""What every robot folder under models/ must satisfy, and what a broken `robot.toml` says of itself."""

from __future__ import annotations

import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.body import Loads, Problem, Route
from twin.body.hinge_chain import HingeChain, hinge_pairs
from twin.diagnosis.calibration.model import Model
from twin.effects import catalogue
from twin.foundation.errors import DataError, UnknownNameError
from twin.mechanics.rod import Equilibrium
from twin.prediction.twin import Twin
from twin.robots import load, robot_names
from twin.robots.robot import models_folder

robots = pytest.mark.parametrize("name", robot_names())
backbones = pytest.mark.parametrize("name", [n for n in robot_names() if isinstance(load(n).build(), HingeChain)])
TOML = (models_folder() / "continuum/robot.toml").read_text("utf-8")


def written(name: str) -> dict:
    """The robot's file, read by the test itself."""
    return tomllib.loads((models_folder() / name / "robot.toml").read_text("utf-8"))


@backbones
def test_it_compiles_and_all_its_names_exist(name: str) -> None:
    body = load(name).build()
    model = body.spec.compile()
    sites = [*(hole for tendon in body.tendon_sites for hole in tendon), *body.marker_sites, *body.disks, body.tip]
    assert all(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site) >= 0 for site in sites)
    hinges = [hinge for at in body.joints for hinge in (at.bend_x, at.bend_y, at.twist)]
    slides = [at.slide for at in body.joints if at.slide is not None]
    joints = [*hinges, *slides]
    assert sorted(model.joint(joint).id for joint in joints) == list(range(model.njnt))  # each once, and none besides
    assert len(slides) in (0, len(body.joints))
    assert len(body.tendon_sites) == load(name).structure["tendons"]
    assert model.nu == sum(len(tendon) - 1 for tendon in body.tendon_sites)
    assert {hinge for pair in hinge_pairs(body) for hinge in pair} == set(hinges)


@backbones
def test_its_backbone_is_divided_among_the_joints_without_rest(name: str) -> None:
    body = load(name).build()
    # m: sums of a dozen lengths of 0.1 m; rounding is 1e-17 each
    np.testing.assert_allclose(sum(at.length for at in body.joints), body.length, rtol=0, atol=1e-15)
    along = [at.arclength for at in body.joints]
    assert along == sorted(along)
    assert 0.0 <= along[0] < along[-1] <= 1.0


@robots
def test_every_parameter_has_a_unit_a_source_and_bounds_around_it(name: str) -> None:
    robot = load(name)
    assert robot.parameters
    for p in robot.parameters:
        assert p.source.strip(), p.name
        assert p.low <= p.value <= p.high
        if p.std is not None:  # a fit needs walls, and room between them
            assert np.isfinite([p.low, p.high]).all(), p.name
            assert p.low < p.value - p.std < p.value + p.std < p.high, p.name


@robots
def test_what_it_is_known_to_have_is_in_the_catalogue(name: str) -> None:
    assert {effect for effect, _ in load(name).effects} <= set(catalogue())
    assert Twin.of(name).robot.name == name


def mass_and_centre(name: str) -> tuple[float, np.ndarray]:
    """Of all that moves, of the straight robot."""
    model = load(name).build().spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return float(model.body_mass.sum()), data.subtree_com[0]


@pytest.mark.parametrize("name", [n for n in robot_names() if written(n)["structure"].get("body") == "cast"])
def test_a_cast_body_has_the_mass_of_its_cones(name: str) -> None:
    """Cones from station to station, integrated in fine slices; the first quarter of the first interval is part of the base."""
    file = written(name)["parameters"]
    station, radius = (1e-3 * np.array(file[f"backbone.{k}"]["value"]) for k in ("station", "radius"))
    pitch = 1e-3 * np.broadcast_to(file["disks.pitch"]["value"], written(name)["structure"]["disks"])
    s = np.linspace(0.25 * pitch[0], pitch.sum(), 200_001)
    slices = file["backbone.density"]["value"] * np.pi * np.interp(s, station, radius) ** 2
    mass, centre = mass_and_centre(name)
    np.testing.assert_allclose(mass, np.trapezoid(slices, s), rtol=1e-5)  # pitches are written with five digits
    # m: a link's mass sits at its middle: of a cone of 30 mm that thins by 6 %, 0.3 mm off at most
    np.testing.assert_allclose(centre, [0, 0, np.trapezoid(slices * s, s) / mass], rtol=0, atol=3e-4)


@pytest.mark.parametrize("name", [n for n in robot_names() if "disks.mass" in written(n)["parameters"]])
def test_its_masses_are_those_of_its_file(name: str) -> None:
    """Total mass, and where it is: the centre of mass of the straight robot, from the numbers in the file."""
    file = written(name)["parameters"]
    body = load(name).build()
    mass, found = mass_and_centre(name)
    disks = 1e-3 * file["disks.mass"]["value"]
    pitch = 1e-3 * np.array(file["disks.pitch"]["value"])
    length = pitch.sum()
    still = body.joints[0].arclength  # the piece of wire below the first joint cannot move; all else does
    wire = 1e-3 * file["backbone.mass"]["value"] * (1 - still)
    # kg: sums of some twenty parts of a gram; rounding is 1e-19 each
    np.testing.assert_allclose(mass, wire + disks, rtol=0, atol=1e-15)
    centre = (wire * 0.5 * (1 + still) * length + disks * np.cumsum(pitch).mean()) / (wire + disks)
    # m: both are weighted means of the same pieces, but for rounding
    np.testing.assert_allclose(found, [0, 0, centre], rtol=0, atol=1e-14)


@backbones
def test_turned_tensions_turn_the_shape(name: str) -> None:
    """A robot with equally spaced tendons that hangs along its axis looks the same from every tendon."""
    body = load(name).build()
    solver = Equilibrium(body)
    n = len(body.tendon_sites)
    holes = [np.array(body.spec.site(tendon[0]).pos) for tendon in body.tendon_sites]
    turn = 2 * np.pi / n
    R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    if not np.allclose(holes[1], R @ holes[0], rtol=0, atol=1e-9):
        pytest.skip("its tendons are not equally spaced")
    tension = np.random.default_rng(3).uniform(0, 3, (5, n))
    time, loads = np.arange(5.0), Loads(np.array([0, 0, 9.81]), payload=0.01)
    for route in (Route(), Route(0.2, 4e-4)):
        one = solver.solve(Problem(time, tension, loads, route, tolerance=1e-11)).markers
        other = solver.solve(Problem(time, np.roll(tension, 1, axis=1), loads, route, tolerance=1e-11)).markers
        # m: 48 hinges each within 1e-11 rad, over 0.12 m. The order of the hinges within a joint differs from plane to
        # plane and must not be seen: the elastic energy is written in the true bending.
        np.testing.assert_allclose(other, one @ R.T, rtol=0, atol=1e-9)


@backbones
def test_mirrored_tensions_mirror_the_shape(name: str) -> None:
    """The plane of tendon 1 is a plane of symmetry: swapping the tendons left and right of it mirrors the robot."""
    body = load(name).build()
    solver = Equilibrium(body)
    holes = np.array([body.spec.site(tendon[0]).pos for tendon in body.tendon_sites])
    mirror = np.diag([1.0, -1.0, 1.0])
    partner = [int(np.argmin(np.linalg.norm(holes - mirror @ h, axis=1))) for h in holes]
    if not np.allclose(holes[partner], holes @ mirror, rtol=0, atol=1e-9):
        pytest.skip("its tendons are not mirror images of each other")
    tension = np.random.default_rng(4).uniform(0, 3, (5, len(holes)))
    time, loads = np.arange(5.0), Loads(np.array([3.0, 0, 9.0]), payload=0.01)
    one = solver.solve(Problem(time, tension, loads, tolerance=1e-11)).markers
    other = solver.solve(Problem(time, tension[:, partner], loads, tolerance=1e-11)).markers
    np.testing.assert_allclose(other, one @ mirror, rtol=0, atol=1e-9)  # m: as above


def broken(folder: Path, old: str, new: str) -> Path:
    """A copy of the continuum robot whose file differs in one place."""
    assert old in TOML
    where = folder / "mine"
    where.mkdir()
    (where / "robot.toml").write_text(TOML.replace(old, new, 1), "utf-8")
    return where


RADIUS = 'value = 0.4, unit = "mm"'
BROKEN = {
    "no toml": ("[structure]", "[structure", "line 8"),
    "another format": ("twin-robot/1", "twin-robot/9", "twin-robot/9"),
    "no family": ('family = "continuum"', "", "family"),
    "no gravity": ("[gravity]", "[gravitation]", "gravity"),
    "no parameters": ("[parameters]", "[parameter]", "parameters"),
    "a number without a source": (', source = "Peng Table 2: r"', "", "backbone.radius.*source"),
    "a number without a unit": (RADIUS, "value = 0.4", "backbone.radius.*unit"),
    "a unit nobody knows": (RADIUS, 'value = 0.4, unit = "mmm"', "backbone.radius.*mmm"),
    "a unit of no use": (RADIUS, 'value = 0.4, unit = "lux"', "backbone.radius.*lux"),
    "an effect without an id": ("[gravity]", '[[effect]]\nname = "tendon_friction"\n[gravity]', "id"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_named_with_what_is_wrong(case: str, tmp_path: Path) -> None:
    old, new, said = BROKEN[case]
    with pytest.raises(DataError, match=rf"(?s)mine.robot\.toml.*{said}"):
        load("mine", relative_to=broken(tmp_path, old, new).parent)


# (old, new, what the message must hold)
LEAKY = {
    "a word for a number": (RADIUS, 'value = "thin", unit = "mm"', "backbone.radius"),
    "a word for a spread": ("std = 4.66", 'std = "some"', "backbone.youngs_modulus"),
    "a bare number": ('{ value = 0.4, unit = "mm", source = "Peng Table 2: r" }', "0.4", "backbone.radius"),
    "a value that is no number": (RADIUS, 'value = nan, unit = "mm"', "backbone.radius"),
    "a value beyond its bounds": ("value = 77.59", "value = 177.59", "backbone.youngs_modulus"),
    "a spread of nothing": ("std = 4.66", "std = 0.0", "backbone.youngs_modulus"),
    "a unit of another dimension": (RADIUS, 'value = 0.4, unit = "kg"', "backbone.radius"),
    "a family nobody wrote": ('family = "continuum"', 'family = "contineum"', "contineum"),
    "a parameter the family needs and does not get": ('"backbone.radius"  ', '"backbone.radios"  ', "backbone.radius"),
    "seven pitches for eight disks": ("15.0, 15.0], unit", "15.0], unit", "disks.pitch"),
    "no number of disks": ("disks   = 8", "", "disks"),
    "a word for the number of disks": ("disks   = 8", 'disks = "eight"', "disks"),
    "no disks": ("disks   = 8", "disks = 0", "disks"),
    "gravity in a plane": ("value = [0.0, 0.0, 9.81]", "value = [0.0, 9.81]", "gravity"),
    "an accuracy in words": ("value = 0.01\n", 'value = "good"\n', "accuracy"),
    "an effect nobody wrote": ("[gravity]", '[[effect]]\nid = "tendon_frictoin"\n[gravity]', "tendon_frictoin"),
    "an effect's spread of nothing": (
        "[gravity]",
        '[[effect]]\nid = "tip_payload"\nparameters = { mass = { value = 2, unit = "g", std = 0 } }\n[gravity]',
        "std is 0",
    ),
}


@pytest.mark.parametrize("case", LEAKY)
def test_any_other_broken_file_is_named_too(case: str, tmp_path: Path) -> None:
    old, new, said = LEAKY[case]
    with pytest.raises(DataError, match=rf"(?s)mine.robot\.toml.*{said}"):
        Twin.of(load("mine", relative_to=broken(tmp_path, old, new).parent)).robot.build().spec.compile()


def test_of_an_effect_the_robot_has_what_is_uncertain_is_free_with_the_robots_own(tmp_path: Path) -> None:
    """A gap of 0.2 mm, give or take 0.1; over which travel it swaps is stated. What a robot has for certain is not fitted."""
    laws = """[[effect]]
id = "tendon_backlash"
parameters = { gap = { value = 0.2, unit = "mm", std = 0.1 }, swap = { value = 0.1, unit = "mm" } }
[[effect]]
id = "tip_payload"
parameters = { mass = 0.002 }
[gravity]"""
    robot = load("mine", relative_to=broken(tmp_path, "[gravity]", laws).parent)
    ((identifier, gap),) = robot.uncertain
    assert (identifier, gap.name) == ("tendon_backlash", "gap")
    assert (gap.value, gap.std) == pytest.approx((2e-4, 1e-4))
    base = Model.base(robot)
    assert [f.label for f in base.free] == [*(p.name for p in robot.nuisance), "tendon_backlash.gap"]
    assert base.value(base.free[-1]) == pytest.approx(2e-4)
    assert [f.effect for f in Model.base(robot, Twin(robot)).free] == [None] * len(robot.nuisance), "a twin without it"


def test_an_unknown_robot_lists_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match=r"no robot named 'contineum'; available: .*continuum"):
        load("contineum")


def test_a_folder_is_a_robot(tmp_path: Path) -> None:
    folder = broken(tmp_path, "value = 120.0", "value = 120.0")
    assert load(str(folder)).parameters == load("continuum").parameters
    assert load("mine", relative_to=tmp_path).name == "mine"


def test_a_markers_offset_points_from_base_to_tip() -> None:
    """The straight robot's disk k stands at the sum of the first k pitches; its marker the offset further from the base."""
    robot = load("continuum")
    values = {p.name: p.value for p in robot.parameters}
    offset = {f"markers.axial_offset_{k}": 1e-4 * (k - 3) for k in range(1, 9)}
    body = robot.build(offset)
    model = body.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    heights = np.cumsum([values[f"disks.pitch_{k}"] for k in range(1, 9)]) + list(offset.values())
    for k, height in enumerate(heights, 1):
        np.testing.assert_allclose(data.site(f"disk_{k}").xpos, [0.0, 0.0, height], rtol=0, atol=1e-12)
