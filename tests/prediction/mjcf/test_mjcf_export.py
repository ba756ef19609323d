"""Twins of MJCFs written as MJCFs: stepped with their laws they are the twin, in plain MuJoCo they are what MuJoCo can say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.mechanics.mjcf.models import PENDULUM, robot
from twin.effects import catalogue, effect_class
from twin.foundation.errors import DataError, TwinError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.mjcf import ModelStepper, Origins, export_mjcf, origins_of, write_mjcf
from twin.prediction.twin import Twin
from twin.robots import Robot, load

STEP, SETTLE = 2e-3, 0.3  # s
TIME = np.round(STEP * np.arange(300), 12)
COMMANDS = np.stack([0.3 * np.sin(9 * TIME), 0.004 + 0.004 * np.sin(5 * TIME)], axis=1)
OUTPUTS = {
    "joint.hip.position": "rad", "joint.knee.position": "rad", "site.foot_tip.x": "m", "site.foot_tip.z": "m",
    "actuator.knee_winch.position": "m", "tendon.flexor.length": "m",
}  # fmt: skip
CALIBRATED = {
    "joint.hip.damping": 0.0234567890123, "body.shank.mass": 0.0612345, "site.guide.pos_3": 0.01423456, "body.shank.pos_1": 0.1001,
    "actuator.hip_servo.kp": 12.345, "joint.knee.stiffness": 0.2601,
}  # fmt: skip
# Of each effect of the family values that move the leg by degrees; second laws of some as well.
EFFECTS: dict[str, tuple[str, Mapping[str, float]]] = {
    "actuator_gain": ("actuator_gain", {"gain_1": 0.9, "gain_2": 1.1}),
    "actuator_lag": ("actuator_lag", {"time": 0.03}),
    "actuator_saturation": ("actuator_saturation", {"limit_1": 0.2, "limit_2": 1.0}),
    "actuator_lag, second order": ("actuator_lag", {"time": 0.03, "inertia": 0.4}),
    "base_tilt": ("base_tilt", {"about_y": 0.4}),
    "camera_misalignment": ("camera_misalignment", {"turn_x": 0.1, "shift_z": 0.01}),
    "drive_zero": ("drive_zero", {"zero_1": 0.05, "zero_2": 1e-3}),
    "encoder_offset": ("encoder_offset", {"offset_hip": 0.03}),
    "joint_friction": ("joint_friction", {"torque_hip": 0.05, "torque_knee": 0.01}),
    "joint_friction, all its law": ("joint_friction", {"torque_hip": 0.05, "breakaway": 0.5, "viscous": 0.3}),
    "joint_stiffness": ("joint_stiffness", {"stiffness_hip": 0.3, "preload_hip": -0.1, "preload_knee": 0.05}),
    "joint_stop": ("joint_stop", {"upper_hip": 0.1, "lower_knee": 0.2}),
    "joint_stop, all its law": ("joint_stop", {"upper_hip": 0.1, "lower_knee": 0.2, "give": 0.05}),
    "load_dependent_friction": ("load_dependent_friction", {"share": 0.1}),
    "reflected_inertia": ("reflected_inertia", {"inertia_hip": 0.003}),
    "sensor_drift": ("sensor_drift", {"angle_hip": 0.01, "position_2": 1e-3, "levelling": 0.02}),
    "tendon_backlash": ("tendon_backlash", {"play_1": 0.05, "play_2": 1e-3}),
    "tendon_elasticity": ("tendon_elasticity", {"stretch_flexor": 5e-5}),
    "tendon_friction": ("tendon_friction", {"mu_flexor": 0.2}),
    "tendon_routing": ("tendon_routing", {"out_flexor": 2e-3}),
    "time_delay": ("time_delay", {"delay": 0.0155}),
    "tip_payload": ("tip_payload", {"mass": 0.02}),
}
OF_OTHER_ROBOTS = {
    "sma_cooling",
    "sma_hysteresis",
}  # ask for no feature; see a diagnosis' log


def leg_with(case: str | None, values: Mapping[str, float] = CALIBRATED) -> Twin:
    leg = load("tendon_leg")
    effects = (effect_class(EFFECTS[case][0])(EFFECTS[case][1], leg.n_tendon),) if case else ()
    return Twin(leg, values, effects)


def in_steps_of(step: float, twin: Twin) -> Twin:
    return replace(twin, robot=replace(twin.robot, structure={**twin.robot.structure, "timestep": step}))


def trial_of(time: np.ndarray, commands: np.ndarray) -> Recording:
    inputs = (
        Channel("hip", "input", "rad", quantity="actuator.hip_servo.ctrl"),
        Channel("knee", "input", "m", quantity="actuator.knee_winch.ctrl"),
    )
    outputs = tuple(Channel(f"o{i}", "output", unit, 1e-4, name) for i, (name, unit) in enumerate(OUTPUTS.items()))
    values = {"hip": commands[:, 0], "knee": commands[:, 1], **{c.name: np.full(len(time), np.nan) for c in outputs}}
    trials = (Trial("a.csv", time, values, {"settle": SETTLE}, start=0.0),)
    return Recording("tendon_leg", "made", "simulation", None, (*inputs, *outputs), trials)


def predicted(twin: Twin) -> np.ndarray:
    """The twin's own prediction, (n, n_output)."""
    values = twin.predict(trial_of(TIME, COMMANDS)).trials[0].values
    return np.stack([values[f"o{i}"] for i in range(len(OUTPUTS))], axis=1)


def stepped(path: Path) -> np.ndarray:
    """The exported model stepped along the same commands, straight between rows."""
    stepper, rows = ModelStepper(path), []
    stepper.reset(COMMANDS[0], SETTLE)
    each = round(STEP / stepper.step_length)
    fine = np.arange(each * (len(TIME) - 1) + 1) * STEP / each
    for k, command in enumerate(np.stack([np.interp(fine, TIME, u) for u in COMMANDS.T], axis=1)):
        if k % each == 0:
            seen = stepper.readings()
            rows.append([seen[name] for name in OUTPUTS])
        stepper.step(command)
    return np.array(rows)


def in_plain_mujoco(path: Path) -> np.ndarray:
    """The same by `mj_step` alone; joints and tip only."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, step = mujoco.MjData(model), model.opt.timestep
    for k in range(model.nu):
        if model.actuator_delay[k] > 0.0:
            mujoco.mj_initCtrlHistory(model, data, k, None, np.full(int(model.actuator_history[k, 0]), COMMANDS[0, k]))
        if model.actuator_actnum[k]:
            data.act[model.actuator_actadr[k]] = COMMANDS[0, k]
    data.ctrl[:] = COMMANDS[0]
    mujoco.mj_step(model, data, round(SETTLE / step))
    rows = []
    fine = np.arange(0.0, TIME[-1] + 0.5 * step, step)
    for k, command in enumerate(np.stack([np.interp(fine, TIME, u) for u in COMMANDS.T], axis=1)):
        if k % round(STEP / step) == 0:
            rows.append([*data.qpos, *data.site("foot_tip").xpos[[0, 2]]])
        data.ctrl[:] = command
        mujoco.mj_step(model, data)
    return np.array(rows)


def test_every_effect_of_the_family_is_tried_here() -> None:
    leg = load("tendon_leg").build()
    of_family = {name for name, effect in catalogue().items() if effect.needs <= leg.features}
    assert of_family - OF_OTHER_ROBOTS == {effect for effect, _ in EFFECTS.values()}


@pytest.mark.parametrize("case", [None, *EFFECTS])
def test_stepped_with_its_laws_an_exported_model_is_the_twin(case: str | None, tmp_path: Path) -> None:
    twin = leg_with(case)
    wanted = predicted(twin)
    found = stepped(write_mjcf(twin, tmp_path / "out", Origins()))
    # m and rad: 1e-9 of the motion; numbers are written to the last digit, and only the order of sums differs. The drum of an
    # elastic tendon is read under the force of the step before: by some um, of 3.3 mm.
    off = np.abs(found - wanted).max(axis=0)
    assert off[4] < (2e-5 if case == "tendon_elasticity" else 1e-9 * np.ptp(wanted[:, 2]))
    assert np.delete(off, 4).max() < 1e-9 * np.ptp(wanted[:, 2])
    if case is not None:  # and it moves otherwise than without the effect
        assert np.abs(wanted - predicted(leg_with(None))).max() > 1e-4


# What MuJoCo's own attributes say exactly, and the first order of a lag. rad: at a quarter of a millisecond its steps of first
# order, and controls that are held from step to step, are some 2e-4 off; the effects move the leg by 7e-3 to 0.08.
@pytest.mark.parametrize(
    "case",
    [None, "actuator_gain", "actuator_lag", "base_tilt", "drive_zero", "joint_stiffness", "reflected_inertia", "time_delay",
     "tip_payload"],
)  # fmt: skip
def test_what_mujoco_can_say_it_does_alone(case: str | None, tmp_path: Path) -> None:
    twin = leg_with(case)
    wanted = predicted(in_steps_of(5e-4, twin))
    found = in_plain_mujoco(write_mjcf(in_steps_of(2.5e-4, twin), tmp_path, Origins()))
    assert np.abs(found - wanted[:, :4]).max() < 1e-3
    if case is not None:
        without = in_plain_mujoco(write_mjcf(in_steps_of(2.5e-4, leg_with(None)), tmp_path / "without", Origins()))
        assert np.abs(found - without).max() > 3e-3


def test_friction_is_the_nearest_that_mujoco_has(tmp_path: Path) -> None:
    """Without pre-sliding: the leg is three times closer to the twin with it than without."""
    twin = leg_with("joint_friction")
    wanted = predicted(twin)[:, :2]
    near = in_plain_mujoco(write_mjcf(twin, tmp_path / "a", Origins()))[:, :2]
    without = in_plain_mujoco(write_mjcf(leg_with(None), tmp_path / "b", Origins()))[:, :2]
    assert 3 * np.abs(near - wanted).max() < np.abs(without - wanted).max()


def test_each_change_is_said_before_its_element(tmp_path: Path) -> None:
    twin = leg_with("tendon_friction", {"joint.hip.damping": 0.0235, "site.guide.pos_3": 0.01423})
    said = Origins({"joint.hip.damping": 0.0012, "tendon_friction.mu_flexor": 0.014}, {"tendon_friction": "probability 0.98"})
    lines = [line.strip() for line in export_mjcf(twin, said).text.splitlines()]

    def before(element: str) -> str:
        at = next(i for i, line in enumerate(lines) if line.startswith(element))
        return lines[at - 1]

    assert before('<joint name="hip"') == "<!-- calibrated: damping = 0.0235 +- 0.0012 N*m*s/rad, described 0.02 -->"
    assert before('<site name="guide"') == "<!-- calibrated: pos[3] = 0.01423 m, described 0.014 -->"
    assert before('<spatial name="flexor"') == "<!-- tendon_friction: mu_flexor = 0.2 +- 0.014, probability 0.98 -->"
    assert before('<site name="anchor"').startswith("</joint") is False
    assert any(line == '<numeric name="twin.tendon_friction.mu_flexor" size="1" data="0.2"/>' for line in lines)
    assert lines[0] == '<mujoco model="tendon_leg">'
    assert lines[1].startswith("<!-- Twin of tendon_leg:")


PARTS = """<mujocoinclude><body name="arm" pos="0 0 1"><frame pos="0 0 .2" euler="0 0 90">
  <joint name="turn" axis="0 1 0" range="-90 90"/><geom type="mesh" mesh="wedge" density="100"/><site name="tip" pos="0.1 0 1"/>
  <body pos="0 .1 0"><joint axis="1 0 0"/><geom size=".05"/></body></frame></body></mujocoinclude>"""
SPREAD = """<mujoco><compiler angle="degree" meshdir="sub/meshes"/>
  <asset><mesh name="wedge" file="a.obj"/><mesh name="other" file="more/a.obj"/></asset>
  <worldbody><include file="sub/part.xml"/><geom type="mesh" mesh="other" contype="0"/></worldbody>
  <actuator><motor name="m" joint="turn"/></actuator></mujoco>"""
WEDGE = "v 0 0 0\nv {a} 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def spread(folder: Path) -> Robot:
    """A robot in several files, with masses that MuJoCo works out from meshes."""
    for name, a in (("a.obj", 0.1), ("more/a.obj", 0.2)):
        path = folder / "sub/meshes" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(WEDGE.format(a=a))
    (folder / "sub/part.xml").write_text(PARTS)
    parameters = '[parameters]\n"body.*.mass" = { relative_std = 0.1, source = "made" }\n'
    parameters += '"site.tip.pos" = { std = 1, unit = "mm", source = "made" }\n'
    parameters += '"joint.*.damping" = { value = 0.1, std = 0.1, source = "made" }'
    return robot(folder, SPREAD, parameters)


def test_a_model_in_several_files_comes_out_in_one_folder(tmp_path: Path) -> None:
    """Includes, nested frames, meshes of the same name in two folders, degrees, inertias from geoms, joints without a name."""
    made = spread(tmp_path / "there")
    values = {"body.arm.mass": 0.0223456789, "site.tip.pos_1": 0.00123, "joint.joint_2.damping": 0.2}
    path = write_mjcf(Twin(made, values), tmp_path / "here/better", Origins())
    assert sorted(p.relative_to(path.parent).as_posix() for p in path.parent.rglob("*.*")) == [
        "assets/a.obj", "assets/a_2.obj", "robot.xml",
    ]  # fmt: skip
    (tmp_path / "there").rename(tmp_path / "gone")  # nothing points back
    model = mujoco.MjModel.from_xml_path(str(path))
    wanted = made_model(tmp_path / "gone", values)
    for name in ("body_mass", "body_inertia", "body_ipos", "site_pos", "jnt_range", "dof_damping", "mesh_vert"):
        np.testing.assert_allclose(getattr(model, name), getattr(wanted, name), rtol=1e-10, atol=1e-14, err_msg=name)
    assert model.joint("joint_2").damping[0] == 0.2


def made_model(folder: Path, values: Mapping[str, float]) -> mujoco.MjModel:
    return load(str(folder)).build(values).model  # type: ignore[attr-defined]


def test_a_log_that_runs_ahead_is_said_and_not_written() -> None:
    leg = load("tendon_leg")
    made = export_mjcf(Twin(leg, {}, (effect_class("time_delay")({"delay": -0.01}, leg.n_tendon),)), Origins())
    assert "time_delay: delay = -0.01 s: not written" in made.text
    assert "twin.time_delay" not in made.text
    assert made.compile().actuator_delay.tolist() == [0.0, 0.0]


def test_an_export_can_be_a_robot_and_be_exported_again(tmp_path: Path) -> None:
    """Its numbers are the new description; the laws beside them are replaced by those of the new twin."""
    first = write_mjcf(leg_with("joint_stiffness"), tmp_path / "first", Origins())
    again = robot(tmp_path / "again", first.read_text())
    second = write_mjcf(Twin(again, {"joint.hip.damping": 0.03}), tmp_path / "second", Origins())
    old, new = (mujoco.MjModel.from_xml_path(str(p)) for p in (first, second))
    assert new.jnt_stiffness.tolist() == old.jnt_stiffness.tolist()
    assert new.dof_damping.tolist() == [0.03, old.dof_damping[1]]


def test_a_file_with_laws_that_are_not_known_is_refused(tmp_path: Path) -> None:
    path = write_mjcf(leg_with("joint_friction"), tmp_path, Origins())
    path.write_text(path.read_text().replace("twin.joint_friction.stribeck", "twin.joint_frictoin.stribeck"))
    with pytest.raises(DataError, match=r"robot.xml': .*joint_frictoin.*; export it again"):
        ModelStepper(path)
    with pytest.raises(DataError, match=r"none.xml"):
        ModelStepper(tmp_path / "none.xml")


def test_a_motion_that_diverges_is_said(tmp_path: Path) -> None:
    rod = robot(tmp_path / "rod", PENDULUM.format(joint="", key=""))
    stepper = ModelStepper(write_mjcf(Twin(rod), tmp_path / "out", Origins()))
    stepper.reset(np.zeros(1), 0.0)
    with pytest.raises(TwinError, match="diverges"):  # noqa: PT012
        for _ in range(3):
            stepper.step(np.array([1e9]))


def test_standard_errors_and_probabilities_come_from_a_reports_files(tmp_path: Path) -> None:
    (tmp_path / "twin.toml").write_text(
        'format = "twin/1"\nrobot = "tendon_leg"\n[parameters]\n'
        '"joint.hip.damping" = { value = 0.03, std = 0.002, unit = "N*m*s/rad" }\n'
        '[[effect]]\nid = "tip_payload"\nparameters = { mass = { value = 0.01, std = 0.001, unit = "kg" } }\n'
    )
    (tmp_path / "report.json").write_text('{"effects": [{"id": "tip_payload", "probability": 0.9876}]}')
    found = origins_of(tmp_path)
    assert found.std == {"joint.hip.damping": 0.002, "tip_payload.mass": 0.001}
    assert found.said == {"tip_payload": "probability 0.988"}
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(DataError, match="not a report's file"):
        origins_of(tmp_path)
