"""Any MJCF is taken or refused in one sentence, and the benchmark that counts them tells these from a fault of ours."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.mechanics.mjcf.models import PENDULUM, robot
from tools.benchmarks.solvers import any_mjcf
from tools.benchmarks.solvers.any_mjcf import attempt, models, summary
from twin.mechanics.mjcf import load_model
from twin.robots import load
from twin.robots.starter import write_model_starter

HINGED = '<worldbody>{more}<body name="a"><joint name="j" axis="0 1 0"/><geom size="0.05 0.3" type="capsule"/></body></worldbody>'
MOTOR = '<actuator><motor name="m" joint="j" ctrlrange="-1 1"/></actuator>'
MUSCLE = '<actuator><muscle name="m" joint="j" lengthrange="-1 1"/></actuator>'
STIFF = '<option timestep="0.0002"/>'


def text(before: str = "", more: str = "", actuators: str = MOTOR) -> str:
    return f"<mujoco>{before}{HINGED.format(more=more)}{actuators}</mujoco>"


FLOOR = '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -0.34"/>'
CLOTH = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="0 0 1" radius=".01"/>'
PID = '<extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="1"/></instance></plugin></extension>'
CUP = '<body name="ball" pos="1 0 1"><freejoint name="loose"/><geom size="0.1"/></body>'
TAKEN = {
    "touching": text(more=FLOOR), "muscle": text(actuators=MUSCLE), "unnamed": text().replace(' name="j"', "").replace(
        'joint="j"', 'site="s"').replace("<geom size", '<site name="s"/><geom size'),
    "ball": text(more='<body pos="1 0 0"><joint type="ball"/><geom size="0.1"/></body>'),
    "free with a pose": text('<keyframe><key qpos="0 1 0 1 1 0 0 0"/></keyframe>', more="").replace(
        "</worldbody>", CUP + "</worldbody>"),
}  # fmt: skip
REFUSED = {
    "fragment": ("<mujoco><default/></mujoco>", "no actuator"),
    "flex": (text(more=CLOTH), r"deformable bodies \(flex\)|free"),
    "free": (text(more=CUP), "joint 'loose' leaves a body free"),
    "plugin": (text(PID, actuators='<actuator><plugin joint="j" plugin="mujoco.pid" instance="pid"/></actuator>'), "has plugins"),
    "mesh": (text('<asset><mesh name="x" file="lost.obj"/></asset>'), "lost.obj"),
    "odd": ("<mujoco><worldbody><bodie/></worldbody></mujoco>", "unrecognized element"),
    "diverging": (text(actuators='<actuator><position name="m" joint="j" kp="-1e9" ctrlrange="-1 1"/></actuator>'), "diverges"),
}


@pytest.mark.parametrize("case", TAKEN)
def test_what_moves_is_taken(case: str, tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(TAKEN[case])
    outcome = attempt(tmp_path / "model.xml")
    assert (outcome.what, outcome.said) == ("taken", "")


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    content, said = REFUSED[case]
    (tmp_path / "model.xml").write_text(content)
    outcome = attempt(tmp_path / "model.xml")
    assert outcome.what == "refused", outcome.said
    assert re.search(said, outcome.said)
    assert "\n" not in outcome.said


def test_a_fault_of_ours_is_no_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise KeyError("lost")

    (tmp_path / "a.xml").write_text(text())
    (tmp_path / "b.xml").write_text(text())  # the same once more: counted once
    (tmp_path / "c.xml").write_text("<other/>")  # no MJCF
    monkeypatch.setattr(any_mjcf, "move", broken)
    (path,) = models([tmp_path])
    outcome = attempt(path)
    assert (outcome.what, outcome.said) == ("fault", "KeyError: 'lost'")
    assert "| 1 | fault: KeyError: 'lost' |".replace("KeyError: 'lost'", outcome.kind) in summary([outcome])
    assert any_mjcf.main([str(tmp_path)]) == 1


def test_contacts_as_a_trial_begins_are_said(tmp_path: Path) -> None:
    touching = robot(tmp_path / "touching", TAKEN["touching"])
    assert any("begins with 1 contacts" in n and "nothing is fitted through them" in n for n in touching.notices)
    assert not any("contacts" in n for n in robot(tmp_path / "free", text()).notices)


def test_a_muscle_has_no_kp_and_its_gain_scales_its_force(tmp_path: Path) -> None:
    made = robot(tmp_path, TAKEN["muscle"])
    assert not [p.name for p in made.parameters if p.name.startswith("actuator.")]
    body = made.build()
    before = body.model.actuator_gainprm[0].copy()  # type: ignore[attr-defined]
    body.scale_actuators(np.array([1.25]))
    after = body.model.actuator_gainprm[0]  # type: ignore[attr-defined]
    assert after[2] == 1.25 * before[2]  # peak force; below zero: taken from the scale beside it
    assert after[3] == 1.25 * before[3]
    assert (after[:2] == before[:2]).all()  # its range of lengths


def test_a_model_that_needs_short_steps_gets_its_own(tmp_path: Path) -> None:
    """A spring of 1e6 N m/rad on 0.02 kg m^2 turns 14 rad of its period in a step of 2 ms, which diverges, and 0.14 in 0.02 ms."""
    stiff = PENDULUM.format(joint="", key="").replace(
        '<option timestep="0.001" integrator="implicitfast"/>',
        '<option timestep="{step}" integrator="implicitfast" gravity="1 0 -9.81"/>',
    )
    stiff = stiff.replace(
        '<motor name="push" joint="hinge"/>', '<general name="push" joint="hinge" biastype="affine" biasprm="{k}"/>'
    )
    for k, step, written in (("1e5 -1e6 0", 2e-5, True), ("0.1 -1 0", 2e-5, False)):
        place = tmp_path / k.replace(" ", "_")
        place.mkdir()
        (place / "model.xml").write_text(stiff.format(step=step, k=k))
        folder, _ = write_model_starter("leg", place / "model.xml", place)
        assert (load(str(folder)).structure.get("timestep") == step) is written


def test_sizes_that_a_geom_does_not_have_are_not_compared(tmp_path: Path) -> None:
    """A sphere given three sizes is written with one."""
    content = text(more='<geom type="sphere" size="0.05 0.05 0.05" pos="1 0 0"/>')
    (tmp_path / "model.xml").write_text(content)
    assert load_model(tmp_path / "model.xml").model.geom_size[0].tolist() == [0.05, 0.05, 0.05]
    assert attempt(tmp_path / "model.xml").what == "taken"


@pytest.mark.parametrize("package", [Path(mujoco.__file__).parent / "testdata"])
def test_models_of_mujocos_own_package_meet_no_fault(package: Path) -> None:
    assert [o.said for o in map(attempt, models([package])) if o.what == "fault"] == []
