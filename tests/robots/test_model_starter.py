"""`twin new NAME --mjcf MODEL`: a folder that loads, is rolled out, simulated and diagnosed as it is written."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from tests.command_line import twin
from twin.measurements import read, write
from twin.report.robot_page import draw_robot
from twin.robots import load
from twin.robots.starter import FIRST_SET, write_model_starter

ARM = """
<mujoco>
  <compiler meshdir="shapes"/>
  <include file="parts/limits.xml"/>
  <asset><mesh name="block" file="block.obj"/></asset>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.05" armature="0.004"/>
      <geom name="arm" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.4"/>
      <body name="lower" pos="0 0 -0.2">
        <joint name="elbow" axis="0 1 0" damping="0.02" stiffness="0.3"/>
        <geom name="hand" type="mesh" mesh="block" mass="0.1"/>
        <site name="finger_tip" pos="0 0 -0.15"/>
      </body>
      <body name="plate"><geom name="shell" size="0.01" mass="0.01"/></body>
    </body>
    <site name="winch" pos="0.03 0 0.05"/>
  </worldbody>
  <tendon><spatial name="cord"><site site="winch"/><site site="finger_tip"/></spatial></tendon>
  <actuator>
    <position name="servo" joint="shoulder" kp="20" kv="1" ctrlrange="-0.6 0.6"/>
    <motor name="pull" tendon="cord" gear="-1" ctrlrange="0 1.5"/>
  </actuator>
</mujoco>"""
LIMITS = '<mujocoinclude><default><geom contype="0" conaffinity="0"/></default></mujocoinclude>'
BLOCK = "v -.01 -.01 0\nv .01 -.01 0\nv 0 .02 0\nv 0 0 -.15\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def arm(folder: Path, text: str = ARM) -> Path:
    """Writes the model, what it includes and its mesh; returns the model's place."""
    for name, content in {"arm.xml": text, "parts/limits.xml": LIMITS, "shapes/block.obj": BLOCK}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    return folder / "arm.xml"


def test_the_model_goes_along_with_what_it_includes_and_needs(tmp_path: Path) -> None:
    folder, widths = write_model_starter("arm", arm(tmp_path / "own"), tmp_path)
    assert (folder / "arm.xml").read_text() == ARM  # as it stands
    assert (folder / "parts/limits.xml").read_text() == LIMITS
    assert (folder / "shapes/block.obj").read_text() == BLOCK
    assert "damping of joints 30%" in widths
    robot = load(str(folder))
    assert robot.notices == ()  # its widths are written, not assumed in silence
    assert {p.name: round((p.std or 0.0) / p.value, 6) for p in robot.parameters} == {
        "body.upper.mass": 0.03, "body.lower.mass": 0.03, "body.plate.mass": 0.03,
        "body.upper.inertia": 0.05, "body.lower.inertia": 0.05, "body.plate.inertia": 0.05,
        "joint.shoulder.damping": 0.3, "joint.elbow.damping": 0.3, "joint.shoulder.armature": 0.3, "joint.elbow.stiffness": 0.1,
        "actuator.servo.kp": 0.05, "actuator.pull.kp": 0.05, "actuator.servo.kv": 0.3,
    }  # fmt: skip
    table = tomllib.loads((folder / "robot.toml").read_text())
    assert "joint.*.damping" in table["parameters"]  # all of a kind by one entry
    assert "joint.shoulder.armature" in table["parameters"]  # the elbow's is 0, of which a share says nothing
    assert all(entry["source"].startswith("assumed: ") for entry in table["parameters"].values())
    assert table["accuracy"]["value"] == pytest.approx(0.35)  # mm: a thousandth of 0.2 + 0.15 m
    channels = tomllib.loads((folder / FIRST_SET / "measurements.toml").read_text())["channel"]
    assert [(c["name"], c["role"], c["unit"]) for c in channels] == [
        ("actuator.servo.ctrl", "input", "rad"), ("actuator.pull.ctrl", "input", "N"),
        ("joint.shoulder.position", "output", "deg"), ("joint.elbow.position", "output", "deg"),
    ]  # fmt: skip
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arm", "own"]


def test_a_model_that_reaches_out_of_its_folder_is_gathered(tmp_path: Path) -> None:
    arm(tmp_path)
    inner = tmp_path / "inner"
    inner.mkdir()
    text = ARM.replace('"shapes"', '"../shapes"').replace('"parts/', '"../parts/')
    (inner / "arm.xml").write_text(text)
    folder, _ = write_model_starter("arm", inner / "arm.xml", tmp_path)
    for outside in ("shapes/block.obj", "parts/limits.xml", "inner/arm.xml"):
        (tmp_path / outside).unlink()  # nothing of the folder leans on them
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    assert model.body("lower").mass[0] == pytest.approx(0.1)
    assert model.geom("hand").contype[0] == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), r"arm: what it is made from is missing or told twice; give --family FAMILY or --mjcf MODEL.xml"),
        (("--mjcf", "own/arm.xml", "--family", "soft"), "missing or told twice"),
        (("--mjcf", "own/lost.xml"), "no such file"),
        (("--mjcf", "own/still.xml"), "no actuator"),
    ],
)
def test_what_cannot_be_made_leaves_nothing(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    arm(tmp_path / "own")
    (tmp_path / "own/still.xml").write_text("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    done = twin("new", "arm", *arguments, cwd=tmp_path)
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["own"]


def test_the_folder_is_rolled_out_simulated_and_diagnosed_as_written(tmp_path: Path) -> None:
    arm(tmp_path / "own")
    done = twin("new", "arm", "--mjcf", "own/arm.xml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "damping of joints 30%" in done.stdout
    done = twin("rollout", "arm", "--random", 6, "--seconds", 2, "--out", "rolled", "--jobs", 1, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rolled = read(tmp_path / "rolled")
    assert "MuJoCo steps" in rolled.source
    commands = np.concatenate([t.values["actuator.servo.ctrl"] for t in rolled.trials])
    assert -0.6 <= commands.min() < -0.2  # of its whole range
    assert 0.2 < commands.max() <= 0.6
    assert min(t.values["actuator.pull.ctrl"].min() for t in rolled.trials) >= 0.0
    done = twin("simulate", "arm", "rolled", "--out", "simulated", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    again = read(tmp_path / "simulated").trials[0].values["joint.elbow.position"]
    # rad: both are the twin's steps; the files are in degrees to the last digit
    assert again == pytest.approx(rolled.trials[0].values["joint.elbow.position"], abs=1e-12)
    rng, noise = np.random.default_rng(1), 1e-3
    kept = [c for c in rolled.channels if c.role == "input" or c.name.startswith("joint.")]
    angles = [c.name for c in kept if c.role == "output"]
    trials = tuple(
        replace(t, values={c.name: t.values[c.name] + noise * rng.standard_normal(len(t.time)) * (c.name in angles) for c in kept})
        for t in rolled.trials
    )
    channels = tuple(replace(c, noise=noise if c.name in angles else None) for c in kept)
    write(replace(rolled, channels=channels, trials=trials, robot="../arm"), tmp_path / "noisy")
    done = twin("diagnose", "noisy", "--out", "report", "--jobs", 1, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "report/report.json").read_text())["verdict"] == "noise"


def test_controls_without_a_range_are_told(tmp_path: Path) -> None:
    arm(tmp_path / "own", ARM.replace(' ctrlrange="0 1.5"', ""))
    assert twin("new", "arm", "--mjcf", "own/arm.xml", cwd=tmp_path).returncode == 0
    done = twin("rollout", "arm", "--random", 1, "--out", "rolled", cwd=tmp_path)
    assert (done.returncode, "actuator.pull.ctrl has no range to draw from" in done.stderr) == (2, True)
    done = twin("rollout", "arm", "--random", 2, "--seconds", 1, "--pull", 0.3, "--out", "rolled", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    commands = read(tmp_path / "rolled").trials[0].values
    assert np.abs(commands["actuator.pull.ctrl"]).max() <= 0.3
    assert np.abs(commands["actuator.servo.ctrl"]).max() <= 0.3


def test_its_picture_has_its_geoms_and_names_its_sites(tmp_path: Path) -> None:
    """A mesh by the box about it, a ball by circles, a rod by its axis; sites that guide a tendon are on it already."""
    floor = '<geom type="plane" size="0 0 1"/>'  # without end: not drawn
    text = ARM.replace('<site name="winch"', floor + '<site name="camera" pos="0 0.1 0"/><site name="winch"')
    folder, _ = write_model_starter("arm", arm(tmp_path / "own", text), tmp_path)
    drawn: Any = draw_robot(load(str(folder))).data
    traces = {t.name: np.array([t.x, t.y, t.z], float).T for t in drawn}
    rod = traces["body"][np.isfinite(traces["body"]).all(axis=1)]
    assert rod == pytest.approx(np.array([[0.0, 0.0, -200.0], [0.0, 0.0, 0.0]]), abs=1e-9)  # mm
    shapes = traces["disks, plates, pulleys"]
    ball = np.linalg.norm(shapes, axis=1) < 10.0 + 1e-9  # of the shell, at the shoulder
    assert ball.sum() == 3 * 49
    assert np.nanmin(shapes[:, 2]) == pytest.approx(-350.0, abs=1e-3)  # the tip of the mesh, of single precision
    (marks,) = (t for t in drawn if t.name == "markers")
    assert list(marks.text) == ["site.camera"]
