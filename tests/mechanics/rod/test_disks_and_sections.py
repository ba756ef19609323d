"""Continuum robots of thick and unequal disks, other sections and long intervals; and all at once.

Truths: the rod of tools/simulators/rod (Gauss nodes, no code in common), arcs in closed form, beam theory.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from tests.other_continua import (
    CLOSE,
    EI,
    GJ,
    HANGING,
    HELICAL,
    LENGTH,
    OUTWARD,
    SIDEWAYS,
    TURN,
    disks,
    helical_rod,
    off,
    robot,
)
from tools.simulators.rod.mechanics.rod import Rod, follow
from tools.simulators.rod.mechanics.rod import solve as rod_solve
from twin.body import Loads, Problem, Route
from twin.effects import catalogue
from twin.effects.contact import obstacle
from twin.foundation.errors import DataError
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.chain import ChainState, force_balance
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.mechanics.rod.dynamics import Dynamics
from twin.robots import Robot, load
from twin.robots.robot import models_folder

# ---- disks -----------------------------------------------------------------------------------------------------------------


def test_disks_have_masses_of_their_own(tmp_path: Path) -> None:
    mass = np.array([0.2, 0.3, 1.5, 0.1, 0.4, 0.6, 0.7, 1.3])
    body = robot(tmp_path, disks__mass=(mass.tolist(), "g")).build()
    model = body.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    still = body.joints[0].arclength  # the wire below the first joint cannot move
    wire, z = 0.6 * (1 - still), 0.015 * np.arange(1, 9)
    assert model.body_mass.sum() == pytest.approx(1e-3 * (wire + mass.sum()), rel=1e-13)
    centre = (wire * 0.06 * (1 + still) + mass @ z) / (wire + mass.sum())
    assert data.subtree_com[0, 2] == pytest.approx(centre, rel=1e-13)
    truth = rod_solve(Rod(disk_mass=1e-3 * mass), [0.5, 0, 0], gravity=SIDEWAYS).disks
    assert off(disks(Equilibrium(body), [0.5, 0, 0], SIDEWAYS), truth) < CLOSE / 10  # a bend by a tenth
    assert off(rod_solve(Rod(), [0.5, 0, 0], gravity=SIDEWAYS).disks, truth) > 5 * CLOSE


THICK = 5e-3  # m, of 15 mm from disk to disk


def test_thick_disks_bend_between_their_faces(tmp_path: Path) -> None:
    """Without weight: arcs between the faces, each turning by the angle that makes EI th^2 / (2 h) + 2 T (h / th - r) sin(th / 2)
    least, then straight through the disk."""
    tension, r = 1.0, 8e-3
    solver = Equilibrium(robot(tmp_path, disks__thickness=(1e3 * THICK, "mm")).build())
    place, angle, found = np.zeros(2), 0.0, []
    for k in range(8):
        h = 15e-3 - (THICK if k else 0.5 * THICK)

        def slope(x: float, h: float = h) -> float:
            s, c = np.sin(x / 2), np.cos(x / 2)
            return EI * x / h + 2 * tension * (-h / x**2 * s + (h / x - r) * c / 2)

        bend = brentq(slope, 1e-3, 1.0)
        chord, middle = 2 * h / bend * np.sin(bend / 2), angle + bend / 2
        angle += bend
        along = np.array([np.sin(angle), np.cos(angle)])
        place = place + chord * np.array([np.sin(middle), np.cos(middle)]) + 0.5 * THICK * along
        found.append(place)
        place = place + 0.5 * THICK * along
    truth = np.insert(found, 1, 0.0, axis=1)
    # m: the chain's own error in a bend of 3 degrees a disk
    assert off(disks(solver, [tension, 0, 0]), truth) < CLOSE / 10
    assert off(disks(Equilibrium(load("continuum").build()), [tension, 0, 0]), truth) > 5 * CLOSE


def thick_rod() -> Rod:
    """Each disk as two stiff pieces of rod around its mass; holes of the helical robot at both faces."""
    thin, half = helical_rod(), 0.5 * THICK
    pitch = np.array([x for k in range(8) for x in (15e-3 - (2 * half if k else half), half, half)])[:-1]
    stiff = np.array([x for _ in range(8) for x in (1.0, 1e5, 1e5)])[:-1]
    mass = np.array([x for _ in range(8) for x in (0.0, 0.63e-3, 0.0)])[:-1]
    face = np.array([0, *np.repeat(np.arange(1, 9), 3)])[:-1]
    return Rod(
        pitch=pitch, stiffness_profile=stiff, disk_mass=mass, hole_radius=thin.hole_radius[face], hole_angle=thin.hole_angle[face],
        precurvature=np.zeros((23, 3)), marker_offset=np.zeros(23),
    )  # fmt: skip


def test_thick_disks_with_helical_tendons_are_the_rod(tmp_path: Path) -> None:
    solver = Equilibrium(robot(tmp_path, **HELICAL, disks__thickness=(1e3 * THICK, "mm")).build())
    tension = [2.0, 1.0, 0.5]
    for mu in (0.0, 0.2):
        t = np.arange(41.0)
        T = np.outer(t / 40, tension)
        lead = np.array([0.25, 0.5, 0.75])
        drive, weight = np.vstack([np.zeros((3, 3)), T]), np.append(lead, np.ones(len(T)))
        truth = follow(thick_rod(), drive, gravity=SIDEWAYS, payload=0.01, weight=weight, mu=mu, stroke=2e-5).disks[3:, 1::3]
        ours = solver.solve(Problem(t, T, Loads(SIDEWAYS, 0.01), Route(mu, 2e-5))).markers[:, :8]
        # with friction: the rounded turn, at 15 holes now, as above
        assert off(ours, truth) < CLOSE + mu * 15e-3 * 0.08
    thin = follow(helical_rod(), drive, gravity=SIDEWAYS, payload=0.01, weight=weight, mu=mu, stroke=2e-5).disks[3:]
    assert off(thin, truth) > 10 * CLOSE


def test_a_thick_disk_is_a_cylinder(tmp_path: Path) -> None:
    """Turning about its own diameter it has m (r^2/4 + t^2/12)."""
    thin, thick = (
        robot(tmp_path, disks__thickness=(t, "mm"), backbone__mass=(1e-3, "g")).build().spec.compile() for t in (0.0, 12.0)
    )
    more = thick.body_inertia[-1, 0] - thin.body_inertia[-1, 0]
    # the wire's microgram, on levers of 10 mm, moves with the joints: 1e-7 kg / 8 times 1e-4 m^2
    assert more == pytest.approx(0.63e-3 * 0.012**2 / 12, abs=1e-11)


# ---- backbone --------------------------------------------------------------------------------------------------------------

RECTANGLE = ("backbone.youngs_modulus", "backbone.poisson_ratio", "backbone.radius_taper")


def strip(folder: Path, x: float, y: float) -> Robot:
    """EI about x and y, times the nominal one."""
    stiff = {f"backbone__{k}": (1e6 * v, "N*mm^2") for k, v in (("bending_x", x * EI), ("bending_y", y * EI), ("twisting", GJ))}
    return robot(folder, {"section": "other"}, RECTANGLE, **stiff)


def test_a_strip_bends_as_a_beam_in_both_planes(tmp_path: Path) -> None:
    """F L^3 / (3 EI): a force along x bends about y."""
    solver, F = Equilibrium(strip(tmp_path, 4.0, 0.5).build()), 1e-4
    for axis, share in ((0, 0.5), (1, 4.0)):
        tip = disks(solver, [0, 0, 0], force=F * np.eye(3)[axis])[-1]
        # the beam's own small angles: (F L^2 / (2 EI))^2 of 1e-6; the two sets are exact for what is linear along a disk interval
        assert tip[axis] == pytest.approx(F * LENGTH**3 / (3 * share * EI), rel=1e-5)
        assert abs(tip[1 - axis]) < 1e-9


def test_a_strip_under_tendons_is_the_rod(tmp_path: Path) -> None:
    ratio = 3.0
    mine = strip(tmp_path, np.sqrt(ratio), 1 / np.sqrt(ratio))
    solver, rod = Equilibrium(mine.build()), Rod(stiffness_asymmetry=ratio)
    for tension in ([2.0, 0.0, 0.0], [0.0, 2.0, 0.5], [1.0, 0.2, 1.5]):
        truth = rod_solve(rod, tension, gravity=SIDEWAYS, payload=0.01).disks
        assert off(disks(solver, tension, SIDEWAYS, 0.01), truth) < CLOSE
        assert off(rod_solve(Rod(), tension, gravity=SIDEWAYS, payload=0.01).disks, truth) > 10 * CLOSE


def test_asymmetry_found_on_a_strip_turns_its_own_axes(tmp_path: Path) -> None:
    """Stiffness about x and y as the effect's equation has it, whatever the hinges are turned to."""
    body = strip(tmp_path, 4.0, 0.5).build()
    catalogue()["stiffness_asymmetry"]({"along": 0.1, "across": 0.05}).edit(body)
    at = body.joints[0]
    own = np.zeros((2, 2))
    for name in (at.bend_x, at.bend_y):
        joint = body.spec.joint(name)
        own += joint.stiffness[0] * np.outer(joint.axis[:2], joint.axis[:2])
    between = np.sqrt(4.0 * 0.5) * 0.05
    expected = EI / 7.5e-3 * np.array([[4.0 * 1.1, between], [between, 0.5 * 0.9]])
    np.testing.assert_allclose(own, expected, rtol=1e-12)


def test_long_intervals_are_divided(tmp_path: Path) -> None:
    """Two disks, 60 mm apart: the tendon is far from the arc, and more joint sets find the rod's shape."""
    numbers = {"disks__pitch": (60.0, "mm"), "markers__axial_offset": (0.0, "mm")}
    rod = Rod(
        pitch=np.full(2, 0.06), disk_mass=np.full(2, 2.52e-3), hole_radius=np.full((3, 3), 8e-3), stiffness_profile=np.ones(2),
        hole_angle=np.tile(np.radians([0.0, 120.0, 240.0]), (3, 1)), precurvature=np.zeros((2, 3)), marker_offset=np.zeros(2),
    )  # fmt: skip
    tension = [2.0, 0.0, 0.0]
    truth = rod_solve(rod, tension, gravity=SIDEWAYS, nodes=10).disks  # more than 10 nodes are beyond the rod's own rounding
    error = {}
    for pieces in (1, 2, 4, [4, 2]):
        mine = robot(tmp_path, {"disks": 2, "pieces": pieces}, **numbers)
        assert len(mine.build().joints) == (12 if pieces == [4, 2] else 4 * pieces)
        error[str(pieces)] = off(disks(Equilibrium(mine.build()), tension, SIDEWAYS), truth)
    assert error["2"] < 0.35 * error["1"]  # second order at least
    assert error["4"] < 0.35 * error["2"]
    assert error["4"] < CLOSE < error["2"] < 2e-3 * LENGTH < error["1"]  # 0.85, 0.43 and 0.21 rad a piece
    assert error["4"] < error["[4, 2]"] < error["1"]


# ---- all at once -----------------------------------------------------------------------------------------------------------


def everything(folder: Path) -> Robot:
    thickness = [2.0, 0.0, 4.0, 1.0, 1.0, 0.0, 2.0, 3.0]
    structure = {"section": "other", "tendons_end": [8, 5, 3], "pieces": [2, 1, 1, 3, 1, 1, 1, 2]}
    stiff = {
        "backbone__bending_x": (1.5e3, "N*mm^2"),
        "backbone__bending_y": (2.5e3, "N*mm^2"),
        "backbone__twisting": (1e3, "N*mm^2"),
    }
    mass = np.linspace(0.3, 0.9, 8).tolist()
    return robot(folder, structure, RECTANGLE, **stiff, **HELICAL, disks__thickness=(thickness, "mm"), disks__mass=(mass, "g"))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_tangent_is_the_slope_of_the_residual(mu: float, tmp_path: Path) -> None:
    e = Equilibrium(everything(tmp_path).build())
    nv, shape = e.model.nv, (3, e.chain.hole.shape[1] - 1)
    rng = np.random.default_rng(2)
    wall = obstacle((-1.0, 0.0, 0.0), -0.02, 300.0)
    loads = Loads(np.array([3.0, -5.0, 7.0]), 0.02, np.array([0.02, 0.01, -0.03]), wall)
    q, rest, T = rng.normal(0, 0.1, nv), rng.normal(0, 0.02, nv), rng.uniform(0.5, 4, 3)
    under = e.statics(Problem(np.zeros(1), T[None], loads, Route(mu, 4e-4)))._replace(rest=rest)

    def at(q: np.ndarray, z0: np.ndarray, s0: np.ndarray, J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, z, s = np.empty(nv), np.full(shape, np.nan), np.full(shape, np.nan)
        update_kinematics(under, q)
        force_balance(under, ChainState(T, q, z0, s0), z, s, r, J)
        assert np.isfinite([z, s]).all()
        return r, s

    none, z0 = np.empty((0, 0)), rng.uniform(-0.9, 0.9, shape)
    s0 = at(q, z0, np.zeros(shape), none)[1]
    z0[0] = 1.0  # a sliding tendon, released so far that it stays so
    s0[0] += 1e-2
    J = np.full((nv, nv), np.nan)
    at(q, z0, s0, J)
    step = 1e-5
    numeric = np.stack([(at(q + d, z0, s0, none)[0] - at(q - d, z0, s0, none)[0]) / (2 * step) for d in step * np.eye(nv)]).T
    # N m/rad of up to 2: as in test_balance, elastic differences over 1e-6 rad
    np.testing.assert_allclose(J, numeric, rtol=0, atol=1e-5)
    if mu == 0.0:
        np.testing.assert_allclose(J, J.T, rtol=0, atol=1e-9)


def test_statics_and_dynamics_agree_at_rest(tmp_path: Path) -> None:
    mine = everything(tmp_path)
    t = np.linspace(0.0, 3.0, 61)
    tension = np.minimum(t / 1.5, 1.0)[:, None] * np.array([1.0, 0.8, 0.6])
    problem = Problem(t, tension, Loads(HANGING, 0.005))
    still, moving = mine.solver(mine.build()).solve(problem), mine.solver(mine.build(), dynamic=True).solve(problem)
    assert isinstance(mine.solver(mine.build(), dynamic=True), Dynamics)
    # m: what is left of the swing 1.5 s after the ramp, damped by a fifth of critical, of a bend of 40 mm
    assert off(moving.markers[-1], still.markers[-1]) < 1e-4
    np.testing.assert_allclose(moving.path[-1], still.path[-1], rtol=0, atol=2e-5)


# (structure, numbers, dropped, what the message must hold)
REFUSED = {
    "ends for two of three": ({"tendons_end": [4, 8]}, {}, (), ["tendons_end", "[4, 8]", "list of 3"]),
    "an end beyond": ({"tendons_end": [4, 8, 9]}, {}, (), ["tendons_end", "1 to 8"]),
    "pieces for two of eight": ({"pieces": [1, 2]}, {}, (), ["pieces", "list of 8"]),
    "no pieces": ({"pieces": 0}, {}, (), ["pieces", "0"]),
    "half a piece": ({"pieces": 1.5}, {}, (), ["pieces", "1.5"]),
    "a strip described as a wire": ({"section": "other"}, {}, (), ["youngs_modulus", "section", "missing: backbone.bending_x"]),
    "turns of one disk": ({}, {"holes__turn": ([[1.0], [2.0], [3.0]], "deg")}, (), ["holes.turn", "1 numbers", "list of 8"]),
    "turns that all tendons share": (
        {}, {"holes__turn": (TURN[0].tolist(), "deg")}, (), ["holes.turn", "list of 3", "each a list of one a disk"],
    ),
    "turns of two tendons": ({}, {"holes__turn": (TURN[:2].tolist(), "deg")}, (), ["holes.turn", "list of 3"]),
    "turns without unit": ({}, {"holes__turn": (TURN.tolist(), "1")}, (), ["holes.turn", "deg"]),
    "a hole in the wire": ({}, {"holes__outward": ((OUTWARD * 3).tolist(), "mm")}, (), ["tendon 1 at disk 8", "-1.6 mm", "0.4 mm"]),
    "a hole beyond the rim": (
        {}, {"holes__outward": ((-OUTWARD.clip(max=0) * 2).tolist(), "mm")}, (), ["tendon 1 at disk 8", "14.4 mm", "10 mm"]
    ),
    "disks that touch": ({}, {"disks__thickness": (15.0, "mm")}, (), ["thickness", "0 mm of the 15 mm", "disk 2"]),
    "disks below nothing": ({}, {"disks__thickness": (-1.0, "mm")}, (), ["disks.thickness", "-1 mm", "0 to 1000 mm"]),
    "masses of two disks": ({}, {"disks__mass": ([1.0, 2.0], "g")}, (), ["disks.mass", "2 numbers", "8"]),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_built_is_refused_by_name(case: str, tmp_path: Path) -> None:
    structure, numbers, drop, said = REFUSED[case]
    with pytest.raises(DataError) as caught:
        robot(tmp_path, structure, drop, **numbers)
    message = str(caught.value)
    assert all(part in message for part in said), message


def test_a_cast_body_keeps_to_what_it_can(tmp_path: Path) -> None:
    text = (models_folder() / "tentacle/robot.toml").read_text("utf-8")
    for line, said in (("pieces = 2", "more disks"), ('section = "other"', "round here")):
        (tmp_path / "robot.toml").write_text(text.replace("[structure]", f"[structure]\n{line}"), "utf-8")
        with pytest.raises(DataError, match=said):
            load(str(tmp_path))
