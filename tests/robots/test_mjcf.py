"""Family "mjcf": its files, numbers and channels, what it refuses, and a day of a servo by equations of its own."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.command_line import twin
from tests.mechanics.mjcf.models import CAPSTAN, PENDULUM, robot
from tests.servo import ARM, UNCERTAIN, day
from twin.body import Counts, Drive
from twin.diagnosis import Settings, diagnose
from twin.foundation.errors import DataError, TwinError
from twin.measurements import Channel, Recording, Trial, read, write
from twin.mechanics.mjcf import ModelBody
from twin.prediction.evaluate import evaluate
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin
from twin.robots import Robot, load

PLAIN = PENDULUM.format(joint=' damping="0.02"', key="")
FREE = """
<mujoco>
  <worldbody>
    <body name="ball"><freejoint name="loose"/><geom size="0.1"/></body>
    <body><joint name="a"/><geom size="0.1"/></body>
  </worldbody>
  <actuator><motor joint="a"/></actuator>
</mujoco>"""


def model_of(made: Robot, values: dict[str, float] | None = None) -> ModelBody:
    body = made.build(values or {})
    assert isinstance(body, ModelBody)
    return body


def test_numbers_are_written_into_the_compiled_model() -> None:
    leg = load("tendon_leg")
    body = model_of(
        leg, {"body.shank.mass": 0.062, "site.guide.pos_3": 0.015, "actuator.knee_winch.kp": 4500.0, "joint.knee.damping": 0.01}
    )
    model = body.model
    assert model.body("shank").mass[0] == 0.062
    assert model.site("guide").pos == pytest.approx([0.09, 0.0, 0.015])
    winch = model.actuator("knee_winch")
    # force = kp (length at rest - pulled in - length): all three numbers go by one factor
    assert (winch.gainprm[0], winch.biasprm[1]) == (-4500.0, -4500.0)
    assert winch.biasprm[0] == pytest.approx(480.89799432 * 4500.0 / 4000.0)
    assert model.dof_damping[1] == 0.01
    assert model_of(leg).model.body("shank").mass[0] == 0.06  # others are not touched


def test_an_inertia_is_one_factor_on_all_components(tmp_path: Path) -> None:
    text = PLAIN.replace("1e-9 1e-9 1e-9", "1e-4 2e-4 2.5e-4")
    made = robot(tmp_path, text, '[parameters]\n"body.rod.inertia" = { relative_std = 0.1, source = "made" }')
    assert made.value("body.rod.inertia") == 2.5e-4
    assert model_of(made, {"body.rod.inertia": 2.75e-4}).model.body_inertia[1] == pytest.approx(
        [1.1e-4, 2.2e-4, 2.75e-4], rel=1e-12
    )


def test_wildcards_name_each_and_exact_names_go_first(tmp_path: Path) -> None:
    both = """[parameters]
"joint.*.damping" = { relative_std = 0.3, source = "made" }
"joint.hinge.damping" = { value = 30, unit = "N*mm*s/rad", std = 2, source = "measured" }
"""
    (number,) = robot(tmp_path, PLAIN, both).parameters
    assert (number.name, number.value, number.std, number.source) == ("joint.hinge.damping", 0.03, pytest.approx(2e-3), "measured")
    names = {p.name for p in load("tendon_leg").parameters}
    assert {"joint.hip.damping", "joint.knee.damping", "body.thigh.mass", "body.shank.pos_1", "site.anchor.pos_3"} <= names
    assert "site.anchor.pos_2" not in names  # a std of 0 is exact


def test_without_parameters_usual_widths_are_taken_and_said(tmp_path: Path) -> None:
    made = robot(tmp_path, PLAIN)
    assert {p.name: round((p.std or 0.0) / p.value, 6) for p in made.parameters} == {
        "body.rod.mass": 0.03, "body.rod.inertia": 0.05, "joint.hinge.damping": 0.3, "actuator.push.kp": 0.05,
    }  # fmt: skip
    assert "no [parameters]" in made.notices[0]


def test_gravity_is_the_models_unless_written() -> None:
    assert load("tendon_leg").gravity.tolist() == [9.81, 0.0, 0.0]


SHARE = '{ relative_std = 0.1, source = "x" }'
STILL = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
REFUSED = {
    "no file": (None, "", r"model .*model.xml.*: no such file"),
    "broken": ("<mujoco><worldbody></mujoco>", "", r"model 'model.xml' does not load in MuJoCo .*; correct it"),
    "no actuator": (STILL, "", r"no actuator.*add an <actuator>"),
    "free": (FREE, "", r"joint 'loose' leaves a body free and no keyframe .*; add a <keyframe>"),
    "no such kind": (PLAIN, f'"joints.hinge.damping" = {SHARE}', r"no address; write KIND.NAME.ATTRIBUTE.*'joint'"),
    "no such name": (PLAIN, f'"joint.hing.damping" = {SHARE}', r"no joint 'hing'; it has hinge; did you mean 'hinge'"),
    "no such attribute": (PLAIN, f'"joint.hinge.dampin" = {SHARE}', r"a joint has stiffness, .*did you mean 'damping'"),
    "share of nothing": (PLAIN, f'"joint.hinge.stiffness" = {SHARE}', r"relative_std of a number that is 0"),
    "two spreads": (PLAIN, '"joint.hinge.damping" = { relative_std = 0.1, std = 1, source = "x" }', r"give one of them"),
    "wrong unit": (PLAIN, '"joint.hinge.damping" = { value = 1, unit = "kg", source = "x" }', r"'kg' has the wrong dimension"),
    "wrong length": (PLAIN, '"site.tip.pos" = { std = [1, 2], unit = "mm", source = "x" }', r"std has 2 numbers; 3 are needed"),
    "no source": (PLAIN, '"joint.hinge.damping" = { relative_std = 0.1, source = " " }', r"source is empty"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_in_order_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    text, parameters, said = REFUSED[case]

    def made() -> None:
        found = robot(tmp_path, text or PLAIN, f"[parameters]\n{parameters}" if parameters else "")
        if text is None:  # gone after it was read
            (tmp_path / "model.xml").unlink()
            found.build()

    with pytest.raises(TwinError, match=said) as caught:
        made()
    assert "\n" not in str(caught.value)


def test_a_model_outside_its_folder_is_refused(tmp_path: Path) -> None:
    robot(tmp_path, PLAIN)
    text = (tmp_path / "robot.toml").read_text().replace('"model.xml"', '"../model.xml"')
    (tmp_path / "robot.toml").write_text(text)
    with pytest.raises(DataError, match="leads out of the robot's folder"):
        load(str(tmp_path))


def trial(name: str, n: int = 51, **conditions: float) -> Trial:
    time = 0.02 * np.arange(n)
    values = {"cmd": 0.2 * np.sin(3.0 * time), "q": np.zeros(n), "x": np.zeros(n)}
    return Trial(name, time, values, {"payload.tip": 0.02, **conditions}, start=0.0)


CHANNELS = (
    Channel("cmd", "input", "N*m", quantity="actuator.push.ctrl"),
    Channel("q", "output", "deg", 1e-3, "joint.hinge.position", 0.5, 90.0),
    Channel("x", "output", "mm", 1e-3, "site.tip.x"),
)


def test_columns_of_any_name_say_what_they_are(tmp_path: Path) -> None:
    """Written and read again: quantity, scale and offset, payloads at sites."""
    made = robot(tmp_path / "rod", PLAIN)
    days = Recording(str(made.folder), "made", "simulation", None, CHANNELS, (trial("a.csv"), trial("b.csv", settle=0.0)))
    write(days, tmp_path / "set")
    again = read(tmp_path / "set")
    assert again.channels == days.channels
    assert again.trials[0].conditions == {"payload.tip": 0.02}
    text = (tmp_path / "set/a.csv").read_text().splitlines()
    # half a reading and 90 deg are 0 rad
    assert float(text[1].split(",")[2]) == pytest.approx(-180.0)
    ready = prepare(again, made)
    assert [(o.group, o.index, o.axis) for o in ready.outputs] == [("joint angle", 0, 0), ("marker", 0, 0)]
    assert ready.drives == (Drive.CONTROL,)
    assert ready.inputs[0].loads.payloads == (("tip", 0.02),)
    assert [i.start.settle for i in ready.inputs] == [2.0, 0.0]
    assert evaluate(Twin.of(made), again)["by_kind"]["joint_angle"]["unit"] == "deg"


def test_a_channel_of_the_wrong_kind_and_a_payload_nowhere_are_refused(tmp_path: Path) -> None:
    made = robot(tmp_path, PLAIN)
    odd = (CHANNELS[0], Channel("q", "output", "mm", 1e-3, "joint.hinge.position"), CHANNELS[2])
    with pytest.raises(DataError, match=r"output q is in mm; joint.hinge.position has the dimension of rad"):
        prepare(Recording(str(tmp_path), "made", "simulation", None, odd, (trial("a.csv"),)), made)
    lost = Recording(str(tmp_path), "made", "simulation", None, CHANNELS, (trial("a.csv", **{"payload.tipp": 0.1}),))
    with pytest.raises(DataError, match=r"payload at 'tipp': no such site or body"):
        prepare(lost, made)


def test_its_counts_name_joints_and_tendons(tmp_path: Path) -> None:
    n = robot(tmp_path, CAPSTAN).n_tendon
    assert isinstance(n, Counts)
    assert (n, n.joints, n.tendons) == (1, ("slide",), ("cord",))


def test_friction_of_an_independent_servo_is_named_with_its_size(tmp_path: Path) -> None:
    robot(tmp_path, ARM, UNCERTAIN)
    found = diagnose(day(tmp_path, 0.1), settings=Settings(jobs=1))
    assert [c.effect for c in found.claims] == ["joint_friction"]
    law = next(e for e in found.twin.effects if e.id == "joint_friction")
    assert law["torque_hinge"] == pytest.approx(0.1, rel=0.1)
    found.twin.save(tmp_path / "twin.toml")
    assert read_twin(tmp_path / "twin.toml").effects == found.twin.effects  # names of joints survive the file
    # The report has the twin as an MJCF; the command writes the same from the report.
    found.save(tmp_path / "report")
    text = (tmp_path / "report/robot.xml").read_text()
    number = next(line for line in text.splitlines() if "joint_friction: torque_hinge" in line)
    assert re.fullmatch(r" *<!-- joint_friction: torque_hinge = 0\.\d+ \+- 0\.\d+ N\*m, probability [01]\.?\d* -->", number)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "report/robot.xml"))
    assert model.joint("hinge").frictionloss[0] == law["torque_hinge"]
    done = twin("export", "report", "--mjcf", "better", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "better/robot.xml").read_text() == text


def test_export_says_what_it_needs(tmp_path: Path) -> None:
    for arguments, said in (
        (("tendon_leg",), "nothing to write; give a format with its target: --mcap FILE"),
        (("finger", "--mjcf", "better"), "robot 'finger' is of family 'soft'"),
        (("nowhere", "--mjcf", "better"), "nowhere"),
    ):
        done = twin("export", *arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert said in done.stderr
        assert list(tmp_path.iterdir()) == []


def test_a_stop_of_an_independent_servo_is_named_with_its_place(tmp_path: Path) -> None:
    robot(tmp_path, ARM, UNCERTAIN)
    found = diagnose(day(tmp_path, 0.0, stop=0.5), settings=Settings(jobs=1))
    assert [c.effect for c in found.claims] == ["joint_stop"]
    # rad: the encoder's noise is 1e-3 and the stop is met in six trials; a soft stop gives by as much
    assert found.claims[0].parameters["upper_hinge"].value == pytest.approx(0.5, abs=2e-3)


def test_a_servo_without_a_fault_is_noise(tmp_path: Path) -> None:
    robot(tmp_path, ARM, UNCERTAIN)
    found = diagnose(day(tmp_path, 0.0), settings=Settings(jobs=1))
    assert (found.verdict, found.claims) == ("noise", ())
