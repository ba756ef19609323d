"""Twins of rods written as MJCFs: stepped with their laws they repeat the twin's rollouts, in plain MuJoCo they are a rod."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.effects import effect_class
from twin.foundation.errors import DataError
from twin.prediction.mjcf import ChainStepper, Origins, write_mjcf
from twin.prediction.rollout import commands, rollout
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin
from twin.robots import load

RATE = 50.0  # Hz
TIME = np.arange(20) / RATE
TENSIONS = np.stack([0.2 + 0.8 * np.sin(6 * TIME) ** 2, 0.5 * TIME, np.full(len(TIME), 0.1)], axis=1)
CALIBRATED = {"backbone.youngs_modulus": 71.23456789012345e9, "disks.pitch_3": 0.01512345678901}
EFFECTS: dict[str, Mapping[str, float]] = {
    "actuator_lag": {"time": 0.03}, "actuator_saturation": {"loss": 0.5, "limit": 0.8},
    "backbone_creep": {"amplitude": 0.3, "time": 10.0}, "backbone_precurvature": {"about_x": 2.0}, "base_tilt": {"about_x": 0.2},
    "camera_misalignment": {"turn_x": 0.1, "shift_x": 0.01}, "contact": {"stiffness": 500.0, "distance": 0.005},
    "load_cell_bias": {"bias_1": 0.1}, "load_cell_crosstalk": {"share_1_2": 0.1}, "load_cell_drift": {"rate_1": 0.001},
    "load_cell_gain": {"gain_1": 1.2}, "stiffness_asymmetry": {"along": 0.2, "across": 0.1},
    "stiffness_gradient": {"gradient": 0.4}, "tendon_elasticity": {"stretch": 0.001}, "tendon_friction": {"mu": 0.2},
    "tendon_routing": {"angle_1": 0.2, "radius_1": 0.001}, "time_delay": {"delay": 0.05}, "tip_payload": {"mass": 0.01},
}  # fmt: skip
SMOOTHED = {"actuator_lag", "time_delay"}  # by rows to come
TWO = ("tendon_friction", "tip_payload")
CASES = {"bare": (), "two effects": TWO, **{name: (name,) for name in EFFECTS}}


def rod_with(effects: tuple[str, ...], values: Mapping[str, float] = CALIBRATED) -> Twin:
    rod = load("continuum")
    return Twin(rod, values, tuple(effect_class(e)(EFFECTS[e], rod.n_tendon) for e in effects))


def rolled_out(twin: Twin, tensions: np.ndarray = TENSIONS) -> Mapping[str, np.ndarray]:
    given = commands(twin, {f"tendon_{i + 1}_tension": column for i, column in enumerate(tensions.T)}, RATE)
    return rollout(twin, given, dynamic=True).recording.trials[0].values


def stepped(path: Path) -> dict[str, np.ndarray]:
    stepper, rows = ChainStepper(path, RATE), []
    stepper.reset(TENSIONS[0])
    rows.append(stepper.readings())
    for tension in TENSIONS[1:]:
        stepper.step(tension)
        rows.append(stepper.readings())
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def apart(found: Mapping[str, np.ndarray], wanted: Mapping[str, np.ndarray]) -> float:
    """The largest difference (m) of markers and displacements."""
    names = [n for n in wanted if n.startswith(("disk_", "tendon_")) and not n.endswith("_tension")]
    assert {"disk_8_x", "tendon_1_displacement"} <= set(names)
    return max(float(np.abs(found[n] - wanted[n]).max()) for n in names)


@pytest.mark.parametrize("case", CASES)
def test_stepped_with_its_laws_an_exported_rod_repeats_the_rollout(case: str, tmp_path: Path) -> None:
    twin = rod_with(CASES[case])
    wanted = rolled_out(twin)
    path = write_mjcf(twin, tmp_path / "out", Origins())
    # 1e-9 of the motion: numbers are written to the last digit, and the same steps are taken. Row by row the cubic between the rows
    # of a lag is a line: half a per cent of it, of the curvature of these commands, 36 / s^2 over (20 ms)^2 / 8.
    motion = float(np.ptp(wanted["disk_8_x"]))
    found = ChainStepper(path, RATE).run(TENSIONS)
    assert apart(found, wanted) < 1e-9 * motion
    assert apart(stepped(path), wanted) < (1e-2 if case in SMOOTHED else 1e-9) * motion
    if case != "bare":  # and it moves otherwise, by more than 10 um, than without the effect
        assert apart(found, rolled_out(rod_with(()))) > 1e-5


@pytest.mark.parametrize("name", ["three_cable", "tentacle"])
def test_any_rod_is_written(name: str, tmp_path: Path) -> None:
    """Thick disks, a cast body that stretches and stiffens; a robot in a folder of its own, which its twin's file finds."""
    shutil.copytree(load(name).folder, tmp_path / "own")
    rod = load(str(tmp_path / "own"))
    twin = Twin(rod, {}, tuple(effect_class(e)(EFFECTS[e], rod.n_tendon) for e in TWO))
    tensions = np.resize(TENSIONS[:8].T, (rod.build().n_tendon, 8)).T
    wanted = rolled_out(twin, tensions)
    found = ChainStepper(write_mjcf(twin, tmp_path / "out", Origins()), RATE).run(tensions)
    markers = [n for n in wanted if n.endswith(("_x", "_y", "_z"))]
    motion = max(float(np.ptp(wanted[n])) for n in markers)
    assert max(float(np.abs(found[n] - wanted[n]).max()) for n in markers) < 1e-9 * motion
    assert motion > 1e-4


def test_the_stepped_model_is_that_of_the_file(tmp_path: Path) -> None:
    """A stiffness changed in robot.xml by a third is felt: the numbers do not come from the twin beside it."""
    twin = rod_with(TWO)
    path = write_mjcf(twin, tmp_path, Origins())
    spec = mujoco.MjSpec.from_file(str(path))
    for joint in spec.joints:
        joint.stiffness = joint.stiffness * 1.5
    spec.compile()
    path.write_text(spec.to_xml())
    assert apart(stepped(path), rolled_out(twin)) > 1e-3


def settled_tip(path: Path, tensions: np.ndarray) -> np.ndarray:
    """The tip (m) where plain MuJoCo comes to rest."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.ctrl[:] = tensions
    mujoco.mj_step(model, data, 3000)
    return data.site("disk_8").xpos.copy()


def test_plain_mujoco_bends_as_the_twin_does(tmp_path: Path) -> None:
    """With payload and a tilted base, without friction.

    Plain MuJoCo has the springs of the hinges for the elastic moment of a rod that bows between its disks and bends in two planes:
    1.4 % of the way of the tip here, allowed are 5 %. Without the payload it is further off than that.
    """
    twin = rod_with(("tip_payload", "base_tilt"), {})
    at = np.array([0.6, 0.0, 0.0])
    given = {f"tendon_{i + 1}_tension": np.full(3, T) for i, T in enumerate(at)}
    values = rollout(twin, commands(twin, given, RATE), dynamic=False).recording.trials[0].values
    wanted = np.array([values[f"disk_8_{a}"][-1] for a in "xyz"])
    found = settled_tip(write_mjcf(twin, tmp_path / "a", Origins()), at)
    without = settled_tip(write_mjcf(rod_with(("base_tilt",), {}), tmp_path / "b", Origins()), at)
    way = np.linalg.norm(wanted[:2])
    assert np.linalg.norm(found - wanted) < 0.05 * way
    assert np.linalg.norm(without - wanted) > 0.05 * way


def test_the_file_says_what_it_is_and_holds_the_twin(tmp_path: Path) -> None:
    twin = rod_with((*TWO, "base_tilt"))
    path = write_mjcf(twin, tmp_path, Origins({"tendon_friction.mu": 0.01}, {"tendon_friction": "probability 0.98"}))
    text = path.read_text()
    assert text.splitlines()[1].startswith("  <!-- Twin of continuum:")
    assert "tendon_friction: mu = 0.2 +- 0.01, probability 0.98" in text
    assert "Plain MuJoCo does not do: friction of tendons, creep" in text
    model = mujoco.MjModel.from_xml_path(str(path))
    assert [model.actuator(i).name for i in range(model.nu)] == ["tendon_1", "tendon_2", "tendon_3"]
    assert model.body("payload").mass[0] == EFFECTS["tip_payload"]["mass"]
    assert np.linalg.norm(model.opt.gravity) == pytest.approx(9.80665, rel=1e-3)
    assert abs(model.opt.gravity[1]) > 1.0  # sin 0.2 of it
    assert model.joint("bend_x_1").damping[0] > 0.0
    assert read_twin(tmp_path).values == twin.values
    assert read_twin(tmp_path).effects == twin.effects
    picture = mujoco.MjvScene(model, 1000)  # drawn without a window
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, picture)
    assert picture.ngeom > 20  # links, disks and pieces of tendons


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    rod = load("continuum")
    soft = Twin(rod, {}, (effect_class("temperature_softening")({"rate": 0.01}, 3),))
    with pytest.raises(DataError, match=r"effect temperature_softening changes the stiffness within a trial.*twin rollout"):
        write_mjcf(soft, tmp_path / "a", Origins())
    round_post = {"stiffness": 500.0, "distance": 0.05, "curvature": 100.0}
    with pytest.raises(DataError, match=r"effect contact has a round post.*twin rollout"):
        write_mjcf(Twin(rod, {}, (effect_class("contact")(round_post, 3),)), tmp_path / "b", Origins())
    with pytest.raises(DataError, match=r"robot 'finger' is of family 'soft'; families 'mjcf' and 'continuum'.*twin rollout"):
        write_mjcf(Twin.of("finger"), tmp_path / "c", Origins())
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_not_the_twins_is_refused(tmp_path: Path) -> None:
    path = write_mjcf(rod_with(()), tmp_path, Origins())
    path.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(DataError, match=r"'tendon_1' are not both in the model.*export it again"):
        ChainStepper(path)
    with pytest.raises(DataError, match="a rate of 0 Hz"):
        ChainStepper(path, 0.0)
    (tmp_path / "twin.toml").unlink()
    with pytest.raises(DataError, match="no such twin"):
        ChainStepper(path)
